"""What kind of machine, and which versions of libraries, made a result: bits can depend on them."""

from __future__ import annotations

import hashlib
import math
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nichechain._version import __version__


def machine() -> dict[str, str]:
    """What numbers can depend on besides the versions of libraries.

    Returns
    -------
    dict
        ``machine`` (instruction set), ``system``, ``libc``, and ``simd``: the groups of vector
        instructions that NumPy found and that it picks its loops by. ``libm`` and ``numpy_math`` are
        fingerprints of what they can lead to: of the bits that the functions of the C library, and
        those of NumPy and its BLAS, give here. All of it is the same whenever it is asked for on one
        machine.
    """
    return dict(_machine())


@cache
def _machine() -> dict[str, str]:
    built: Any = np.show_config(mode="dicts")
    extensions = built.get("SIMD Extensions", {})
    groups = [*extensions.get("baseline", []), *extensions.get("found", [])]
    return {
        "machine": platform.machine(),
        "system": platform.system(),
        "libc": " ".join(platform.libc_ver()).strip() or "unknown",
        "simd": " ".join(groups) or "none",
        "libm": _fingerprint(_of_libm()),
        "numpy_math": _fingerprint(_of_numpy()),
    }


def library_versions() -> dict[str, str]:
    """Versions of the libraries whose numbers end up in an archive."""
    return dict(_versions())


# Every commit of a build says them, and to find them takes as long as to mutate a thousand children.
@cache
def _versions() -> dict[str, str]:
    found = {"nichechain": __version__, "python": platform.python_version()}
    for name in ("numpy", "numba", "torch", "mujoco", "gymnasium", "gymnasium-robotics", "ribs"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "none"
    return found


def _points() -> NDArray[np.float64]:
    # An additive recurrence: no two alike, and made without what is to be tested.
    points: NDArray[np.float64] = np.arange(1.0, 1001.0) * 0.6180339887498949 % 1.0
    return points


def _of_libm() -> bytes:
    """Functions that simulators and generators call one number at a time."""
    near, wide = _points().tolist(), (_points() * 20.0 - 10.0).tolist()
    values = [f(x) for f in (math.sin, math.cos, math.tan, math.exp, math.tanh, math.atan) for x in wide]
    values += [f(x) for f in (math.asin, math.acos, math.log, math.log1p, math.expm1) for x in near]
    values += [math.pow(x, y) for x, y in zip(near, wide, strict=True)]
    values += [math.atan2(x, y) for x, y in zip(wide, near, strict=True)]
    return np.array(values, "<f8").tobytes()


def _of_numpy() -> bytes:
    """Functions and sums over arrays, which are done in vectors."""
    near, wide = _points(), _points() * 20.0 - 10.0
    values = [f(wide) for f in (np.sin, np.cos, np.exp, np.tanh, np.arctan)]
    values += [f(near) for f in (np.log, np.log1p, np.arcsin, np.cbrt)]
    values.append(np.array([np.linalg.norm(wide), wide @ near, wide.sum(), wide.var()]))
    singles = [f(wide.astype(np.float32)) for f in (np.sin, np.cos, np.exp, np.tanh)]
    return np.concatenate([*values, *singles], dtype=np.float64).astype("<f8").tobytes()


def _fingerprint(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:16]
