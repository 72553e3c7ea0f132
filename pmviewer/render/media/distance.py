"""Where on a ray through a medium light is looked for: distances by the transmittance and around a light."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import is_a, specialised
from pmviewer.kernels.media.column import Column, stopped_by, through, where_depth
from pmviewer.kernels.media.medium import extinction
from pmviewer.kernels.media.varying import sigma_at
from pmviewer.kernels.vector import along, dot, sub

_f4 = np.float32
_f8 = np.float64
_THIRD = 1.0 / 3.0
_LEAST_APART = 1e-3
"""Least distance of a light from the ray, relative to that of its foot: nearer ones would be sampled in one point."""


@device
def _share(sigma, length):
    """1 − exp(−σ s), the share of light that a length of the medium stops."""
    depth = _f8(sigma) * _f8(length)
    return -math.expm1(-depth) if depth > 0.0 else 0.0


@device
def _density(sigma, length, t):
    """Of a distance by the transmittance of one channel, up to the length."""
    share = _share(sigma, length)
    if share > 0.0:
        return _f8(sigma) * math.exp(-_f8(sigma) * t) / share
    return 1.0 / _f8(length)


@device
def transmittance_distance(sigma, length, u):
    """A distance in 0 … length with the density `transmittance_pdf`: one channel's transmittance, each as often. In a
    channel that stops nothing all distances are alike."""
    channel = min(int(_f8(u) * 3.0), 2)
    u = _f8(u) * 3.0 - channel
    share = _share(sigma[channel], length)
    if share > 0.0:
        return min(_f4(-math.log1p(-u * share) / _f8(sigma[channel])), length)
    return _f4(u) * length


@device
def transmittance_pdf(sigma, length, t):
    """Density of `transmittance_distance` per length."""
    s = _f8(t)
    total = _density(sigma[0], length, s) + _density(sigma[1], length, s) + _density(sigma[2], length, s)
    return _f4(_THIRD * total)


@device
def _angles(o, d, length, pivot):
    """Of a point beside the ray: the distance of its foot, its own distance from the ray, and the angles under which it
    sees the ray's ends from the foot."""
    offset = sub(pivot, o)
    foot = dot(offset, d)
    apart = sub(pivot, along(o, d, foot))
    D = math.sqrt(_f8(dot(apart, apart)))
    D = max(D, _LEAST_APART * math.sqrt(_f8(dot(offset, offset))), 1e-30)
    return _f8(foot), D, math.atan2(-_f8(foot), D), math.atan2(_f8(length) - _f8(foot), D)


@device
def equiangular_distance(o, d, length, pivot, u):
    """A distance in 0 … length with the density `equiangular_pdf` (Kulla and Fajardo 2012): even in the angle seen from
    the pivot."""
    foot, D, a, b = _angles(o, d, length, pivot)
    t = foot + D * math.tan(a + (b - a) * _f8(u))
    return min(max(_f4(t), _f4(0.0)), length)


@device
def equiangular_pdf(o, d, length, pivot, t):
    """Density of `equiangular_distance` per length."""
    foot, D, a, b = _angles(o, d, length, pivot)
    if not b > a:
        return _f4(0.0)
    s = _f8(t) - foot
    return _f4(D / ((b - a) * (D * D + s * s)))


@specialised
def distance_in(scene, medium, column, length, u):
    """A distance in the column, its channels' transmittance each as often, with the density `distance_pdf`."""
    if not is_a(column, Column):
        return lambda scene, medium, column, length, u: transmittance_distance(extinction(scene, medium), length, u)

    def of_lattice(scene, medium, column, length, u):
        if column.grid < 0:
            return transmittance_distance(column.sigma, length, u)
        channel = min(int(_f8(u) * 3.0), 2)
        u = _f8(u) * 3.0 - channel
        share = stopped_by(column, channel)
        if not share > 0.0:
            return _f4(u) * length
        depth = -math.log1p(-u * share) / _f8(column.sigma[channel])
        return min(_f4(where_depth(scene, column, channel, depth)), length)

    return of_lattice


@specialised
def distance_pdf(scene, medium, column, o, d, length, t):
    """Density of `distance_in` per length."""
    if not is_a(column, Column):
        return lambda scene, medium, column, o, d, length, t: transmittance_pdf(extinction(scene, medium), length, t)

    def of_lattice(scene, medium, column, o, d, length, t):
        if column.grid < 0:
            return transmittance_pdf(column.sigma, length, t)
        sigma, T = sigma_at(scene, medium, along(o, d, t)), through(scene, column, t)
        total = 0.0
        for c in range(3):
            share = stopped_by(column, c)
            total += _f8(sigma[c]) * _f8(T[c]) / share if share > 0.0 else 1.0 / _f8(length)
        return _f4(total / 3.0)

    return of_lattice
