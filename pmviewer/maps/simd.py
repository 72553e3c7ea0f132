"""Distance tests on eight photons at once.

Positions are stored as three separate arrays (structure of arrays), so that eight of them load as one LLVM vector
`<8 x float>` each; machines without AVX split it into two halves by themselves. Arrays are padded by `WIDTH` elements
so that the last load stays inside them.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from pmviewer.kernels.memory import F32, I8, I32

WIDTH = 8
_VECTOR = ir.VectorType(F32, WIDTH)
_FAST = ("contract", "reassoc", "nsz")


def _splat(builder, scalar):
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), scalar, ir.Constant(I32, 0))
    zeros = ir.Constant(ir.VectorType(I32, WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(first, ir.Constant(_VECTOR, ir.Undefined), zeros)


@intrinsic
def within8(typingctx, x_array, y_array, z_array, i, x, y, z, r2, squared):
    """Which of the photons i … i+7 lie closer than sqrt(r2) to (x, y, z).

    Parameters
    ----------
    x_array, y_array, z_array: int64 addresses of the float32 coordinates.
    i: int64 index of the first of the eight.
    r2: float32 squared radius; the comparison is strict.
    squared: pointer to 8 float32 of scratch that receive the squared distances.

    Returns
    -------
    int32 with bit j set when photon i+j is inside.
    """
    f, i8 = types.float32, types.int64
    signature = types.int32(i8, i8, i8, i8, f, f, f, f, types.CPointer(types.int32))

    def codegen(context, builder, sig, args):
        *arrays, index, x, y, z, limit, out = args
        total = None
        for array, coordinate in zip(arrays, (x, y, z)):
            start = builder.gep(builder.inttoptr(array, F32.as_pointer()), [index])
            values = builder.load(builder.bitcast(start, _VECTOR.as_pointer()))
            values.align = 4
            d = builder.fsub(values, _splat(builder, coordinate), flags=_FAST)
            square = builder.fmul(d, d, flags=_FAST)
            total = square if total is None else builder.fadd(total, square, flags=_FAST)
        builder.store(total, builder.bitcast(out, _VECTOR.as_pointer())).align = 4
        mask = builder.fcmp_ordered("<", total, _splat(builder, limit))
        return builder.zext(builder.bitcast(mask, I8), I32)

    return signature, codegen


@intrinsic
def count_bits(typingctx, mask):
    """Number of set bits of an int32."""
    signature = types.int32(types.int32)

    def codegen(context, builder, sig, args):
        return builder.ctpop(args[0])

    return signature, codegen
