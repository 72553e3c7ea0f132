"""Powers of photons that share those of others: rows of four float64, red, green, blue and nothing, so that a row is
added to at once."""

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import types

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.memory import at_address, with_twin
from pmviewer.maps.photon_words import decode_powers

ROW = 4
"""float64 elements of a row."""
_ROW_BYTES = 8 * ROW
_f8 = np.float64
_i8 = np.int64
_F64 = ir.DoubleType()
_VECTOR = ir.VectorType(_F64, ROW)


def _add_share(address, row, red, green, blue):
    at_address(address + row * _ROW_BYTES, 3, np.float64)[:] += (red, green, blue)


@with_twin(_add_share)
def add_share(typingctx, address, row, red, green, blue):
    """Add float64 red, green and blue to a row of powers; address: int64, of the first row."""
    f = types.float64
    signature = types.void(types.int64, types.int64, f, f, f)

    def codegen(context, builder, sig, args):
        address, row, *channels = args
        at = builder.add(address, builder.mul(row, ir.Constant(row.type, _ROW_BYTES)))
        place = builder.inttoptr(at, _VECTOR.as_pointer())
        powers = builder.load(place)
        powers.align = 8
        share = ir.Constant(_VECTOR, [0.0] * ROW)
        for c, channel in enumerate(channels):
            share = builder.insert_element(share, channel, ir.Constant(ir.IntType(32), c))
        builder.store(builder.fadd(powers, share), place).align = 8
        return context.get_dummy_value()

    return signature, codegen


@device
def share_of(words, i, count):
    """Red, green and blue, float64, of one of `count` equal parts of photon i's power."""
    red, green, blue = decode_powers(words[i, 4], words[i, 5])
    share = _f8(1.0) / _f8(count)
    return _f8(red) * share, _f8(green) * share, _f8(blue) * share


@kernel
def hand_out(words, counts, neighbours, powers):
    """The power of each of photons (n, 6) uint32 `words`, in equal parts, to the first counts[j] of neighbours[j],
    (n, k) int32 numbers of rows of powers (m, ROW) float64; photons without any keep theirs."""
    sums = powers.ctypes.data
    for j in range(len(counts)):
        if counts[j] > 0:
            r, g, b = share_of(words, j, counts[j])
            for k in range(counts[j]):
                add_share(sums, _i8(neighbours[j, k]), r, g, b)
