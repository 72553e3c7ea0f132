"""One virtual light and one point: what the light sends there, before anybody asks whether it arrives."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.albedo import stored_albedo
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_at, bsdf_f
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.media.medium import has_media, phase_numbers
from pmviewer.kernels.media.phase import phase
from pmviewer.kernels.memory import load_f4, load_i4
from pmviewer.kernels.scene import load3, material_of
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import add, dot, luminance, mul, scale, sub
from pmviewer.maps.virtual_lights import (
    BEAM,
    COLUMNS,
    FULL,
    MODIFIED,
    V_BEAMS,
    V_BLOCKED,
    V_F,
    V_FIRST,
    V_GAP,
    V_LAMBERTIAN,
    V_N,
    V_NS,
    V_P,
    V_PHI,
    V_PRIM,
    V_Q,
    V_U,
    V_V,
    V_WI,
)

_f4 = np.float32
_i8 = np.int64
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))
LEAST_ALBEDO = _f4(1e-4)


@device
def towards(virtual, j, p):
    """Virtual light j as seen from p: its first column, its point, normal on its lit side, gap, unit direction there
    and squared distance (0 where p is the light itself)."""
    row = j * COLUMNS
    y = load3(virtual.lights, row + V_P)
    ng = face(load3(virtual.lights, row + V_N), load3(virtual.lights, row + V_WI))
    offset = sub(y, p)
    distance2 = dot(offset, offset)
    if not distance2 > _f4(0.0):
        return row, y, ng, _f4(0.0), ng, _f4(0.0)
    wi = scale(offset, _f4(1.0) / _f4(math.sqrt(distance2)))
    return row, y, ng, load_f4(virtual.lights, row + V_GAP), wi, distance2


@device
def bsdf_of(scene, virtual, row, glossy):
    """The BSDF at the light, as the photon found it, and the photon's direction."""
    prim = load_i4(virtual.lights, row + V_PRIM)
    u, v = load_f4(virtual.lights, row + V_U), load_f4(virtual.lights, row + V_V)
    y, wi = load3(virtual.lights, row + V_P), load3(virtual.lights, row + V_WI)
    ng, ns = load3(virtual.lights, row + V_N), load3(virtual.lights, row + V_NS)
    return bsdf_at(scene, prim, material_of(scene, prim), u, v, y, ng, ns, wi, glossy, None), wi


@specialised
def facing_of(scene, virtual, row, ny, wi):
    """Cosine at the light, whose normal on its lit side is ny, of the direction −wi; 1 where it has no surface."""
    if not has_media(scene):
        return lambda scene, virtual, row, ny, wi: -dot(ny, wi)

    def perhaps_in_media(scene, virtual, row, ny, wi):
        return _f4(1.0) if load_i4(virtual.lights, row + V_PRIM) < 0 else -dot(ny, wi)

    return perhaps_in_media


@specialised
def sent(scene, virtual, row, glossy, wo):
    """`scattered` by a light of any kind: by a collision in a medium with its phase function."""
    if not has_media(scene):
        return lambda scene, virtual, row, glossy, wo: scattered(scene, virtual, row, glossy, wo)

    def perhaps_in_media(scene, virtual, row, glossy, wo):
        if load_i4(virtual.lights, row + V_PRIM) < 0:
            wi = load3(virtual.lights, row + V_WI)
            medium = _i8(load_f4(virtual.lights, row + V_U))
            p = phase(phase_numbers(scene, medium), (-wi[0], -wi[1], -wi[2]), wo)
            return scale(load3(virtual.lights, row + V_PHI), p), (p, p, p), _f4(0.0)
        return scattered(scene, virtual, row, glossy, wo)

    return perhaps_in_media


@specialised
def scattered(scene, virtual, row, glossy, wo):
    """What the light sends towards wo, which is on its lit side: f_y·Φ, f_y, each red, green, blue, and its albedo seen
    from there; these two are nothing where its weight does not ask for them."""
    if not has(scene, "bsdfs"):

        def plain(scene, virtual, row, glossy, wo):
            return _evenly(virtual, row)

        return plain

    def any_bsdf(scene, virtual, row, glossy, wo):
        if load_f4(virtual.lights, row + V_LAMBERTIAN) != _f4(0.0):
            return _evenly(virtual, row)
        b, wi = bsdf_of(scene, virtual, row, glossy)
        beams = _i8(load_f4(virtual.lights, row + V_BEAMS))
        if beams > 0:
            return _by_beams(virtual, row, beams, b, wo), _BLACK, _f4(0.0)
        f = bsdf_f(b, STORED, wi, wo)
        return mul(f, load3(virtual.lights, row + V_PHI)), f, albedo_seen(scene, virtual, row, b, wo)

    return any_bsdf


@device
def _evenly(virtual, row):
    f = load3(virtual.lights, row + V_F)
    return mul(f, load3(virtual.lights, row + V_PHI)), f, _f4(math.pi) * luminance(f)


@device
def _by_beams(virtual, row, beams, b, wo):
    """What the light sends of the photons that it stands for (`pmviewer.photons.virtual.beams`)."""
    at = row // COLUMNS * virtual.each * BEAM
    total = _BLACK
    for _ in range(beams):
        f = bsdf_f(b, STORED, load3(virtual.beams, at), wo)
        total = add(total, mul(f, load3(virtual.beams, at + 3)))
        at += BEAM
    return total


@specialised
def albedo_seen(scene, virtual, row, b, wo):
    """The albedo, where the light's weight asks for it: it is a sum over samples."""
    if not has(virtual, "paths"):
        return lambda scene, virtual, row, b, wo: _f4(0.0)

    def of_path(scene, virtual, row, b, wo):
        first, blocked = load_f4(virtual.lights, row + V_FIRST), load_f4(virtual.lights, row + V_BLOCKED)
        stops = virtual.estimator == FULL or virtual.estimator == MODIFIED
        if (stops and first != _f4(0.0)) or blocked != _f4(0.0):
            return stored_albedo(scene, b, wo)
        return _f4(0.0)

    return of_path


@specialised
def weight_of(virtual, row, f, albedo):
    """q of a light that scatters f towards the point, where its albedo is `albedo`."""
    if not has(virtual, "paths"):
        return lambda virtual, row, f, albedo: load_f4(virtual.lights, row + V_Q)

    def of_path(virtual, row, f, albedo):
        q = load_f4(virtual.lights, row + V_Q)
        stops = virtual.estimator == FULL or virtual.estimator == MODIFIED
        if load_f4(virtual.lights, row + V_FIRST) != _f4(0.0):
            return q * max(_f4(1.0) - albedo, _f4(0.0)) if stops else q
        q *= luminance(f)
        if load_f4(virtual.lights, row + V_BLOCKED) != _f4(0.0):
            q /= max(albedo, LEAST_ALBEDO)
        return q

    return of_path
