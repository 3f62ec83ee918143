"""Call a C function by its address from compiled code.

The address is an argument, not a constant of the compiled code, so numba can keep the compiled
code on disk and another process, where the library lies elsewhere, can use it.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic


# numba prescribes the arguments of both functions, used or not.
def _call(typing_context: Any, address: Any, arguments: Any) -> Any:  # noqa: ARG001
    """``call(address, (a, b, ...))`` for a C function of word-sized arguments; no result."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:  # noqa: ARG001
        word = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [word] * len(arguments))
        pointer = builder.inttoptr(values[0], function.as_pointer())
        words = [builder.extract_value(values[1], i) for i in range(len(arguments))]
        builder.call(pointer, words)
        return context.get_dummy_value()

    words = types.UniTuple(types.int64, len(arguments))  # type: ignore[no-untyped-call]
    return types.void(types.int64, words), generate


call: Any = intrinsic(_call)
