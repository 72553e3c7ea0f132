"""The Beam (`pmviewer.maps.estimate.beam`) of a stretch of a ray: the discs in which photons around it are looked up,
by the surfaces at its ends, and how deep it goes in a dense medium."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.media.medium import way_seen
from pmviewer.kernels.surface import surface_at
from pmviewer.kernels.vector import dot
from pmviewer.maps.estimate.beam import Beam

_f4 = np.float32
_i8 = np.int64
_INF = _f4(np.inf)
LEAST_COSINE = _f4(0.3)
"""Between a ray and the normals of its discs: flatter ones would hold few photons, of large weight."""
ALONG = _f4(4.0)
"""Radii from an end up to which discs lie along its surface: upright ones reach it from 3.2 at that cosine."""
SURE, FALL = _f4(0.25), _f4(0.08)
"""Share of the depth that anything shows through which is always looked at, 6 free paths, and that in which the chance
to look at what lies behind falls to 1/e, 1.9 free paths: exp(−6) of the light is left there."""


@device
def beam_of(scene, o, d, length, radius):
    """The Beam from o in the unit direction d for look-ups of a radius: with discs along the surface that lies behind
    it, and along that at its end, if there are any."""
    first = _disc(scene, o, (-d[0], -d[1], -d[2]), d, _f4(0.0), radius)
    last = _disc(scene, o, d, d, max(length - radius, _f4(0.0)), length + radius)
    half, near = _f4(0.5) * length, ALONG * radius
    return Beam(o, d, length, first, last, min(near, half), max(length - near, half), _INF, _f4(0.0))


@device
def seen_beam_of(scene, medium, o, d, length, radius, u):
    """The same as deep as light comes from, by a random number u: a medium is dense where its free paths are few in the
    length, and most of what lies behind six would be looked up for nothing."""
    deepest = way_seen(scene, medium)
    if not deepest < _INF:
        return beam_of(scene, o, d, length, radius)
    sure, fall = SURE * deepest, FALL * deepest
    cut = min(sure - fall * _f4(math.log(max(u, _f4(1e-9)))), deepest)
    beam = beam_of(scene, o, d, min(length, cut), radius)
    return Beam(o, d, beam.length, beam.first, beam.last, beam.a, beam.b, sure, _f4(1.0) / fall)


@device
def _disc(scene, o, towards, d, near, far):
    """Unit normal of discs along the surface between these distances, tilted towards the ray's direction d where the
    surface is nearly along it; d itself where nothing is."""
    t, found, u, v = closest_hit(scene, o[0], o[1], o[2], towards[0], towards[1], towards[2], near, far)
    prim = _i8(found)
    if prim < 0:
        return d
    _, n, _, _ = surface_at(scene, prim, u, v, o[0], o[1], o[2], towards[0], towards[1], towards[2], t)
    c = dot(n, d)
    if c < _f4(0.0):
        n, c = (-n[0], -n[1], -n[2]), -c
    if c >= LEAST_COSINE:
        return n
    s = _f4(math.sqrt((_f4(1.0) - LEAST_COSINE * LEAST_COSINE) / (_f4(1.0) - c * c)))
    m = LEAST_COSINE - s * c
    return (m * d[0] + s * n[0], m * d[1] + s * n[1], m * d[2] + s * n[2])
