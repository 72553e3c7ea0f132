"""Secondary final gathering: short gather rays gather again where they land (R5; Kilauea, course guide §6.2).

Near a corner many gather rays end within a look-up radius of the edge, where the map's estimate is cut off by the other
wall. A ray shorter than a threshold does there what the eye pass does at a first surface, with one ray for its own
gather. That replaces the whole look-up, path class by path class: direct light by light samples and the emission that
the ray finds (multiple importance sampling), caustics from the caustic map, all other light from the global map where
the ray ends, however short it is.

Kernels compile it only where it is used: `corner` is a record of NO_CORNERS or CORNERS.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import STORED, bsdf_sample
from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.vector import add, dot, largest, mul
from pmviewer.maps.variant import ABSENT
from pmviewer.render.cast import cast
from pmviewer.render.chain import BLACK
from pmviewer.render.direct.choice import BY_POWER, LIST_WORDS, choose_by_power, choose_near
from pmviewer.render.direct.direct import found_light, light_samples
from pmviewer.render.given import Sampler
from pmviewer.render.record import C_RAYS, C_SAVED, C_SHADOW_RAYS
from pmviewer.render.reflect import reflected

_f4 = np.float32
_u4 = np.uint32

NO_CORNERS = ABSENT
CORNERS = np.zeros(1, np.dtype([("corners", np.int32)]))
LIGHT_SET, RAY_SET = np.array([0, 1], np.int64)
"""Dimension sets of the second gather, whose seed is its own."""


@specialised
def is_corner(given, length):
    """Whether a gather ray of that length gathers again where it lands."""
    if absent(part(given, "corner")):
        return lambda given, length: False
    return lambda given, length: length < given.eye.corner


@specialised
def gather_again(given, si, seed, index, counts, hit):
    """Radiance towards wo where a gather ray landed, by a gather of its own.

    Returns the direct light and caustics, and of the ray that brings the rest its weight, direction and what it met
    (`cast`).
    """
    if absent(part(given, "corner")):
        return lambda given, si, seed, index, counts, hit: (BLACK, BLACK, si.wo, hit)
    return _again


def _again(given, si, seed, index, counts, hit):
    scene, eye = given.scene, given.eye
    sampler = Sampler(eye.sequence, hash3(seed, _u4(0x5EC0), _u4(0)), index)
    u_pick, u, v, _ = draw4(eye.sequence, sampler.seed, index, LIGHT_SET)
    lights = stack_i4(LIST_WORDS)
    choice = choose_by_power(lights, eye.light_samples)
    if eye.choice != BY_POWER:
        choice = choose_near(scene, eye, given.choice_map, si.p, si.ng, lights)
    L, rays, saved = light_samples(scene, given.shadows, si, STORED, choice, eye.mis, sampler, u_pick, u, v)
    counts[C_RAYS] += rays
    counts[C_SHADOW_RAYS] += rays
    counts[C_SAVED] += saved
    if eye.caustic_mask != 0:
        L = add(L, reflected(given.caustic_map, eye, eye.caustic_radius, si, eye.caustic_mask))
    u, v, u_lobe, _ = draw4(eye.sequence, sampler.seed, index, RAY_SET)
    d, weight, pdf, _ = bsdf_sample(scene, si.bsdf, STORED, si.wo, u_lobe, u, v)
    if dot(d, si.ng) <= _f4(0.0) or not largest(weight) > _f4(0.0):
        return L, BLACK, d, hit
    counts[C_RAYS] += 1
    hit = cast(scene, si.p, si.ng, si.gap, d)
    if eye.mis != 0:
        found = found_light(scene, si.p, d, pdf, eye.mis, choice, eye.biased, hit[0], hit[3], hit[4])
        L = add(L, mul(weight, found))
    return L, weight, d, hit
