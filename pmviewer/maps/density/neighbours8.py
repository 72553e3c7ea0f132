"""Which of eight photons of a block are neighbours of a place, at once."""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from pmviewer.kernels.memory import I8, I32, at_address, with_twin
from pmviewer.maps.search.simd import (
    FAST,
    ROW_BYTES,
    VECTOR,
    WIDTH,
    bits_of,
    dot_of,
    intrinsic,
    load_eight,
    offsets,
    splat,
)

ROWS = 6
X, Y, Z, WORD, NEED, MEMBER = range(ROWS)
"""Rows of a block of eight photons, like a grid's (`pmviewer.maps.search.simd`): coordinates, direction, required
density and number. What is not taken is infinitely far."""


def _neighbours8(block, p, n, steepness, r2, ceiling, squared):
    rows = [block + row * ROW_BYTES for row in range(3)]
    d = offsets(*rows, *p)
    height = sum(a * c for a, c in zip(d, n))
    counted = np.maximum(sum(a * a for a in d), steepness * height * height)
    squared.view(np.float32)[:WIDTH] = counted
    return bits_of((counted < r2) & (at_address(block + NEED * ROW_BYTES, WIDTH, np.float32) <= ceiling))


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
        row = [builder.add(block, ir.Constant(block.type, ROW_BYTES * j)) for j in range(NEED + 1)]
        normal = [splat(builder, x) for x in cgutils.unpack_tuple(builder, n, 3)]
        d = [
            builder.fsub(load_eight(builder, address), splat(builder, coordinate), flags=FAST)
            for address, coordinate in zip(row, cgutils.unpack_tuple(builder, p, 3))
        ]
        height = dot_of(builder, d, normal)
        above = builder.fmul(builder.fmul(height, height, flags=FAST), splat(builder, steepness), flags=FAST)
        counted = intrinsic(builder, "maxnum", dot_of(builder, d, d), above)
        builder.store(counted, builder.bitcast(out, VECTOR.as_pointer())).align = 4
        mask = builder.and_(
            builder.fcmp_ordered("<", counted, splat(builder, r2)),
            builder.fcmp_ordered("<=", load_eight(builder, row[NEED]), splat(builder, ceiling)),
        )
        return builder.zext(builder.bitcast(mask, I8), I32)

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
        return builder.zext(builder.bitcast(mask, I8), I32)

    return signature, codegen
