"""Powers that vary widely as the 16-bit codes of a map (see `pmviewer.maps.record`).

Rounding to nearest would move the sum of many equal powers by up to 2⁻¹¹. Here a power is rounded up or down at random,
so that every sum is right in the mean, and that of many photons nearly exactly.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import BLUE_SALT, ROUNDING_SALT
from pmviewer.kernels.memory import bits_of_float
from pmviewer.kernels.random import hash3
from pmviewer.maps.photon_words import decode_powers
from pmviewer.maps.record import EXPONENT_BASE

LARGEST = 2.0**16
"""The largest power that is encoded; codes end a factor of 2 above."""

_EXPONENT_BASE = np.uint32(EXPONENT_BASE)
_f4 = np.float32
_f8 = np.float64
_u4 = np.uint32


@device
def round_power(x, noise):
    """Non-negative float32 in units of the map's power → 16-bit code; the low 13 bits of `noise` round up or down."""
    bits = _u4(bits_of_float(_f4(x)))
    if bits < _u4(_EXPONENT_BASE + _u4(0x2000)):
        return _u4(0)
    return min(_u4(_u4(bits + _u4(noise & _u4(0x1FFF)) - _EXPONENT_BASE) >> _u4(13)), _u4(0xFFFF))


@device
def write_power(words, row, red, green, blue, noise):
    """Replace the power of photon `row` of words (n, 6) uint32; its light stays. `noise` is a random uint32."""
    more = hash3(noise, _u4(BLUE_SALT), _u4(row))
    r, g = round_power(red, noise), round_power(green, _u4(noise >> _u4(16)))
    words[row, 4] = _u4(r | _u4(g << _u4(16)))
    words[row, 5] = _u4(round_power(blue, more) | _u4(words[row, 5] & _u4(0xFFFF0000)))


@kernel
def _write(words, powers, scale, seed):
    for i in range(len(words)):
        red, green, blue = _f4(powers[i, 0] * scale), _f4(powers[i, 1] * scale), _f4(powers[i, 2] * scale)
        write_power(words, i, red, green, blue, hash3(seed, _u4(i), _u4(ROUNDING_SALT)))


@kernel
def luminances(words, out):
    """Luminance of the power of photons (n, 6), seen as uint32, in units of the map's, into out (n,) float32."""
    for i in range(len(words)):
        red, green, blue = decode_powers(words[i, 4], words[i, 5])
        out[i] = _f4(0.2126) * red + _f4(0.7152) * green + _f4(0.0722) * blue


def encode_powers(photons: NDArray[np.float32], powers: NDArray[np.float64], seed: int) -> float:
    """Write powers (n, 3), in units of the map's, into the photons (n, 6).

    Returns the factor by which the unit grows so that the largest power has a code: a power of two, 1 nearly always.
    """
    largest = float(powers.max()) if len(powers) else 0.0
    factor = 2.0 ** max(0, math.ceil(math.log2(largest / LARGEST))) if largest > LARGEST else 1.0
    _write(photons.view(np.uint32), powers, 1.0 / factor, np.uint32(seed & 0xFFFFFFFF))
    return factor
