"""Tests and sums over eight photons at once.

Each coordinate or word of eight photons lies in eight successive elements, so that it loads as one LLVM vector
`<8 x float>`; machines without AVX split it into two halves by themselves. Addresses are of the first of the eight.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from pmviewer.kernels.memory import F32, I8, I32, I64, at_address, with_twin
from pmviewer.maps.photon_words import decode_power
from pmviewer.maps.record import EXPONENT_BASE

WIDTH = 8
ROW_BYTES = 4 * WIDTH
BLOCK_BYTES = 6 * ROW_BYTES
"""A grid keeps eight photons in a block: the six words of their records in turn, eight to a row."""
VECTOR = ir.VectorType(F32, WIDTH)
WORDS = ir.VectorType(I32, WIDTH)
BITS = ir.VectorType(ir.IntType(1), WIDTH)
FAST = ("contract", "reassoc", "nsz")


def constant(vector, value):
    """Eight times the same number, known when compiling."""
    return ir.Constant(vector, [value] * WIDTH)


def splat(builder, scalar, vector=VECTOR):
    """Eight times the same number, in LLVM's builder."""
    undefined = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(undefined, scalar, ir.Constant(I32, 0))
    return builder.shuffle_vector(first, undefined, constant(WORDS, 0))


def load_eight(builder, address, vector=VECTOR):
    """Eight numbers at an int64 address, in LLVM's builder."""
    values = builder.load(builder.inttoptr(address, vector.as_pointer()))
    values.align = 4
    return values


def intrinsic(builder, name, *vectors):
    """An LLVM intrinsic on `<8 x float>`, such as fabs."""
    function_type = ir.FunctionType(VECTOR, [VECTOR] * len(vectors))
    function = cgutils.get_or_insert_function(builder.module, function_type, f"llvm.{name}.v{WIDTH}f32")
    return builder.call(function, vectors)


def dot_of(builder, a, b):
    """Sum of the products of vectors a and b, pair by pair, in LLVM's builder."""
    total = None
    for p, q in zip(a, b):
        product = builder.fmul(p, q, flags=FAST)
        total = product if total is None else builder.fadd(total, product, flags=FAST)
    return total


def counted_of(builder, addresses, p, n, steepness):
    """Of eight photons at three addresses, the squared distances by which they count at a place with a normal, as
    `counted` has them, and those in space, in LLVM's builder."""
    normal = [splat(builder, x) for x in cgutils.unpack_tuple(builder, n, 3)]
    d = [
        builder.fsub(load_eight(builder, address), splat(builder, coordinate), flags=FAST)
        for address, coordinate in zip(addresses, cgutils.unpack_tuple(builder, p, 3))
    ]
    total, height = dot_of(builder, d, d), dot_of(builder, d, normal)
    above = builder.fmul(builder.fmul(height, height, flags=FAST), splat(builder, steepness), flags=FAST)
    return intrinsic(builder, "maxnum", total, above), total


def counted(addresses, p, n, steepness):
    """In plain Python: squared distances (8,) by which photons at three addresses count at a place p with the unit
    normal n, the weight of the squared height over the plane there being `steepness`; and those in space."""
    d = offsets(*addresses, *p)
    total, height = sum(a * a for a in d), sum(a * c for a, c in zip(d, n))
    return np.maximum(total, steepness * height * height), total


def offsets(x_address, y_address, z_address, x, y, z):
    """In plain Python: of eight points at three addresses from (x, y, z), three float32 (8,)."""
    return [at_address(a, WIDTH, np.float32) - c for a, c in ((x_address, x), (y_address, y), (z_address, z))]


def bits_of(lanes):
    """In plain Python: int32 with bit j set where lane j of eight is."""
    return np.int32(np.packbits(lanes, bitorder="little")[0])


def _within8(x_address, y_address, z_address, x, y, z, r2, squared):
    total = sum(d * d for d in offsets(x_address, y_address, z_address, x, y, z))
    squared.view(np.float32)[:WIDTH] = total
    return bits_of(total < r2)


