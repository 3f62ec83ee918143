"""Docstrings name others by Sphinx roles; here the roles become links, where there is such an entry."""

from __future__ import annotations

import re
from typing import Any

import griffe

_ROLE = re.compile(r":(?:func|class|meth|mod|data|attr):`~?([\w.]+)`")


class Roles(griffe.Extension):
    """``:func:`name` `` becomes a link to the entry of that name, or the name where it has none."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of whatever has been loaded."""
        if obj.docstring is None:
            return
        module = obj.module.path

        def link(found: re.Match[str]) -> str:
            name = found.group(1)
            path = name if name.startswith("nichechain") else f"{module}.{name}"
            return f'<autoref identifier="{path}" optional><code>{name}</code></autoref>'

        obj.docstring.value = _ROLE.sub(link, obj.docstring.value)
