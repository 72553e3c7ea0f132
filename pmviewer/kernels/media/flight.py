"""The flight of a path from where it is to what it meets: a surface, or a collision in a medium on the way.

One distance for all channels: the optical depth τ = −ln(1 − u) is drawn for a channel c, picked by its share wc of the
throughput, and all channels' densities count (one-sample multiple importance sampling; Veach 1997, §9.2): a collision
weighs σt T / Σ wc σc Tc, a surface T / Σ wc Tc. The sum of the throughput's channels stays what it was where nothing
absorbs. Media that absorb alone weaken without collisions.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.media.medium import MOST_BOUNDARIES, is_boundary, medium_beyond, scatters
from pmviewer.kernels.media.varying import cross
from pmviewer.kernels.surface import leave, surface_at
from pmviewer.kernels.vector import along, mul

_f4 = np.float32
_i8 = np.int64


class Flight(NamedTuple):
    """`collides`: does it end in the medium, at p? Else it meets `prim` (−1: nothing) at (u, v), at the distance t from
    o, the last boundary on its way. `medium`: where it ends; `length` of the whole way; `weight` of the throughput
    (red, green, blue), without the albedo of a collision; `rays` cast."""

    collides: Any
    p: Any
    prim: Any
    u: Any
    v: Any
    t: Any
    o: Any
    medium: Any
    length: Any
    weight: Any
    rays: Any


@device
def _channel(beta, u):
    """A channel by its share of the throughput, and all shares."""
    total = beta[0] + beta[1] + beta[2]
    third = _f4(1.0 / 3.0)
    shares = (third, third, third)
    if total > _f4(0.0) and total < _f4(np.inf):
        shares = (beta[0] / total, beta[1] / total, beta[2] / total)
    if u < shares[0]:
        return 0, shares
    if u < shares[0] + shares[1] or not shares[2] > _f4(0.0):
        return (1 if shares[1] > _f4(0.0) else 0), shares
    return 2, shares


@device
def _weighed(value, shares, densities):
    """value/Σ wc pc"""
    total = shares[0] * densities[0] + shares[1] * densities[1] + shares[2] * densities[2]
    if not total > _f4(0.0):
        return _f4(0.0), _f4(0.0), _f4(0.0)
    return value[0] / total, value[1] / total, value[2] / total


@device
def fly(scene, o, d, far, medium, beta, u_channel, u_depth):
    """The Flight of a path with throughput beta from o in direction d, up to the distance far."""
    channel, shares = _channel(beta, u_channel)
    tau = -_f4(math.log(_f4(1.0) - u_depth))
    one = _f4(1.0)
    T, density = (one, one, one), (one, one, one)
    travelled = _f4(0.0)
    rays = 0
    for _ in range(MOST_BOUNDARIES):
        t, found, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], _f4(0.0), far)
        prim = _i8(found)
        rays += 1
        scattering = scatters(scene, medium)
        part = cross(scene, medium, o, d, t, channel, tau)
        T, tau = mul(T, part.T), part.tau
        if scattering:
            density = mul(density, part.T)
        if part.collides:
            weight = _weighed(mul(T, part.sigma), shares, mul(density, part.sigma))
            return Flight(True, along(o, d, part.s), _i8(-1), u, v, part.s, o, medium, travelled + part.s, weight, rays)
        if prim < 0 or not is_boundary(scene, prim):
            weight = _weighed(T, shares, density)
            return Flight(False, o, prim, u, v, t, o, medium, travelled + t, weight, rays)
        p, ng, _, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        medium = medium_beyond(scene, prim, ng, d, medium)
        o = leave(p, ng, gap, d[0], d[1], d[2])
        travelled += t
        far -= t
    black = (_f4(0.0), _f4(0.0), _f4(0.0))
    return Flight(False, o, _i8(-1), _f4(0.0), _f4(0.0), far, o, medium, travelled, black, rays)