@with_twin(_within8)
def within8(typingctx, x_address, y_address, z_address, x, y, z, r2, squared):
    """Which of eight photons lie closer than sqrt(r2) to (x, y, z).

    Parameters
    ----------
    x_address, y_address, z_address: int64 addresses of the float32 coordinates.
    r2: float32 squared radius; the comparison is strict.
    squared: pointer to 8 float32 of scratch that receive the squared distances.

    Returns
    -------
    int32 with bit j set when photon j is inside.
    """
    f, i8 = types.float32, types.int64
    signature = types.int32(i8, i8, i8, f, f, f, f, types.CPointer(types.int32))

    def codegen(context, builder, sig, args):
        *addresses, x, y, z, limit, out = args
        d = [
            builder.fsub(load_eight(builder, address), splat(builder, coordinate), flags=FAST)
            for address, coordinate in zip(addresses, (x, y, z))
        ]
        total = dot_of(builder, d, d)
        builder.store(total, builder.bitcast(out, VECTOR.as_pointer())).align = 4
        mask = builder.fcmp_ordered("<", total, splat(builder, limit))
        return builder.zext(builder.bitcast(mask, I8), I32)

    return signature, codegen


def _nearer8(x_address, y_address, z_address, p, n, steepness, r2, e2, squared):
    far, total = counted((x_address, y_address, z_address), p, n, steepness)
    both = squared.view(np.float32)
    both[:WIDTH], both[WIDTH : 2 * WIDTH] = far, total
    return bits_of((far < r2) | ((far == r2) & (total < e2)))


@with_twin(_nearer8)
def nearer8(typingctx, x_address, y_address, z_address, p, n, steepness, r2, e2, squared):
    """Which of eight photons count as nearer than sqrt(r2) to a place with a normal, their heights over its plane
    counting more than what is along it; or as that far, but nearer in space than sqrt(e2).

    Parameters
    ----------
    x_address, y_address, z_address: int64 addresses of the float32 coordinates.
    p, n: float32 triples, the place and the unit normal there.
    steepness: float32 weight of the squared height.
    r2, e2: float32.
    squared: pointer to 16 float32 of scratch that receive the squared distances by which they count, and those in
        space.

    Returns
    -------
    int32 with bit j set when photon j is nearer.
    """
    f, i8, triple = types.float32, types.int64, types.UniTuple(types.float32, 3)
    signature = types.int32(i8, i8, i8, triple, triple, f, f, f, types.CPointer(types.int32))

    def codegen(context, builder, sig, args):
        *addresses, p, n, steepness, limit, tie, out = args
        far, total = counted_of(builder, addresses, p, n, steepness)
        place = builder.bitcast(out, VECTOR.as_pointer())
        builder.store(far, place).align = 4
        builder.store(total, builder.gep(place, [ir.Constant(I32, 1)])).align = 4
        limits = splat(builder, limit)
        equal = builder.fcmp_ordered("==", far, limits)
        equal = builder.and_(equal, builder.fcmp_ordered("<", total, splat(builder, tie)))
        mask = builder.or_(builder.fcmp_ordered("<", far, limits), equal)
        return builder.zext(builder.bitcast(mask, I8), I32)

    return signature, codegen


def placed_of(builder, block, p, n):
    """A normal, and where the eight photons of a block are from a point: three vectors each, in LLVM's builder."""
    normal = [splat(builder, x) for x in cgutils.unpack_tuple(builder, n, 3)]
    d = [
        builder.fsub(
            load_eight(builder, builder.add(block, ir.Constant(I64, ROW_BYTES * row))),
            splat(builder, coordinate),
            flags=FAST,
        )
        for row, coordinate in enumerate(cgutils.unpack_tuple(builder, p, 3))
    ]
    return normal, d


