"""What the kernels of an eye pass are given: the pass, a surface that a ray met, a pixel's random numbers."""

from __future__ import annotations

from typing import Any, NamedTuple

from pmviewer.kernels.compile.jit import inlined
from pmviewer.maps.variant import ABSENT
from pmviewer.maps.virtual_lights import NO_VIRTUAL

NO_VOLUME = ABSENT
"""Stands for the photons in media where there are none."""


class PassData(NamedTuple):
    """What is constant in a pass. Python holds arrays of one record each, kernels the records (`opened`).

    scene: SCENE_DTYPE; eye: EYE_DTYPE; caustic_map, global_map: of grids or kd-trees; choice_map: of the grid of
    photons that choose lights; radiance: of the radiance photons, or NO_RADIANCE_PHOTONS; cache: of the irradiance
    cache, or of estimates (`pmviewer.render.gather.estimation.ESTIMATES`), or NO_CACHE; shadows: of the shadow photons,
    or NO_SHADOWS; guides: of the photons that guide gather rays, or NO_GUIDES; corner: CORNERS or NO_CORNERS; virtual:
    of the virtual lights, or NO_VIRTUAL; volume_map: of the grid of photons in media, or NO_VOLUME; virtual_map: of a
    kd-tree of the photons that virtual lights are chosen from, or NO_VIRTUAL where their weights never ask for it.
    """

    scene: Any
    eye: Any
    caustic_map: Any
    global_map: Any
    choice_map: Any
    radiance: Any
    cache: Any
    shadows: Any
    guides: Any
    corner: Any
    virtual: Any = NO_VIRTUAL
    volume_map: Any = NO_VOLUME
    virtual_map: Any = NO_VIRTUAL


class SurfaceInteraction(NamedTuple):
    """A surface point seen from wo: prim, the primitive; p; ng, the geometric normal on the side of wo; gap, how far
    rays start off the surface; bsdf, of `pmviewer.kernels.bsdf.scattering`; wo, unit; media, those on the side of wo
    and behind the surface (`pmviewer.kernels.media.medium`), None in scenes without; wave, that of the path that
    arrived (`pmviewer.kernels.bsdf.dispersion`), None in scenes without dispersion."""

    prim: Any
    p: Any
    ng: Any
    gap: Any
    bsdf: Any
    wo: Any
    media: Any
    wave: Any


class Sampler(NamedTuple):
    """Where the random numbers of light samples come from: sequence, seed, the pass or ray as index in it, and the
    (first) dimension."""

    sequence: Any
    seed: Any
    index: Any
    dimension: Any


class Aim(NamedTuple):
    """What photons tell gather rays of a point: the scratch that holds them, how many rays they guide, and how many
    photons they are (`pmviewer.render.gather.guide.aim`)."""

    found: Any
    rays: Any
    photons: Any


class GatherRays(NamedTuple):
    """The rays that a surface casts by its STORED lobes: their number n; those of them that look for lights, n_bsdf, 0
    where samples of lights are left all to find; what guides rays, an Aim; the choice of lights that their emission is
    weighted against; the pixel's seed; three numbers for the ray that is of the BSDF alone, where none gathers."""

    n: Any
    n_bsdf: Any
    aimed: Any
    choice: Any
    seed: Any
    numbers: Any


@inlined
def opened(given):
    """The pass with each array's record in its place. Inlined: compiled functions can't return records."""
    return PassData(
        given.scene[0],
        given.eye[0],
        given.caustic_map[0],
        given.global_map[0],
        given.choice_map[0],
        given.radiance[0],
        given.cache[0],
        given.shadows[0],
        given.guides[0],
        given.corner[0],
        given.virtual[0],
        given.volume_map[0],
        given.virtual_map[0],
    )
