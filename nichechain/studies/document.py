"""A report as a list of blocks, written as Markdown and as one HTML page that needs no other file."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from nichechain.core.errors import NichechainError
from nichechain.core.files import as_path, write_atomically

_CSS = """
:root { color-scheme: light; }
body { margin: 0 auto; padding: 2.5rem 1.25rem 4rem; max-width: 66rem; color: #222; background: #fff;
  font: 17px/1.55 system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 1rem; }
h2 { font-size: 1.3rem; margin: 2.6rem 0 0.7rem; }
p, ul { max-width: 44rem; }
li { margin: 0.25rem 0; }
figure { margin: 1.5rem 0; }
figure img { width: 100%; height: auto; }
figcaption, caption { color: #555; font-size: 0.88rem; text-align: left; }
caption { padding: 0 0 0.4rem; }
.table { overflow-x: auto; margin: 1.2rem 0; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td { padding: 0.35rem 1rem 0.35rem 0; text-align: left; vertical-align: top; }
thead th { border-bottom: 2px solid #333; white-space: nowrap; }
tbody td { border-bottom: 1px solid #ddd; }
pre { background: #f5f5f5; padding: 0.8rem 1rem; overflow-x: auto; font-size: 0.85rem; }
"""


@dataclass(frozen=True)
class Heading:
    """The title of a section."""

    text: str


@dataclass(frozen=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list without an order."""

    texts: tuple[str, ...]


@dataclass(frozen=True)
class Code:
    """Lines that are shown as they are."""

    text: str


@dataclass(frozen=True)
class Table:
    """Rows of texts under their headings."""

    caption: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture that lies beside the document."""

    file: str
    caption: str


Block = Heading | Paragraph | Bullets | Code | Table | Picture


@dataclass(frozen=True)
class Document:
    """A title and what follows it.

    Parameters
    ----------
    title : str
    blocks : sequence of Block
    """

    title: str
    blocks: Sequence[Block]

    def markdown(self) -> str:
        """The document for a repository; its pictures lie beside it."""
        return "\n\n".join([f"# {_flat(self.title)}", *map(_markdown, self.blocks)]) + "\n"

    def html(self, pictures: Mapping[str, bytes]) -> str:
        """The document as one page.

        Parameters
        ----------
        pictures : mapping of str to bytes
            The PNG of each :class:`Picture` by its file.
        """
        title = escape(self.title)
        body = "\n".join(_html(block, pictures) for block in self.blocks)
        return (
            f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{title}</title>\n<style>{_CSS}</style>\n</head>\n"
            f"<body>\n<h1>{title}</h1>\n{body}\n</body>\n</html>\n"
        )


def _markdown(block: Block) -> str:
    match block:
        case Heading(text):
            return f"## {_flat(text)}"
        case Paragraph(text):
            return _flat(text)
        case Bullets(texts):
            return "\n".join(f"- {_flat(text)}" for text in texts)
        case Code(text):
            return f"```\n{text}\n```"
        case Picture(file, caption):
            return f"![{_flat(caption)}]({file})"
        case Table(caption, headings, rows):
            lines = [headings, tuple("---" for _ in headings), *rows]
            table = "\n".join(f"| {' | '.join(_flat(cell) for cell in line)} |" for line in lines)
            return f"{_flat(caption)}\n\n{table}"


def _html(block: Block, pictures: Mapping[str, bytes]) -> str:
    match block:
        case Heading(text):
            return f"<h2>{escape(text)}</h2>"
        case Paragraph(text):
            return f"<p>{escape(text)}</p>"
        case Bullets(texts):
            return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>"
        case Code(text):
            return f"<pre>{escape(text)}</pre>"
        case Picture(file, caption):
            data = base64.b64encode(pictures[file]).decode()
            said = escape(caption)
            return (
                f'<figure><img src="data:image/png;base64,{data}" alt="{said}">'
                f"<figcaption>{said}</figcaption></figure>"
            )
        case Table(caption, headings, rows):
            head = "".join(f'<th scope="col">{escape(text)}</th>' for text in headings)
            body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
            return (
                f'<div class="table"><table><caption>{escape(caption)}</caption>'
                f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
            )


def _flat(text: str) -> str:
    """Text that Markdown shows as it is: labels may hold what it would read as markup."""
    for mark in ("\\", "|", "*", "_", "<", "`"):
        text = text.replace(mark, f"\\{mark}")
    text = text.replace("](", "]\\(")
    return " ".join(text.split())


def write_files(folder: str | Path, files: Mapping[str, bytes]) -> None:
    """Write the files of a report, each whole or not at all.

    Raises
    ------
    NichechainError
        If they cannot be written.
    """
    folder = as_path("folder", folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in files.items():
            write_atomically(folder / name, data)
    except OSError as error:
        raise NichechainError(f"the report cannot be written to {folder}: {error}") from error
