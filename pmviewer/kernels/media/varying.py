"""Media whose numbers vary in space, by the lattices of `pmviewer.kernels.media.lattice`.

A medium's row holds factors, its lattices what they multiply: of extinction, albedo and emission, each −1 for none. In
scenes without lattices these functions are those of `pmviewer.kernels.media.medium`, and nothing else is compiled.
Where the lattice of extinction ends, the medium ends.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.media.lattice import G_CHANNELS, GRID_NUMBERS, line_of, size_of, value_at, walk
from pmviewer.kernels.media.medium import (
    depth_of,
    emission_of,
    extinction,
    scattering_albedo,
    scatters,
    transmittance,
)
from pmviewer.kernels.memory import load_i4
from pmviewer.kernels.vector import mul

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
OF_EXTINCTION, OF_ALBEDO, OF_EMISSION = np.arange(3, dtype=np.int64)
"""Which lattice of a medium."""
_WHITE = (_f4(1.0), _f4(1.0), _f4(1.0))


class Crossed(NamedTuple):
    """A stretch of a path in one medium: does it collide, after which length? `T` up to there or to the end, the
    extinction `sigma` there (a common factor is left out), and what is left of the optical depth `tau`."""

    collides: Any
    s: Any
    T: Any
    sigma: Any
    tau: Any


def has_grids(scene: Any) -> bool:
    """Whether the record of a scene, or its type, has media on lattices."""
    return has(scene, "voxels")


@device
def grid_of(scene, medium, which):
    """The lattice of a medium, −1 for none."""
    return _i8(load_i4(scene.medium_grids, medium * GRID_NUMBERS + which)) if medium >= 0 else _i8(-1)


@device
def thinned(sigma, depth, length):
    """Transmittance of extinction sigma times the integral `depth` over a ray's parameter, whose unit has that
    length."""
    return (
        _f4(math.exp(-_f8(sigma[0]) * depth[0] * length)),
        _f4(math.exp(-_f8(sigma[1]) * depth[1] * length)),
        _f4(math.exp(-_f8(sigma[2]) * depth[2] * length)),
    )


@specialised
def transmitted(scene, medium, o, d, t, length):
    """Share of light per channel that comes through the medium from o to o + t d, which is `length` long."""
    if not has_grids(scene):
        return lambda scene, medium, o, d, t, length: transmittance(scene, medium, length)

    def through(scene, medium, o, d, t, length):
        grid = grid_of(scene, medium, OF_EXTINCTION)
        if grid < 0:
            return transmittance(scene, medium, length)
        found = walk(scene, grid, line_of(scene, grid, o, d), 0.0, _f8(t), 0, np.inf)
        unit = math.sqrt(_f8(d[0]) * d[0] + _f8(d[1]) * d[1] + _f8(d[2]) * d[2])
        return thinned(extinction(scene, medium), found.depth, unit)

    return through


@device
def _varied(scene, medium, which, factor, p, ends):
    """The medium's factor times the value of a lattice of it at a point; `ends`: nothing outside of the lattice."""
    grid = grid_of(scene, medium, which)
    return factor if grid < 0 else mul(factor, value_at(scene, grid, p, ends))


@specialised
def sigma_at(scene, medium, p):
    """σt per channel at a point of the medium."""
    if not has_grids(scene):
        return lambda scene, medium, p: extinction(scene, medium)
    return lambda scene, medium, p: _varied(scene, medium, OF_EXTINCTION, extinction(scene, medium), p, True)


@specialised
def albedo_at(scene, medium, p):
    """σs/σt per channel at a point of the medium."""
    if not has_grids(scene):
        return lambda scene, medium, p: scattering_albedo(scene, medium)
    return lambda scene, medium, p: _varied(scene, medium, OF_ALBEDO, scattering_albedo(scene, medium), p, False)


@device
def emission_at(scene, medium, p):
    """Radiance that the medium emits per length at a point; in scenes with lattices."""
    return _varied(scene, medium, OF_EMISSION, emission_of(scene, medium), p, False)


@device
def _evenly(scene, medium, t, channel, tau):
    """`cross` of a medium that is the same everywhere."""
    if not scatters(scene, medium):
        return Crossed(False, t, transmittance(scene, medium, t), _WHITE, tau)
    sigma = extinction(scene, medium)
    if depth_of(sigma[channel], t) > tau:
        s = min(tau / sigma[channel], t)
        return Crossed(True, s, transmittance(scene, medium, s), sigma, tau)
    return Crossed(False, t, transmittance(scene, medium, t), sigma, tau - depth_of(sigma[channel], t))


@specialised
def cross(scene, medium, o, d, t, channel, tau):
    """The stretch of length t from o in the unit direction d until its optical depth in the channel is tau: Crossed."""
    if not has_grids(scene):
        return lambda scene, medium, o, d, t, channel, tau: _evenly(scene, medium, t, channel, tau)

    def through(scene, medium, o, d, t, channel, tau):
        grid = grid_of(scene, medium, OF_EXTINCTION)
        if grid < 0:
            return _evenly(scene, medium, t, channel, tau)
        sigma = extinction(scene, medium)
        wanted = _f8(np.inf)
        if scatters(scene, medium) and sigma[channel] > _f4(0.0):
            wanted = _f8(tau) / _f8(sigma[channel])
        line = line_of(scene, grid, o, d)
        found = walk(scene, grid, line, 0.0, _f8(t), channel, wanted)
        T = thinned(sigma, found.depth, 1.0)
        s = min(_f4(found.t), t)
        if found.stops:
            if size_of(scene, grid, G_CHANNELS) > 1:
                p = (o[0] + s * d[0], o[1] + s * d[1], o[2] + s * d[2])
                sigma = mul(sigma, value_at(scene, grid, p, False))
            return Crossed(True, s, T, sigma, tau)
        left = _f8(tau) - _f8(sigma[channel]) * found.depth[channel]
        return Crossed(False, t, T, sigma, _f4(max(left, 0.0)))

    return through
