"""Four coordinates of an Owen-scrambled Sobol point at once, a lane each.

Bits stay reversed until the end, since both the xor of direction numbers and the scramble of Laine and Karras (2011,
constants by Vegdahl) are as easy there: one vector of four comes from the table for each byte of the index.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils

from pmviewer.kernels.memory import F32, I32, with_twin

DIMENSIONS = 4
SCRAMBLE = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)
"""Even factors of the hash: a bit is changed by those that come before it in the reversed number alone."""
SEED_FACTORS = (1, 0x9E3779B1, 0x85EBCA77, 0x27D4EB2F)
SEED_BITS = (0xA511E9B3, 0x63D83595, 0xC2B2AE3D, 0x165667B1)
"""What makes seeds of the four coordinates from one key."""
UNIT = 5.9604645e-08  # 2⁻²⁴

V4I = ir.VectorType(I32, DIMENSIONS)
V4F = ir.VectorType(F32, DIMENSIONS)


def _direction_numbers() -> np.ndarray:
    """(4, 32) uint32 direction numbers of the first four Sobol dimensions (Joe and Kuo 2008)."""
    numbers = np.zeros((DIMENSIONS, 32), np.uint64)
    numbers[0] = [1 << (31 - k) for k in range(32)]
    for dimension, (a, m) in enumerate([(0, [1]), (1, [1, 3]), (1, [1, 3, 1])], start=1):
        s = len(m)
        v = [m[k] << (31 - k) for k in range(s)]
        for k in range(s, 32):
            value = v[k - s] ^ (v[k - s] >> s)
            for j in range(1, s):
                if (a >> (s - 1 - j)) & 1:
                    value ^= v[k - j]
            v.append(value)
        numbers[dimension] = v
    return numbers.astype(np.uint32)


def reversed_bits(bits: np.ndarray) -> np.ndarray:
    """The numbers of a uint32 array with their bits in the opposite order."""
    as_bytes = np.ascontiguousarray(bits).astype(">u4").view(np.uint8).reshape(-1, 4)
    turned = np.packbits(np.unpackbits(as_bytes, axis=1)[:, ::-1], axis=1)
    return turned.view(">u4").reshape(bits.shape).astype(np.uint32)


def _table() -> np.ndarray:
    """(4 bytes · 256 · 4 dimensions,) uint32: the bit-reversed point of a bit-reversed index is the xor of one row for
    each of the index's bytes, the lowest first."""
    numbers = _direction_numbers()
    table = np.zeros((4, 256, DIMENSIONS), np.uint32)
    for byte in range(4):
        for value in range(256):
            for bit in range(8):
                if value >> bit & 1:
                    table[byte, value] ^= numbers[:, 31 - (8 * byte + bit)]
    return reversed_bits(table).reshape(-1)


SOBOL_TABLE = _table()


def bit_reversed_points(index: np.ndarray) -> np.ndarray:
    """Bit-reversed coordinates (n, 4) uint32 of the Sobol points with these bit-reversed indices (n,)."""
    rows = SOBOL_TABLE.reshape(4, 256, DIMENSIONS)
    return np.bitwise_xor.reduce([rows[byte, index >> np.uint32(8 * byte) & 255] for byte in range(4)])


def _scrambled_point(table, index, key):
    with np.errstate(over="ignore"):
        seeds = np.uint32(key) * np.array(SEED_FACTORS, np.uint32) ^ np.array(SEED_BITS, np.uint32)
        x = bit_reversed_points(np.array([index], np.uint32))[0] + seeds
        for factor in SCRAMBLE:
            x = x ^ x * np.uint32(factor)
    return tuple((reversed_bits(x) >> np.uint32(8)).astype(np.float32) * np.float32(UNIT))


@with_twin(_scrambled_point)
def scrambled_point(typingctx, table, index, key):
    """Four float32 in [0, 1): the point of that bit-reversed uint32 index, each coordinate scrambled by the uint32
    key. `table` is SOBOL_TABLE."""
    signature = types.UniTuple(types.float32, DIMENSIONS)(table, types.uint32, types.uint32)

    def numbers(values):
        return ir.Constant(V4I, list(values))

    def splat(builder, scalar):
        vector = builder.insert_element(ir.Constant(V4I, ir.Undefined), scalar, ir.Constant(I32, 0))
        return builder.shuffle_vector(vector, ir.Constant(V4I, ir.Undefined), numbers([0] * DIMENSIONS))

    def codegen(context, builder, sig, args):
        index, key = args[1], splat(builder, args[2])
        data = builder.bitcast(context.make_array(sig.args[0])(context, builder, args[0]).data, V4I.as_pointer())
        x = None
        for byte in range(4):
            value = builder.and_(builder.lshr(index, ir.Constant(I32, 8 * byte)), ir.Constant(I32, 255))
            row = builder.load(builder.gep(data, [builder.add(value, ir.Constant(I32, 256 * byte))]))
            row.align = 4
            x = row if x is None else builder.xor(x, row)
        x = builder.add(x, builder.xor(builder.mul(key, numbers(SEED_FACTORS)), numbers(SEED_BITS)))
        for factor in SCRAMBLE:
            x = builder.xor(x, builder.mul(x, numbers([factor] * DIMENSIONS)))
        reverse = cgutils.get_or_insert_function(builder.module, ir.FunctionType(V4I, [V4I]), "llvm.bitreverse.v4i32")
        x = builder.lshr(builder.call(reverse, [x]), numbers([8] * DIMENSIONS))
        unit = builder.fmul(builder.sitofp(x, V4F), ir.Constant(V4F, [UNIT] * DIMENSIONS))
        lanes = [builder.extract_element(unit, ir.Constant(I32, lane)) for lane in range(DIMENSIONS)]
        return cgutils.pack_array(builder, lanes)

    return signature, codegen
