"""Addresses of the C functions that an episode calls, in the libraries this process has loaded.

Physics comes from the very libmujoco that the Python bindings mapped. The two array functions
whose bits differ between machines, arctan2 and a matrix times a vector, come from NumPy itself,
through the inner loops that its ufunc objects point to (the public struct ``PyUFuncObject`` of
``numpy/ufuncobject.h``): gymnasium-robotics computes its observations with NumPy, so whatever
BLAS or vector unit NumPy picked here, ours gives the same bits.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np


class NativeUnavailableError(RuntimeError):
    """The native engine cannot run here; the message says why."""


@dataclass(frozen=True)
class Functions:
    """Addresses of C functions, as plain integers.

    The ufunc loops take ``(char **args, npy_intp *dimensions, npy_intp *steps, void *data)``.
    """

    mj_step: int
    mj_forward: int
    mj_copy_data: int
    mj_jac_site: int
    mj_get_state: int
    mj_set_state: int
    arctan2: int
    arctan2_data: int
    matmul: int
    matmul_data: int

    def as_array(self) -> np.ndarray:
        """The addresses in the order above, for the compiled kernel."""
        return np.array([getattr(self, name) for name in self.__dataclass_fields__], np.int64)


def load() -> Functions:
    """Find every function.

    Raises
    ------
    NativeUnavailableError
        If the mapped libmujoco or NumPy's inner loops cannot be found.
    """
    if ctypes.sizeof(ctypes.c_void_p) != 8 or sys.byteorder != "little":
        raise NativeUnavailableError("the native engine needs a 64-bit little-endian machine")
    library = ctypes.CDLL(str(_mapped_library("libmujoco")))

    def address(name: str) -> int:
        return ctypes.cast(getattr(library, name), ctypes.c_void_p).value or 0

    arctan2, arctan2_data = _ufunc_loop(np.arctan2, "dd->d")
    matmul, matmul_data = _ufunc_loop(np.matmul, "dd->d")
    return Functions(
        mj_step=address("mj_step"),
        mj_forward=address("mj_forward"),
        mj_copy_data=address("mj_copyData"),
        mj_jac_site=address("mj_jacSite"),
        mj_get_state=address("mj_getState"),
        mj_set_state=address("mj_setState"),
        arctan2=arctan2,
        arctan2_data=arctan2_data,
        matmul=matmul,
        matmul_data=matmul_data,
    )


def _mapped_library(stem: str) -> Path:
    import mujoco  # noqa: F401  # maps the library

    maps = Path("/proc/self/maps")
    if maps.exists():
        for line in maps.read_text().splitlines():
            path = Path(line.split(maxsplit=5)[-1])
            if path.name.startswith(stem):
                return path
        raise NativeUnavailableError(f"this process has not mapped {stem}")
    if hasattr(ctypes.util, "dllist"):  # Python 3.14 and newer
        for name in ctypes.util.dllist():
            if Path(name).name.startswith(stem):
                return Path(name)
    raise NativeUnavailableError(f"this platform does not say which {stem} it has mapped")


class _UFunc(ctypes.Structure):
    _fields_ = (
        ("head", ctypes.c_byte * object.__basicsize__),
        ("nin", ctypes.c_int),
        ("nout", ctypes.c_int),
        ("nargs", ctypes.c_int),
        ("identity", ctypes.c_int),
        ("functions", ctypes.POINTER(ctypes.c_void_p)),
        ("data", ctypes.POINTER(ctypes.c_void_p)),
        ("ntypes", ctypes.c_int),
        ("reserved", ctypes.c_int),
        ("name", ctypes.c_char_p),
    )


def _ufunc_loop(ufunc: np.ufunc, signature: str) -> tuple[int, int]:
    """Address of the inner loop for a signature, and of the data that goes with it."""
    struct = _UFunc.from_address(id(ufunc))
    known = (struct.nin, struct.nout, struct.ntypes, struct.name)
    if known != (ufunc.nin, ufunc.nout, ufunc.ntypes, ufunc.__name__.encode()):
        raise NativeUnavailableError(f"NumPy {np.__version__} lays out its ufuncs differently")
    if signature not in ufunc.types:
        raise NativeUnavailableError(f"NumPy {np.__version__} has no {ufunc.__name__} for {signature}")
    index = ufunc.types.index(signature)
    data = struct.data[index] if struct.data else None
    return struct.functions[index] or 0, data or 0
