"""Gradient noise over points of space (Perlin, "Improving noise", 2002, with a hash in place of the table)."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel

_u8 = np.uint64
_MIXED = _u8(0x9E3779B97F4A7C15)
_SEED = _u8(0xD1B54A32D192ED03)
_FIRST, _SECOND = _u8(0xBF58476D1CE4E5B9), _u8(0x94D049BB133111EB)
_LOW = _u8(0xFFFFFFFF)


@device
def _hash(x, y, z, seed):
    """Well-mixed bits of three integers (the finaliser of SplitMix; Steele, Lea and Flood 2014)."""
    h = (_u8(x) * _MIXED + _u8(y)) * _MIXED + _u8(z) + _u8(seed) * _SEED
    h = (h ^ (h >> _u8(30))) * _FIRST
    h = (h ^ (h >> _u8(27))) * _SECOND
    return h ^ (h >> _u8(31))


@device
def _fade(t):
    return t * t * t * (t * (t * 6.0 - 15.0) + 10.0)


@kernel
def add_noise(places, cells, seed, factor, total):
    """Add `factor` times noise with `cells` lattice cells along the unit cube, beyond which it repeats, to total (n,)
    at places (n, 3); the noise lies in about [-1, 1]."""
    for i in range(len(places)):
        px, py, pz = places[i, 0] * cells, places[i, 1] * cells, places[i, 2] * cells
        x0, y0, z0 = math.floor(px), math.floor(py), math.floor(pz)
        fx, fy, fz = px - x0, py - y0, pz - z0
        ux, uy, uz = _fade(fx), _fade(fy), _fade(fz)
        x_low, y_low, z_low = int(x0) % cells, int(y0) % cells, int(z0) % cells
        x_high, y_high, z_high = (x_low + 1) % cells, (y_low + 1) % cells, (z_low + 1) % cells
        noise = 0.0
        for corner in range(8):
            dx, dy, dz = corner >> 2 & 1, corner >> 1 & 1, corner & 1
            h = _hash(x_high if dx else x_low, y_high if dy else y_low, z_high if dz else z_low, seed)
            # A gradient of unit length: height and longitude from the two halves of the bits.
            up = np.float64(h >> _u8(32)) * 2.0**-31 - 1.0
            angle = np.float64(h & _LOW) * (2.0 * math.pi * 2.0**-32)
            side = math.sqrt(1.0 - up * up)
            gx, gy, gz = fx - dx, fy - dy, fz - dz
            slope = side * math.cos(angle) * gx + side * math.sin(angle) * gy + up * gz
            weight = (ux if dx else 1.0 - ux) * (uy if dy else 1.0 - uy) * (uz if dz else 1.0 - uz)
            noise += slope * weight
        total[i] += factor * 1.5 * noise
