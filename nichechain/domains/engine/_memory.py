"""Memory by its address, from compiled code, in an order that other threads can rely on."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

# numba prescribes the arguments of all these functions, used or not.
_WORD = ir.IntType(64)


def _load(typing_context: Any, address: Any) -> Any:  # noqa: ARG001
    """``load(address)``: the int64 there, and everything that was written before it was."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:  # noqa: ARG001
        pointer = builder.inttoptr(values[0], _WORD.as_pointer())
        return builder.load_atomic(pointer, "acquire", 8)

    return types.int64(types.int64), generate


def _store(typing_context: Any, address: Any, value: Any) -> Any:  # noqa: ARG001
    """``store(address, value)``: for whoever loads it, all that was written before is there."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:  # noqa: ARG001
        pointer = builder.inttoptr(values[0], _WORD.as_pointer())
        builder.store_atomic(values[1], pointer, "release", 8)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


def _floats_at(typing_context: Any, address: Any) -> Any:  # noqa: ARG001
    """``floats_at(address)``: a pointer to float64, for ``numba.carray``."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:  # noqa: ARG001
        return builder.inttoptr(values[0], ir.DoubleType().as_pointer())

    pointer = types.CPointer(types.float64)  # type: ignore[no-untyped-call]
    return pointer(types.int64), generate


load: Any = intrinsic(_load)
store: Any = intrinsic(_store)
floats_at: Any = intrinsic(_floats_at)
