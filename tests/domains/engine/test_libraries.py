"""Addresses of C functions: present, and those of the libraries that this process uses."""

from __future__ import annotations

import ctypes
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from nichechain.domains.engine import libraries
from nichechain.domains.engine.libraries import NativeUnavailableError


def mapping_of(address: int) -> str:
    """Name of the file that is mapped at an address."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        span, *_ = line.split()
        low, high = (int(part, 16) for part in span.split("-"))
        if low <= address < high:
            return Path(line.split(maxsplit=5)[-1]).name
    return ""


def test_every_address_lies_in_its_library() -> None:
    functions = libraries.load()
    for name, address in dataclasses.asdict(functions).items():
        if name.endswith("_data"):
            continue
        stem = "libmujoco" if name.startswith("mj_") else "_multiarray_umath"
        assert mapping_of(address).startswith(stem), name


def test_array_has_the_addresses_in_order() -> None:
    functions = libraries.load()
    array = functions.as_array()
    assert array.dtype == np.int64
    assert array.tolist() == list(dataclasses.asdict(functions).values())


def test_arctan2_loop_is_numpys() -> None:
    """Called through its address, the loop gives the bits of np.arctan2."""
    functions = libraries.load()
    loop = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4)(functions.arctan2)
    rng = np.random.default_rng(0)
    y, x = rng.standard_normal((2, 1000))
    out = np.empty(1000)
    arguments = np.array([y.ctypes.data, x.ctypes.data, out.ctypes.data])
    count, steps = np.array([1000]), np.full(3, 8)
    loop(arguments.ctypes.data, count.ctypes.data, steps.ctypes.data, functions.arctan2_data)
    np.testing.assert_array_equal(out, np.arctan2(y, x))


def test_library_that_is_not_mapped() -> None:
    with pytest.raises(NativeUnavailableError, match="libnowhere"):
        libraries._mapped_library("libnowhere")


def test_other_layout_of_a_ufunc_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """One more word before the fields, as another NumPy might have it."""

    class Shifted(ctypes.Structure):
        _fields_ = (("extra", ctypes.c_void_p), *libraries._UFunc._fields_)

    monkeypatch.setattr(libraries, "_UFunc", Shifted)
    with pytest.raises(NativeUnavailableError, match="lays out its ufuncs differently"):
        libraries.load()


def test_big_endian_machines_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries.sys, "byteorder", "big")
    with pytest.raises(NativeUnavailableError, match="64-bit little-endian"):
        libraries.load()


def test_ufunc_without_the_signature_is_unavailable() -> None:
    """The fallback catches NativeUnavailableError, so nothing else may come out."""
    with pytest.raises(NativeUnavailableError):
        libraries._ufunc_loop(np.arctan2, "zz->z")
