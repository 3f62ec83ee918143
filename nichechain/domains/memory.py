"""How much memory a domain may spend on not computing twice what it has computed."""

from __future__ import annotations

import re
from typing import Any

from nichechain.core.checks import check_whole, shown
from nichechain.core.errors import NichechainError
from nichechain.domains.base import Wrapper

CACHE_MEMORY = 2 * 2**30
"""Bytes of the cache of a process, unless told otherwise: suits 24 GiB and what else runs there."""

_UNITS = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "KIB": 2**10, "MIB": 2**20, "GIB": 2**30}


def check_cache_memory(cache_memory: object) -> None:
    """Refuse what is no number of bytes.

    Raises
    ------
    NichechainError
        If it is no whole number, or a negative one.
    """
    check_whole(cache_memory=cache_memory)
    if cache_memory < 0:  # type: ignore[operator]
        raise NichechainError(f"cache_memory is {cache_memory}, but must not be negative (0: no cache)")


def parse_memory(text: str) -> int:
    """Bytes that a text such as ``2GiB``, ``500MB`` or ``0`` stands for.

    Raises
    ------
    NichechainError
        If it is no number with a unit of memory, or negative.
    """
    found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]*)", text.strip(), re.ASCII)
    if found is None or found[2].upper() not in _UNITS:
        raise NichechainError(
            f"cache_memory is {shown(text)}, but must be such as 2GiB or 500MB, or 0 for no cache"
        )
    return int(float(found[1]) * _UNITS[found[2].upper()])


def cache_memory_of(domain: Any) -> int:
    """Bytes for the cache of a domain, or of the domain that it wraps; 0 where there is none."""
    return int(getattr(_innermost(domain), "cache_memory", 0))


def limit_cache(domain: Any, cache_memory: int) -> None:
    """Set the memory of the cache of a domain, or of the domain that it wraps, where there is one."""
    inner = _innermost(domain)
    if getattr(inner, "cache_memory", cache_memory) != cache_memory:
        inner.cache_memory = cache_memory


def _innermost(domain: Any) -> Any:
    while isinstance(domain, Wrapper):
        domain = domain.domain
    return domain
