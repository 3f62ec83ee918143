"""Links that hold in the repository hold on the site: to an example, its page; to other files, the name."""

from __future__ import annotations

import posixpath
import re

_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")
_EXAMPLE = re.compile(r"examples/(\d\d_\w+)\.py")


def rewrite(markdown: str, here: str) -> str:
    """Rewrite links that leave the folder of the documentation, in a page of the folder ``here``."""

    def follow(found: re.Match[str]) -> str:
        text, target = found.group(1), found.group(2)
        path = posixpath.normpath(posixpath.join("docs", here, target))
        if path.startswith("docs/"):
            return found.group(0)
        example = _EXAMPLE.fullmatch(path)
        if example:
            return f"[{text}]({posixpath.relpath(f'examples/{example.group(1)}.md', here)})"
        return text if "`" in text else f"`{path}`"

    return _LINK.sub(follow, markdown)
