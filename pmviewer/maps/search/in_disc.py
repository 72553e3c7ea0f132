"""Which of eight photons belong to a look-up's disc, by side, height, path class, and the surface's normal."""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from pmviewer.kernels.memory import I8, I32, I64, at_address, with_twin
from pmviewer.maps.photon_words import decode_direction, decode_normal
from pmviewer.maps.search.sides import SURELY, is_apart
from pmviewer.maps.search.simd import (
    BITS,
    FAST,
    ROW_BYTES,
    VECTOR,
    WIDTH,
    WORDS,
    bits_of,
    constant,
    dot_of,
    intrinsic,
    load_eight,
    offsets,
    placed_of,
    splat,
)

FLAT = 1 / 2048
"""Of a disc's half-thickness: photons nearer to the plane are on a flat surface, whose sides `wi` tells apart."""


def _coordinates(builder, word, bits):
    """The lowest `bits` bits of either coordinate of eight codes of directions as float32, in LLVM's builder."""
    mask = constant(WORDS, (1 << bits) - 1)
    for shift in (20, 8):
        yield builder.sitofp(builder.and_(builder.lshr(word, constant(WORDS, shift)), mask), VECTOR)


def _unfolded(builder, u, v, size):
    """Vectors of eight places on the octahedron's square, from −size to size, of any length, in LLVM's builder."""
    z = builder.fsub(constant(VECTOR, size), intrinsic(builder, "fabs", u))
    z = builder.fsub(z, intrinsic(builder, "fabs", v))
    fold = intrinsic(builder, "maxnum", builder.fneg(z), constant(VECTOR, 0.0))
    x = builder.fsub(u, intrinsic(builder, "copysign", fold, u))
    y = builder.fsub(v, intrinsic(builder, "copysign", fold, v))
    return x, y, z


def _front(builder, word, normal):
    """Which of eight photons arrive from the side of a normal, as `decode_direction` has it: only the sign matters."""
    half = constant(VECTOR, 2047.0)
    u, v = (builder.fsub(x, half) for x in _coordinates(builder, word, 12))
    w = _unfolded(builder, u, v, 2047.0)
    return builder.fcmp_ordered(">", dot_of(builder, w, normal), constant(VECTOR, 0.0))


def _facing8(block, n):
    word = at_address(block + 3 * ROW_BYTES, WIDTH, np.uint32)
    return bits_of(np.array([sum(d * c for d, c in zip(decode_direction(w), n)) > 0 for w in word]))


@with_twin(_facing8)
def facing8(typingctx, block, n):
    """Which photons of a grid's block arrive from the side of a normal.

    block: int64 address of the block; n: float32 triple. Returns int32 with bit j set for photon j.
    """
    signature = types.int32(types.int64, types.UniTuple(types.float32, 3))

    def codegen(context, builder, sig, args):
        block, n = args
        normal = [splat(builder, x) for x in cgutils.unpack_tuple(builder, n, 3)]
        word = load_eight(builder, builder.add(block, ir.Constant(I64, 3 * ROW_BYTES)), WORDS)
        return builder.zext(builder.bitcast(_front(builder, word, normal), I8), I32)

    return signature, codegen


def _in_disc8(block, p, n, height, class_mask):
    above = sum(d * c for d, c in zip(offsets(*(block + row * ROW_BYTES for row in range(3)), *p), n))
    word = at_address(block + 3 * ROW_BYTES, WIDTH, np.uint32)
    wanted = (int(class_mask) >> (word >> 6 & 3).astype(np.int64)) & 1
    front = [sum(d * c for d, c in zip(decode_direction(w), n)) > 0 for w in word]
    inside = (np.abs(above) <= height) & (wanted == 1) & front
    return bits_of(inside) | bits_of(inside & (np.abs(above) > height * np.float32(FLAT))) << 8


@with_twin(_in_disc8)
def in_disc8(typingctx, block, p, n, height, class_mask):
    """Which photons of a grid's block arrive from the side of the normal, within `height` of the tangent plane, on a
    path of a class in `class_mask`.

    block: int64 address of the block; p, n: float32 triples, point and normal; height: float32; class_mask: int32.
    Returns int32 with bit j set for photon j, and bit 8 + j, too, if that is off the plane by more than FLAT of the
    height.
    """
    triple = types.UniTuple(types.float32, 3)
    signature = types.int32(types.int64, triple, triple, types.float32, types.int32)

    def codegen(context, builder, sig, args):
        block, p, n, height, class_mask = args
        normal, d = placed_of(builder, block, p, n)
        above = intrinsic(builder, "fabs", dot_of(builder, d, normal))
        most = splat(builder, height)
        inside = builder.fcmp_ordered("<=", above, most)
        off = builder.fcmp_ordered(">", above, builder.fmul(most, constant(VECTOR, FLAT), flags=FAST))
        word = load_eight(builder, builder.add(block, ir.Constant(I64, 3 * ROW_BYTES)), WORDS)
        path_class = builder.and_(builder.lshr(word, constant(WORDS, 6)), constant(WORDS, 3))
        wanted = builder.trunc(builder.lshr(splat(builder, class_mask, WORDS), path_class), BITS)
        mask = builder.and_(builder.and_(inside, wanted), _front(builder, word, normal))
        low, high = (builder.zext(builder.bitcast(x, I8), I32) for x in (mask, builder.and_(mask, off)))
        return builder.or_(low, builder.shl(high, ir.Constant(I32, WIDTH)))

    return signature, codegen


def _apart8(block, p, n):
    d = np.transpose(offsets(*(block + row * ROW_BYTES for row in range(3)), *p))
    word = at_address(block + 3 * ROW_BYTES, WIDTH, np.uint32)
    return bits_of(np.array([is_apart(decode_normal(w), each, n) for w, each in zip(word, d)]))


@with_twin(_apart8)
def apart8(typingctx, block, p, n):
    """Which photons of a grid's block `pmviewer.maps.search.sides.is_apart` finds apart from a place.

    block: int64 address of the block; p, n: float32 triples, point and normal. Returns int32 with bit j set for
    photon j.
    """
    triple = types.UniTuple(types.float32, 3)
    signature = types.int32(types.int64, triple, triple)

    def codegen(context, builder, sig, args):
        block, p, n = args
        normal, d = placed_of(builder, block, p, n)
        word = load_eight(builder, builder.add(block, ir.Constant(I64, 3 * ROW_BYTES)), WORDS)
        two, seven, zero = (constant(VECTOR, x) for x in (2.0, 7.0, 0.0))
        u, v = (
            builder.fsub(builder.fmul(x, two, flags=FAST), seven, flags=FAST) for x in _coordinates(builder, word, 3)
        )
        m = _unfolded(builder, u, v, 8.0)
        least = builder.fmul(dot_of(builder, m, m), constant(VECTOR, SURELY), flags=FAST)
        cosine = dot_of(builder, m, normal)
        signed = builder.fmul(cosine, intrinsic(builder, "fabs", cosine), flags=FAST)
        away = builder.fcmp_ordered("<", signed, least)
        along = intrinsic(builder, "minnum", dot_of(builder, m, d), zero)
        far = builder.fmul(least, dot_of(builder, d, d), flags=FAST)
        before = builder.fcmp_ordered(">", builder.fmul(along, along, flags=FAST), far)
        below = builder.fcmp_ordered("<", dot_of(builder, d, normal), zero)
        mask = builder.or_(away, builder.and_(before, below))
        return builder.zext(builder.bitcast(mask, I8), I32)

    return signature, codegen
