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
from pmviewer.maps.photon_words import SURELY, decode_direction, decode_normal, decode_power, is_apart
from pmviewer.maps.record import EXPONENT_BASE

WIDTH = 8
ROW_BYTES = 4 * WIDTH
BLOCK_BYTES = 6 * ROW_BYTES
"""A grid keeps eight photons in a block: the six words of their records in turn, eight to a row."""
FLAT = 1 / 2048
"""Of a disc's half-thickness: photons nearer to the plane are on a flat surface, whose sides `wi` tells apart."""
VECTOR = ir.VectorType(F32, WIDTH)
_WORDS = ir.VectorType(I32, WIDTH)
_BITS = ir.VectorType(ir.IntType(1), WIDTH)
FAST = ("contract", "reassoc", "nsz")


def _constant(vector, value):
    return ir.Constant(vector, [value] * WIDTH)


def splat(builder, scalar, vector=VECTOR):
    """Eight times the same number, in LLVM's builder."""
    undefined = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(undefined, scalar, ir.Constant(I32, 0))
    return builder.shuffle_vector(first, undefined, _constant(_WORDS, 0))


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
        direction = [splat(builder, x) for x in cgutils.unpack_tuple(builder, d, 3)]
        offset = [
            builder.fsub(
                load_eight(builder, builder.add(block, ir.Constant(I64, ROW_BYTES * row))),
                splat(builder, coordinate),
                flags=FAST,
            )
            for row, coordinate in enumerate(cgutils.unpack_tuple(builder, o, 3))
        ]
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


def _coordinates(builder, word, bits):
    """The lowest `bits` bits of either coordinate of eight codes of directions as float32, in LLVM's builder."""
    mask = _constant(_WORDS, (1 << bits) - 1)
    for shift in (20, 8):
        yield builder.sitofp(builder.and_(builder.lshr(word, _constant(_WORDS, shift)), mask), VECTOR)


def _unfolded(builder, u, v, size):
    """Vectors of eight places on the octahedron's square, from −size to size, of any length, in LLVM's builder."""
    z = builder.fsub(_constant(VECTOR, size), intrinsic(builder, "fabs", u))
    z = builder.fsub(z, intrinsic(builder, "fabs", v))
    fold = intrinsic(builder, "maxnum", builder.fneg(z), _constant(VECTOR, 0.0))
    x = builder.fsub(u, intrinsic(builder, "copysign", fold, u))
    y = builder.fsub(v, intrinsic(builder, "copysign", fold, v))
    return x, y, z


def _placed(builder, block, p, n):
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


def _front(builder, word, normal):
    """Which of eight photons arrive from the side of a normal, as `decode_direction` has it: only the sign matters."""
    half = _constant(VECTOR, 2047.0)
    u, v = (builder.fsub(x, half) for x in _coordinates(builder, word, 12))
    w = _unfolded(builder, u, v, 2047.0)
    return builder.fcmp_ordered(">", dot_of(builder, w, normal), _constant(VECTOR, 0.0))


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
        word = load_eight(builder, builder.add(block, ir.Constant(I64, 3 * ROW_BYTES)), _WORDS)
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
        normal, d = _placed(builder, block, p, n)
        above = intrinsic(builder, "fabs", dot_of(builder, d, normal))
        most = splat(builder, height)
        inside = builder.fcmp_ordered("<=", above, most)
        off = builder.fcmp_ordered(">", above, builder.fmul(most, _constant(VECTOR, FLAT), flags=FAST))
        word = load_eight(builder, builder.add(block, ir.Constant(I64, 3 * ROW_BYTES)), _WORDS)
        path_class = builder.and_(builder.lshr(word, _constant(_WORDS, 6)), _constant(_WORDS, 3))
        wanted = builder.trunc(builder.lshr(splat(builder, class_mask, _WORDS), path_class), _BITS)
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
    """Which photons of a grid's block `pmviewer.maps.photon_words.is_apart` finds apart from a place.

    block: int64 address of the block; p, n: float32 triples, point and normal. Returns int32 with bit j set for
    photon j.
    """
    triple = types.UniTuple(types.float32, 3)
    signature = types.int32(types.int64, triple, triple)

    def codegen(context, builder, sig, args):
        block, p, n = args
        normal, d = _placed(builder, block, p, n)
        word = load_eight(builder, builder.add(block, ir.Constant(I64, 3 * ROW_BYTES)), _WORDS)
        two, seven, zero = (_constant(VECTOR, x) for x in (2.0, 7.0, 0.0))
        u, v = (
            builder.fsub(builder.fmul(x, two, flags=FAST), seven, flags=FAST) for x in _coordinates(builder, word, 3)
        )
        m = _unfolded(builder, u, v, 8.0)
        least = builder.fmul(dot_of(builder, m, m), _constant(VECTOR, SURELY), flags=FAST)
        cosine, along = (intrinsic(builder, "minnum", dot_of(builder, m, other), zero) for other in (normal, d))
        away = builder.fcmp_ordered(">", builder.fmul(cosine, cosine, flags=FAST), least)
        far = builder.fmul(least, dot_of(builder, d, d), flags=FAST)
        before = builder.fcmp_ordered(">", builder.fmul(along, along, flags=FAST), far)
        below = builder.fcmp_ordered("<", dot_of(builder, d, normal), zero)
        mask = builder.or_(away, builder.and_(before, below))
        return builder.zext(builder.bitcast(mask, I8), I32)

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
        chosen = builder.bitcast(builder.trunc(mask, I8), _BITS)
        weight = builder.load(builder.bitcast(weights, VECTOR.as_pointer()))
        weight.align = 4
        weight = builder.select(chosen, weight, _constant(VECTOR, 0.0))
        rg, b = load_eight(builder, rg_words, _WORDS), load_eight(builder, b_words, _WORDS)
        low = _constant(_WORDS, 0xFFFF)
        channels = builder.and_(rg, low), builder.lshr(rg, _constant(_WORDS, 16)), builder.and_(b, low)
        for channel, code in enumerate(channels):
            # record.decode_power
            bits = builder.add(builder.shl(code, _constant(_WORDS, 13)), _constant(_WORDS, EXPONENT_BASE))
            power = builder.bitcast(bits, VECTOR)
            zero = builder.icmp_unsigned("==", code, _constant(_WORDS, 0))
            power = builder.select(zero, _constant(VECTOR, 0.0), power)
            place = builder.gep(builder.bitcast(sums, VECTOR.as_pointer()), [ir.Constant(I32, channel)])
            total = builder.load(place)
            total.align = 4
            total = builder.fadd(total, builder.fmul(power, weight, flags=FAST), flags=FAST)
            builder.store(total, place).align = 4
        return context.get_dummy_value()

    return signature, codegen
