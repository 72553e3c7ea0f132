"""Homogeneous media as kernels see them: a row of numbers each; and which of them meet at a surface.

A path carries the number of the medium that it is in, VACUUM for none: rays hold it (`pmviewer.render.cast.Ray`), and
surfaces with media on their sides change it where it is crossed. Scenes whose record has no MEDIA_FIELDS carry None in
its place and compile none of this.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pmviewer.kernels.accel.instance import stored_prim
from pmviewer.kernels.bsdf.kinds import NULL
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.memory import load_f4, load_i4
from pmviewer.kernels.scene import load3, material_kind, material_of
from pmviewer.kernels.vector import dot, largest

_f4 = np.float32
_i8 = np.int64

MEDIUM_COLUMNS = 15
MD_SIGMA_T, MD_ALBEDO, MD_EMISSION, MD_G, MD_G_BESIDE, MD_BESIDE, MD_GLOW, MD_FREE_PATH, MD_SHORTEST = np.array(
    [0, 3, 6, 9, 10, 11, 12, 13, 14], np.int64
)
"""Columns of a medium's row: extinction per length, albedo, radiance emitted per length, each RGB; the mean cosines of
the two lobes of the phase function, the share of the second; its glow (`pmviewer.kernels.media.glow`), −1 where
nothing is emitted; the shortest channel's mean free path, infinite on lattices; and what it is where it is shortest."""
_DEEPEST = _f4(24.0)
"""Optical depth that nothing shows through: exp(−24) = 4e-11."""
VACUUM = np.int64(-1)
SAME = -2
"""Of a side of a surface that ends no medium."""
MOST_BOUNDARIES = 256
"""Invisible boundaries that a ray crosses at most."""


def has_media(scene: Any) -> bool:
    """Whether the record of a scene, or its type, has media."""
    return has(scene, "media")


@device
def extinction(scene, medium):
    """σt of a medium per channel."""
    return load3(scene.media, medium * MEDIUM_COLUMNS + MD_SIGMA_T)


@device
def scattering_albedo(scene, medium):
    """σs/σt of a medium per channel."""
    return load3(scene.media, medium * MEDIUM_COLUMNS + MD_ALBEDO)


@device
def emission_of(scene, medium):
    """Radiance that a medium emits per length."""
    return load3(scene.media, medium * MEDIUM_COLUMNS + MD_EMISSION)


@device
def scatters(scene, medium):
    """Whether light is scattered there at all."""
    return medium >= 0 and largest(scattering_albedo(scene, medium)) > _f4(0.0)


@device
def free_path(scene, medium):
    """Mean free path of the channel in which it is shortest, infinite where nothing is met and on lattices."""
    return load_f4(scene.media, medium * MEDIUM_COLUMNS + MD_FREE_PATH)


@device
def shortest_path(scene, medium):
    """Mean free path of the channel and at the place in which it is shortest, infinite where nothing is met."""
    return load_f4(scene.media, medium * MEDIUM_COLUMNS + MD_SHORTEST)


@device
def way_seen(scene, medium):
    """Length of a homogeneous medium behind which no channel shows anything, infinite on lattices."""
    sigma = extinction(scene, medium)
    least = min(sigma[0], min(sigma[1], sigma[2]))
    if least > _f4(0.0) and free_path(scene, medium) < _f4(math.inf):
        return _DEEPEST / least
    return _f4(math.inf)


@device
def depth_of(sigma, length):
    """Optical depth; 0 of nothing, however long."""
    depth = sigma * length
    return depth if depth > _f4(0.0) else _f4(0.0)


@device
def transmittance(scene, medium, length):
    """Share of light per channel that comes through a length of the medium (Beer–Lambert)."""
    if medium < 0:
        return _f4(1.0), _f4(1.0), _f4(1.0)
    sigma = extinction(scene, medium)
    return (
        _f4(math.exp(-depth_of(sigma[0], length))),
        _f4(math.exp(-depth_of(sigma[1], length))),
        _f4(math.exp(-depth_of(sigma[2], length))),
    )


@device
def _emitted_channel(emission, sigma, length):
    depth = depth_of(sigma, length)
    if depth < _f4(1e-4):  # where 1 − exp loses its digits
        return emission * length * (_f4(1.0) - _f4(0.5) * depth) if emission > _f4(0.0) else _f4(0.0)
    return emission * (_f4(1.0) - _f4(math.exp(-depth))) / sigma


@device
def emitted_along(scene, medium, length):
    """Radiance that a length of the medium sends out at its end: ∫ ε exp(−σt s) ds."""
    e, sigma = emission_of(scene, medium), extinction(scene, medium)
    return (
        _emitted_channel(e[0], sigma[0], length),
        _emitted_channel(e[1], sigma[1], length),
        _emitted_channel(e[2], sigma[2], length),
    )


@device
def is_boundary(scene, prim):
    """Whether the primitive is no surface but the boundary of a medium, which rays cross."""
    return material_kind(scene, material_of(scene, prim)) == NULL


@specialised
def medium_beyond(scene, prim, ng, d, medium):
    """The medium that a ray of direction d is in once it has crossed the primitive with outward normal ng, coming
    through `medium`; None in scenes without media."""
    if not has_media(scene):
        return lambda scene, prim, ng, d, medium: None

    def beyond(scene, prim, ng, d, medium):
        at = _i8(2) * stored_prim(scene, prim)
        if load_i4(scene.prim_media, at) == SAME:
            return medium
        if dot(d, ng) < _f4(0.0):
            return _i8(load_i4(scene.prim_media, at))
        return _i8(load_i4(scene.prim_media, at + 1))

    return beyond


@device
def phase_numbers(scene, medium):
    """(g, g of the second lobe, its share) for `pmviewer.kernels.media.phase`."""
    row = medium * MEDIUM_COLUMNS
    return (
        load_f4(scene.media, row + MD_G),
        load_f4(scene.media, row + MD_G_BESIDE),
        load_f4(scene.media, row + MD_BESIDE),
    )


@specialised
def light_medium(scene, light):
    """The medium that photons of the light start in; None in scenes without media."""
    if not has_media(scene):
        return lambda scene, light: None
    return lambda scene, light: _i8(load_i4(scene.light_media, light))
