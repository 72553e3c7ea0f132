"""Secondary final gathering: short gather rays gather again where they land (R5; course guide §6.2).

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
from pmviewer.kernels.dimensions import SECOND_GATHER_SALT, SECOND_LIGHT, SECOND_RAY
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.vector import add, dot, largest, mul
from pmviewer.maps.variant import ABSENT
from pmviewer.render.chain import BLACK
from pmviewer.render.counts import C_RAYS
from pmviewer.render.direct.choice import LIST_WORDS
from pmviewer.render.direct.choose import choose
from pmviewer.render.direct.direct import direct_light, found_light
from pmviewer.render.given import Sampler
from pmviewer.render.reflect import reflected
from pmviewer.render.straight import cast_straight

_f4 = np.float32
_i8 = np.int64
_u4 = np.uint32

NO_CORNERS = ABSENT
CORNERS = np.zeros(1, np.dtype([("corners", np.int32)]))


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
    sampler = Sampler(eye.sequence, hash3(seed, _u4(SECOND_GATHER_SALT), _u4(0)), index, SECOND_LIGHT)
    choice = choose(scene, eye, given.choice_map, si, stack_i4(LIST_WORDS))
    L = direct_light(scene, given.shadows, si, STORED, choice, _i8(eye.mis), sampler, counts)
    if eye.caustic_mask != 0:
        L = add(L, reflected(scene, given.caustic_map, eye, eye.caustic_radius, si, eye.caustic_mask))
    u, v, u_lobe, _ = draw4(eye.sequence, sampler.seed, index, SECOND_RAY)
    d, weight, pdf, _ = bsdf_sample(scene, si.bsdf, STORED, si.wo, u_lobe, u, v)
    if dot(d, si.ng) <= _f4(0.0) or not largest(weight) > _f4(0.0):
        return L, BLACK, d, hit
    counts[C_RAYS] += 1
    hit, tint = cast_straight(scene, si, d)
    weight = mul(weight, tint)
    if eye.mis != 0:
        L = add(L, mul(weight, found_light(scene, si.p, d, pdf, eye.mis, choice, eye.biased, hit)))
    return L, weight, d, hit
