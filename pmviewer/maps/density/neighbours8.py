"""How far eight photons of a block are from a place, and which of them are its neighbours, at once."""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from pmviewer.kernels.memory import F32, I8, I32, at_address, with_twin
from pmviewer.maps.search.simd import (
    ROW_BYTES,
    VECTOR,
    WIDTH,
    bits_of,
    counted,
    counted_of,
    load_eight,
    splat,
)

ROWS = 6
X, Y, Z, WORD, NEED, MEMBER = range(ROWS)
"""Rows of a block of eight photons, like a grid's (`pmviewer.maps.search.simd`): coordinates, direction, required
density and number. What is not taken is infinitely far."""


def _plainly(block, p, n, steepness, ceiling):
    """In plain Python: squared distances of eight, and which need no more than `ceiling`."""
    far, _ = counted([block + row * ROW_BYTES for row in range(3)], p, n, steepness)
    return far, at_address(block + NEED * ROW_BYTES, WIDTH, np.float32) <= ceiling


def _built(builder, block, p, n, steepness, ceiling):
    """The same in LLVM's builder."""
    row = [builder.add(block, ir.Constant(block.type, ROW_BYTES * j)) for j in range(NEED + 1)]
    far, _ = counted_of(builder, row[:3], p, n, steepness)
    return far, builder.fcmp_ordered("<=", load_eight(builder, row[NEED]), splat(builder, ceiling))


def _bits(builder, mask):
    return builder.zext(builder.bitcast(mask, I8), I32)


def _neighbours8(block, p, n, steepness, r2, ceiling, squared):
    far, small = _plainly(block, p, n, steepness, ceiling)
    squared.view(np.float32)[:WIDTH] = far
    return bits_of((far < r2) & small)


@with_twin(_neighbours8)
def neighbours8(typingctx, block, p, n, steepness, r2, ceiling, squared):
    """Which photons of a block of a density control's tree count as closer than sqrt(r2) to a place and need no more
    than `ceiling`.

    block: int64 address of the block; p, n: float32 triples, the place and the normal there; steepness: float32 weight
    of the squared height over the surface; squared: pointer to 8 float32 of scratch that receive the squared distances
    by which photons count. Returns int32 with bit j set for photon j.
    """
    f, triple = types.float32, types.UniTuple(types.float32, 3)
    signature = types.int32(types.int64, triple, triple, f, f, f, types.CPointer(types.int32))

    def codegen(context, builder, sig, args):
        block, p, n, steepness, r2, ceiling, out = args
        far, small = _built(builder, block, p, n, steepness, ceiling)
        builder.store(far, builder.bitcast(out, VECTOR.as_pointer())).align = 4
        return _bits(builder, builder.and_(builder.fcmp_ordered("<", far, splat(builder, r2)), small))

    return signature, codegen


def _distances8(block, p, n, steepness, ceiling, into):
    far, small = _plainly(block, p, n, steepness, ceiling)
    at_address(into, WIDTH, np.float32)[:] = np.where(small, far, np.float32(np.inf))


@with_twin(_distances8)
def distances8(typingctx, block, p, n, steepness, ceiling, into):
    """The squared distances by which the photons of a block count at a place, as `neighbours8` has them, infinite where
    they need more than `ceiling`; to the int64 address `into`, as float32."""
    f, triple = types.float32, types.UniTuple(types.float32, 3)
    signature = types.void(types.int64, triple, triple, f, f, types.int64)

    def codegen(context, builder, sig, args):
        block, p, n, steepness, ceiling, into = args
        far, small = _built(builder, block, p, n, steepness, ceiling)
        nowhere = splat(builder, ir.Constant(F32, float("inf")))
        place = builder.inttoptr(into, VECTOR.as_pointer())
        builder.store(builder.select(small, far, nowhere), place).align = 4
        return context.get_dummy_value()

    return signature, codegen


def _below8(address, limit):
    return bits_of(at_address(address, WIDTH, np.float32) < limit)


@with_twin(_below8)
def below8(typingctx, address, limit):
    """Which of the eight float32 at an int64 address are below the limit; int32 with bit j set for the j-th."""
    signature = types.int32(types.int64, types.float32)

    def codegen(context, builder, sig, args):
        address, limit = args
        return _bits(builder, builder.fcmp_ordered("<", load_eight(builder, address), splat(builder, limit)))

    return signature, codegen


def _inside8(block, low, high):
    rows = (at_address(block + row * ROW_BYTES, WIDTH, np.float32) for row in range(3))
    return bits_of(np.all([(x >= a) & (x <= b) for x, a, b in zip(rows, low, high)], axis=0))


@with_twin(_inside8)
def inside8(typingctx, block, low, high):
    """Which photons of a block lie in the box with the corners low and high, float32 triples; int32 with bit j set for
    photon j."""
    triple = types.UniTuple(types.float32, 3)
    signature = types.int32(types.int64, triple, triple)

    def codegen(context, builder, sig, args):
        block, low, high = args
        mask = None
        for row, (a, b) in enumerate(zip(*(cgutils.unpack_tuple(builder, corner, 3) for corner in (low, high)))):
            x = load_eight(builder, builder.add(block, ir.Constant(block.type, ROW_BYTES * row)))
            above = builder.fcmp_ordered(">=", x, splat(builder, a))
            inside = builder.and_(above, builder.fcmp_ordered("<=", x, splat(builder, b)))
            mask = inside if mask is None else builder.and_(mask, inside)
        return _bits(builder, mask)

    return signature, codegen
