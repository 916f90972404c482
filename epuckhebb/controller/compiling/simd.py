"""Four numbers at a time: one instruction of the processor, where numba's loops over seven or five take one for each.

numba has no such type, so it is made here, with the few operations that the network and the plastic update need. In
Python these are functions of arrays of four; a kernel has LLVM's own instruction for each. Each of the four numbers is
the result of the same operations in the same order as alone, so results are bit-identical.

On arm64, LLVM makes two vectors of two of each, and fuses no product with a sum: so it was in the code that LLVM 22
wrote for three such processors. Results may still differ there, because the C compiler may fuse in pymunk and in libm.
"""

import inspect
from collections.abc import Callable
from typing import Any

import numba.extending
import numpy as np
from llvmlite import ir
from numba import types

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import BUILDING_BLOCK

WIDTH = 4
_numba: Any = numba  # its own types say nothing of these functions


class _Four(types.Type):
    """What four numbers are for numba."""


_FOUR: Any = _Four("four float64")


def _vector(of: Any) -> Any:
    return ir.VectorType(of, WIDTH)


_numba.extending.register_model(_Four)(
    lambda manager, of_type: _numba.extending.models.PrimitiveModel(manager, of_type, _vector(ir.DoubleType()))
)


def _inline(result: Any, instructions: Callable[..., Any]) -> Callable[[Any], Any]:
    """Let kernels have LLVM's instructions in place of a plain function.

    instructions: a function of LLVM's builder and of the arguments, arrays as pointers to their numbers.
    """

    def typed(*arguments: Any) -> Any:
        def written(context: Any, builder: Any, _signature: Any, values: Any) -> Any:
            operands = [
                _numba.core.cgutils.create_struct_proxy(kind)(context, builder, value=value).data
                if isinstance(kind, types.Array)
                else value
                for kind, value in zip(arguments, values, strict=True)
            ]
            made = instructions(builder, *operands)
            return context.get_dummy_value() if result is types.none else made

        return result(*arguments), written

    def attach(plain: Any) -> Any:
        names = ", ".join(inspect.signature(plain).parameters)

        def named(more: str, expression: str, value: Any = None) -> Any:  # numba wants the arguments by name
            return eval(f"lambda {more}{names}: {expression}", {"value": value})

        in_kernels = _numba.extending.intrinsic(named("typing, ", f"value({names})", typed))
        call = named("", f"value({names})", in_kernels)
        _numba.extending.overload(plain, jit_options=BUILDING_BLOCK)(named("", "value", call))
        return plain

    return attach


def _place(builder: Any, numbers: Any, first: Any) -> Any:
    return builder.bitcast(builder.gep(numbers, [first]), _vector(ir.DoubleType()).as_pointer())


def _copies(builder: Any, number: Any) -> Any:
    index = ir.IntType(32)
    first = builder.insert_element(ir.Constant(_vector(ir.DoubleType()), [0.0] * WIDTH), number, ir.Constant(index, 0))
    return builder.shuffle_vector(first, first, ir.Constant(_vector(index), [0] * WIDTH))


def whole(count: int) -> int:
    """How many numbers are in the vectors that hold `count` numbers."""
    return -(-count // WIDTH) * WIDTH


@_inline(_FOUR, _copies)
def alike(number: float) -> Any:
    """Four times the same number."""
    return np.full(WIDTH, number)


@_inline(_FOUR, lambda builder, numbers, first: builder.load(_place(builder, numbers, first), align=8))
def read(numbers: Floats, first: int) -> Any:
    """The four numbers of an array from a place on. In a kernel nothing checks that it has as many."""
    return numbers[first : first + WIDTH].copy()


@_inline(types.none, lambda builder, numbers, first, four: builder.store(four, _place(builder, numbers, first), 8))
def write(numbers: Floats, first: int, four: Any) -> None:
    """Write four numbers into an array from a place on. In a kernel nothing checks that there is room for them."""
    numbers[first : first + WIDTH] = four


@_inline(_FOUR, lambda builder, one, other: builder.fmul(one, other))
def times(left: Any, right: Any) -> Any:
    """The products of four numbers and four others."""
    return left * right


@_inline(_FOUR, lambda builder, one, other: builder.fadd(one, other))
def plus(left: Any, right: Any) -> Any:
    """The sums of four numbers and four others."""
    return left + right
