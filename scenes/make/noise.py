"""Fractal heights: gradient noise over octaves from an integer hash, the same on every machine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

F8 = NDArray[np.float64]


def _hash(i: NDArray[np.int64], j: NDArray[np.int64], salt: int) -> NDArray[np.uint32]:
    """Well-mixed 32 bits of a lattice point."""
    h = i.astype(np.uint32) * np.uint32(0x9E3779B1) ^ j.astype(np.uint32) * np.uint32(0x85EBCA77)
    h ^= np.uint32(salt * 0xC2B2AE3D & 0xFFFFFFFF)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        h = (h ^ h >> np.uint32(shift)) * np.uint32(factor)
    return h ^ h >> np.uint32(16)


def gradient_noise(x: F8, y: F8, salt: int) -> F8:
    """Perlin's noise with eight gradients, twice differentiable, about −0.7 … 0.7."""
    x0, y0 = np.floor(x), np.floor(y)
    fx, fy = x - x0, y - y0
    i, j = x0.astype(np.int64), y0.astype(np.int64)

    def corner(di: int, dj: int) -> F8:
        h = _hash(i + di, j + dj, salt)
        a, b = fx - di, fy - dj
        diagonal = 0.5**0.5
        gx = np.select([h & 7 == k for k in range(8)], [1, diagonal, 0, -diagonal, -1, -diagonal, 0, diagonal])
        gy = np.select([h & 7 == k for k in range(8)], [0, diagonal, 1, diagonal, 0, -diagonal, -1, -diagonal])
        return gx * a + gy * b

    u, v = (f * f * f * (f * (f * 6 - 15) + 10) for f in (fx, fy))
    low = corner(0, 0) * (1 - u) + corner(1, 0) * u
    high = corner(0, 1) * (1 - u) + corner(1, 1) * u
    return low * (1 - v) + high * v


def fractal(x: F8, y: F8, frequency: float, octaves: int, roughness: float, salt: int = 1) -> F8:
    """Sum of octaves, each of twice the frequency and `roughness` times the height of the last."""
    height = np.zeros(np.broadcast(x, y).shape)
    amplitude = 1.0
    for octave in range(octaves):
        height += amplitude * gradient_noise(x * frequency, y * frequency, salt + octave)
        frequency *= 2
        amplitude *= roughness
    return height
