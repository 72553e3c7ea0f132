"""Glass whose index depends on the wavelength (T10): what a path knows of its own, and what glass makes of it.

A path draws one number u in [0, 1) where it starts, which stands for a wavelength; it begins to count where the path
first depends on it. There the path takes the colour of that wavelength (`pmviewer.scene.spectrum`), and is
`split`: from then on all glass bends it by that wavelength's index. What is seen without dispersion has no noise of
colours. Where light from outside meets smooth glass, the middle index decides between reflection and refraction, so
that reflections stay white: their share is that of each channel's mean index, which is exact to the second order of
the index's change. Refraction is exact.

Colours are never negative, and their mean over u is white (1, 1, 1).

Paths carry None where the scene has no dispersive glass, or where colours don't matter (views, importons, light through
panes): they go by the middle index, `Material.eta`. Records without the field `glasses` compile none of this.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from pmviewer.kernels.bsdf.kinds import BANDS, SPECTRUM_COLUMNS, SPECTRUM_NODES
from pmviewer.kernels.bsdf.specular import fresnel_dielectric
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, specialised
from pmviewer.kernels.memory import load_f4
from pmviewer.kernels.random import draw1
from pmviewer.kernels.scene import M_GLASS, MATERIAL_COLUMNS
from pmviewer.kernels.vector import dot, mul, scale

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32


class Wave(NamedTuple):
    """A path's wavelength: its place u in the spectrum, and whether the path has its colour yet (int32, `split`)."""

    u: Any
    split: Any


class Glass(NamedTuple):
    """What a BSDF of dispersive glass knows: the row of its indices (0 if it is none), its middle index eta, and
    whether a path gets its colour by refraction alone (int32, `lazy`)."""

    row: Any
    eta: Any
    lazy: Any


def has_dispersion(scene: Any) -> bool:
    """Does a scene's record, or its type, have dispersive glass?"""
    return has(scene, "glasses")


@specialised
def new_wave(scene, sequence, seed, index, dimension):
    """A path's Wave, None in scenes without dispersion."""
    if not has_dispersion(scene):
        return lambda scene, sequence, seed, index, dimension: None
    return lambda scene, sequence, seed, index, dimension: Wave(draw1(sequence, seed, index, dimension), _i4(0))


@specialised
def renewed(wave, sequence, seed, index, dimension):
    """The wave of one of several paths that go on from one: another one, unless the path is split."""
    if absent(wave):
        return lambda wave, sequence, seed, index, dimension: wave

    def another(wave, sequence, seed, index, dimension):
        u = draw1(sequence, seed, index, dimension)
        return Wave(wave.u if wave.split != 0 else u, wave.split)

    return another


@device
def _place(u):
    """The node of a table before u in [0, 1), and how far u is on the way to the next."""
    x = u * _f4(SPECTRUM_NODES - 1)
    i = min(_i8(x), _i8(SPECTRUM_NODES - 2))
    return i, x - _f4(i)


@device
def index_at(scene, row, u):
    """Index, relative to the outside, of the glass of that row at the place u of the spectrum."""
    i, f = _place(u)
    a, b = load_f4(scene.glasses, row * SPECTRUM_NODES + i), load_f4(scene.glasses, row * SPECTRUM_NODES + i + 1)
    return a + f * (b - a)


@device
def _column(scene, i, f, column):
    a = load_f4(scene.spectrum, i * SPECTRUM_COLUMNS + column)
    return a + f * (load_f4(scene.spectrum, (i + 1) * SPECTRUM_COLUMNS + column) - a)


@device
def wavelength_at(scene, u):
    """The wavelength in nm at the place u of the spectrum."""
    i, f = _place(u)
    return _column(scene, i, f, 0)


@device
def colour_at(scene, u):
    """Linear sRGB at the place u of the spectrum; its mean over u is (1, 1, 1)."""
    i, f = _place(u)
    return _column(scene, i, f, 1), _column(scene, i, f, 2), _column(scene, i, f, 3)


@device
def band_of(wave):
    """Of a path's wave (BANDS): 1 to BANDS, 0 for a path that is not split."""
    return _u4(min(_i4(wave.u * _f4(BANDS)), _i4(BANDS - 1)) + 1) if wave.split != 0 else _u4(0)


@specialised
def glass_of_material(scene, material, eta):
    """The Glass of a material of middle index eta, before any path; None in scenes without dispersion."""
    if not has_dispersion(scene):
        return lambda scene, material, eta: None

    def of_row(scene, material, eta):
        return Glass(_i8(load_f4(scene.materials, material * MATERIAL_COLUMNS + M_GLASS)), eta, _i4(0))

    return of_row


@specialised
def glass_of(b):
    """The Glass of a BSDF of scenes with dispersion."""
    if hasattr(b, "one") or "one" in getattr(b, "fields", ()):
        return lambda b: b.one.p.glass
    return lambda b: b.p.glass


@specialised
def met_by(scene, b, wave, beta):
    """A path's wave and throughput where it meets a surface of BSDF b, which colours it unless it does so later."""
    if absent(wave):
        return lambda scene, b, wave, beta: (wave, beta)

    def coloured(scene, b, wave, beta):
        glass = glass_of(b)
        if glass.row > 0 and glass.lazy == 0 and wave.split == 0:
            return Wave(wave.u, _i4(1)), mul(beta, colour_at(scene, wave.u))
        return wave, beta

    return coloured


@specialised
def beyond(b, wave, wi):
    """The wave of a path that leaves a surface of BSDF b in direction wi."""
    if absent(wave):
        return lambda b, wave, wi: wave

    def after(b, wave, wi):
        splits = glass_of(b).lazy != 0 and dot(b.n, wi) < _f4(0.0)
        return Wave(wave.u, _i4(1) if splits else wave.split)

    return after


@specialised
def colour_of_split(scene, b, wave, wi, beta):
    """beta of a path that leaves a surface of BSDF b in direction wi, coloured if it is split there (`beyond`)."""
    if absent(wave):
        return lambda scene, b, wave, wi, beta: beta

    def coloured(scene, b, wave, wi, beta):
        if glass_of(b).lazy != 0 and dot(b.n, wi) < _f4(0.0):
            return mul(beta, colour_at(scene, wave.u))
        return beta

    return coloured


@device
def _share(cos, eta, middle):
    fresnel, _ = fresnel_dielectric(cos, eta)
    return fresnel / max(middle, _f4(1e-12))


@device
def refracted_lazily(p, o, u):
    """(direction, weight, compression) of smooth glass of parameters p for a path from outside that is not split."""
    one = _f4(1.0)
    cos = min(abs(o[2]), one)
    middle, _ = fresnel_dielectric(cos, p.glass.eta)
    if u < middle:
        r, g, b = p.eta_rgb
        by_channel = _share(cos, r, middle), _share(cos, g, middle), _share(cos, b, middle)
        return (-o[0], -o[1], o[2]), mul(p.reflectance, by_channel), one
    fresnel, cos_t = fresnel_dielectric(cos, p.eta)
    inv = one / p.eta
    x, y, z = -inv * o[0], -inv * o[1], -cos_t
    norm = one / _f4(math.sqrt(max(x * x + y * y + z * z, _f4(1e-30))))
    weight = scale(p.transmittance, (one - fresnel) / max(one - middle, _f4(1e-12)))
    return (x * norm, y * norm, z * norm), weight, inv * inv
