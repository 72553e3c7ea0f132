"""Counter-based random streams (T2): a number depends on (seed, index, dimension) and on nothing else.

Two sequences: independent numbers by hashing, and Owen-scrambled Sobol points, four dimensions a set, the sets padded
by shuffling the index (Laine–Karras hashing as an Owen scramble).
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.sobol import SCRAMBLE, SOBOL_TABLE, UNIT, scrambled_point

INDEPENDENT, SOBOL = 0, 1

_u4 = np.uint32
_f4 = np.float32
_FACTORS = tuple(map(np.uint32, SCRAMBLE))
_UNIT = np.float32(UNIT)


@device
def hash3(a, b, c):
    """xxHash32 of three uint32."""
    h = _u4(_u4(_u4(a) * _u4(3266489917)) + _u4(374761393))
    h = _u4(_u4(_u4(h << _u4(17)) | _u4(h >> _u4(15))) * _u4(668265263))
    h = _u4(h + _u4(_u4(b) * _u4(3266489917)))
    h = _u4(_u4(_u4(h << _u4(17)) | _u4(h >> _u4(15))) * _u4(668265263))
    h = _u4(h + _u4(_u4(c) * _u4(3266489917)))
    h = _u4(_u4(_u4(h << _u4(17)) | _u4(h >> _u4(15))) * _u4(668265263))
    h = _u4(_u4(h ^ (h >> _u4(15))) * _u4(2246822519))
    h = _u4(_u4(h ^ (h >> _u4(13))) * _u4(3266489917))
    return _u4(h ^ (h >> _u4(16)))


@device
def unit_float(bits):
    """uint32 to a float32 in [0, 1)."""
    return _f4(_u4(bits) >> _u4(8)) * _UNIT


@device
def reverse_bits(x):
    """A uint32 with its bits in the opposite order."""
    x = _u4(_u4(x >> _u4(16)) | _u4(x << _u4(16)))
    x = _u4(_u4(_u4(x & _u4(0x00FF00FF)) << _u4(8)) | _u4(_u4(x & _u4(0xFF00FF00)) >> _u4(8)))
    x = _u4(_u4(_u4(x & _u4(0x0F0F0F0F)) << _u4(4)) | _u4(_u4(x & _u4(0xF0F0F0F0)) >> _u4(4)))
    x = _u4(_u4(_u4(x & _u4(0x33333333)) << _u4(2)) | _u4(_u4(x & _u4(0xCCCCCCCC)) >> _u4(2)))
    return _u4(_u4(_u4(x & _u4(0x55555555)) << _u4(1)) | _u4(_u4(x & _u4(0xAAAAAAAA)) >> _u4(1)))


@device
def owen_reversed(x, seed):
    """Owen scramble of bit-reversed x (Laine and Karras 2011, constants by Vegdahl); the result is bit-reversed too."""
    x = _u4(x + _u4(seed))
    x = _u4(x ^ _u4(x * _FACTORS[0]))
    x = _u4(x ^ _u4(x * _FACTORS[1]))
    x = _u4(x ^ _u4(x * _FACTORS[2]))
    return _u4(x ^ _u4(x * _FACTORS[3]))


@device
def owen(x, seed):
    """Nested uniform (Owen) scramble of a uint32."""
    return reverse_bits(owen_reversed(reverse_bits(_u4(x)), _u4(seed)))


@device
def _scrambled(reversed_bits, seed):
    return unit_float(reverse_bits(owen_reversed(reversed_bits, seed)))


@device
def draw4(sequence, seed, index, dimension_set):
    """Four numbers in [0, 1) for that (seed, index) and set of dimensions.

    Over `index`, a set is a scrambled Sobol point set or independent; different sets and seeds are independent.
    """
    key = hash3(seed, _u4(dimension_set), _u4(0x9E3779B9))
    if sequence == SOBOL:
        return scrambled_point(SOBOL_TABLE, owen_reversed(reverse_bits(_u4(index)), key), key)
    return (
        unit_float(hash3(key, _u4(index), _u4(0))),
        unit_float(hash3(key, _u4(index), _u4(1))),
        unit_float(hash3(key, _u4(index), _u4(2))),
        unit_float(hash3(key, _u4(index), _u4(3))),
    )


@device
def draw1(sequence, seed, index, dimension_set):
    """One number in [0, 1) for that (seed, index) and set: cheaper than `draw4` where one is enough."""
    key = hash3(seed, _u4(dimension_set), _u4(0x51ED270B))
    if sequence == SOBOL:
        return _scrambled(owen(_u4(index), key), _u4(key ^ _u4(0xA511E9B3)))
    return unit_float(hash3(key, _u4(index), _u4(0)))