def _beside8(block, o, d, r2):
    offset = offsets(*(block + row * ROW_BYTES for row in range(3)), *o)
    t = sum(a * c for a, c in zip(offset, d))
    return bits_of(sum((a - t * c) ** 2 for a, c in zip(offset, d)) < r2)


@with_twin(_beside8)
def beside8(typingctx, block, o, d, r2):
    """Which photons of a grid's block lie closer than sqrt(r2) to a line.

    block: int64 address of the block; o, d: float32 triples, a point and the unit direction of the line; r2: float32.
    Returns int32 with bit j set for photon j.
    """
    triple = types.UniTuple(types.float32, 3)
    signature = types.int32(types.int64, triple, triple, types.float32)

    def codegen(context, builder, sig, args):
        block, o, d, limit = args
        direction, offset = placed_of(builder, block, o, d)
        t = dot_of(builder, offset, direction)
        across = [
            builder.fsub(a, builder.fmul(t, c, flags=FAST), flags=FAST) for a, c in zip(offset, direction, strict=True)
        ]
        mask = builder.fcmp_ordered("<", dot_of(builder, across, across), splat(builder, limit))
        return builder.zext(builder.bitcast(mask, I8), I32)

    return signature, codegen


@with_twin(lambda mask: np.int32((int(mask) & 0xFFFFFFFF).bit_count()))
def count_bits(typingctx, mask):
    """Number of set bits of an int32."""
    signature = types.int32(types.int32)

    def codegen(context, builder, sig, args):
        return builder.ctpop(args[0])

    return signature, codegen


def _add_power8(rg_words, b_words, mask, weights, sums):
    rg, b = at_address(rg_words, WIDTH, np.uint32), at_address(b_words, WIDTH, np.uint32)
    partial, weight = sums.view(np.float32).reshape(-1, WIDTH), weights.view(np.float32)
    for lane in range(WIDTH):
        if mask >> lane & 1:
            for channel, code in enumerate((rg[lane] & 0xFFFF, rg[lane] >> 16, b[lane] & 0xFFFF)):
                partial[channel, lane] += decode_power(code) * weight[lane]


@with_twin(_add_power8)
def add_power8(typingctx, rg_words, b_words, mask, weights, sums):
    """Adds the weighted powers of those of eight photons whose bit is set in `mask`.

    rg_words, b_words: int64 addresses of words 4 and of words 5 of the photon records.
    weights: pointer to 8 float32.
    sums: pointer to 3 × 8 float32: eight partial sums of red, green and blue, in units of the map's power.
    """
    pointer = types.CPointer(types.int32)
    signature = types.void(types.int64, types.int64, types.int32, pointer, pointer)

    def codegen(context, builder, sig, args):
        rg_words, b_words, mask, weights, sums = args
        chosen = builder.bitcast(builder.trunc(mask, I8), BITS)
        weight = builder.load(builder.bitcast(weights, VECTOR.as_pointer()))
        weight.align = 4
        weight = builder.select(chosen, weight, constant(VECTOR, 0.0))
        rg, b = load_eight(builder, rg_words, WORDS), load_eight(builder, b_words, WORDS)
        low = constant(WORDS, 0xFFFF)
        channels = builder.and_(rg, low), builder.lshr(rg, constant(WORDS, 16)), builder.and_(b, low)
        for channel, code in enumerate(channels):
            # record.decode_power
            bits = builder.add(builder.shl(code, constant(WORDS, 13)), constant(WORDS, EXPONENT_BASE))
            power = builder.bitcast(bits, VECTOR)
            zero = builder.icmp_unsigned("==", code, constant(WORDS, 0))
            power = builder.select(zero, constant(VECTOR, 0.0), power)
            place = builder.gep(builder.bitcast(sums, VECTOR.as_pointer()), [ir.Constant(I32, channel)])
            total = builder.load(place)
            total.align = 4
            total = builder.fadd(total, builder.fmul(power, weight, flags=FAST), flags=FAST)
            builder.store(total, place).align = 4
        return context.get_dummy_value()

    return signature, codegen
