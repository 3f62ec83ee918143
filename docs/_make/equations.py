"""Equations become MathML, which browsers draw by themselves: no script and nothing to fetch."""

from __future__ import annotations

import html
import re

from latex2mathml.converter import convert

_EQUATION = re.compile(r'<(span|div) class="arithmatex">(.*?)</\1>', re.DOTALL)


def to_mathml(page: str) -> str:
    r"""Convert what arithmatex leaves: \(...\) in a line, \[...\] on lines of its own."""
    return _EQUATION.sub(_mathml, page)


def _mathml(found: re.Match[str]) -> str:
    tag, latex = found.group(1), html.unescape(found.group(2)).strip()[2:-2].strip()
    equation = convert(latex, display="block" if tag == "div" else "inline")
    # Who copies an equation, or has it read aloud, gets the source.
    labelled = equation.replace("<math ", f'<math alttext="{html.escape(latex, quote=True)}" ', 1)
    return f'<{tag} class="equation">{labelled}</{tag}>'
