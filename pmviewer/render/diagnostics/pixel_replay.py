"""One pixel's samples of a pass once more, with the numbers that the eye pass used: its way from the camera, and what
it looked up in the photon maps there, or which virtual lights it asked (V4). Nothing is changed by it."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, NOTHING, STORED, is_delta, transmits
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.compile.specialise import absent, part, specialised
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.vector import dot, largest, luminance, mul, scale
from pmviewer.maps.estimate.glossy import reflected_share
from pmviewer.maps.record import CAUSTIC
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.virtual_lights import CLAMPED
from pmviewer.render.cast import cast
from pmviewer.render.chain import arrive
from pmviewer.render.direct.choice import LIST_WORDS, expected_samples
from pmviewer.render.direct.choose import choose
from pmviewer.render.gather.weak import shows_map
from pmviewer.render.given import opened
from pmviewer.render.pixel import sampled_ray
from pmviewer.render.pixel_radius import OF_CAUSTIC, OF_GLOBAL, own_radius, radii_of
from pmviewer.render.pixel_samples import take_sample
from pmviewer.render.reflect import gathered, reflected, unfound
from pmviewer.render.split import first_way, next_way, split_camera_path, thinned
from pmviewer.render.straight import let_through
from pmviewer.render.virtual_lights.descent import CUT_WORDS
from pmviewer.render.virtual_lights.lit import asked_for, asked_light, one_light
from pmviewer.render.virtual_lights.walk import share_of_rays

OF_CAUSTICS, AS_INDIRECT, AS_DIRECT, AS_CAUSTICS, NOT_FOUND, GATHERED, WEAKLY = range(7)
"""What a look-up is for: the caustic map; the global map as indirect light, as direct light, as caustics; the caustic
map by the FOLLOWED lobes (`pmviewer.render.reflect.unfound`); the global map where the pixel gathers instead; and the
global map on a weak way (`pmviewer.render.gather.weak`)."""
ROW = np.dtype(
    [
        ("p", "f4", 3),
        ("n", "f4", 3),
        ("wo", "f4", 3),
        ("beta", "f4", 3),
        ("L", "f4", 3),
        ("radius", "f4"),
        ("purpose", "i4"),
        ("class_mask", "i4"),
        ("depth", "i4"),
        ("both_sides", "i4"),
        ("surface", "i4"),
    ]
)
"""A look-up: place, normal on the viewer's side, direction to the viewer, what the pixel takes of light from there, the
radiance that the look-up found, its radius (scene units; with the k nearest the largest one), purpose, path classes,
number of the surface on its way, whether photons from behind count too, and the surface's number among all that are
met, ways that waited where paths split behind the others."""
_COLUMNS = ROW.itemsize // 4
LIT = np.dtype(
    [
        ("p", "f4", 3),
        ("n", "f4", 3),
        ("F", "f4", 3),
        ("G", "f4"),
        ("seen", "f4"),
        *((name, "i4") for name in ("light", "depth", "surface", "asked")),
    ]
)
"""A virtual light at a surface of the pixel that it faces: the surface's place and normal on the viewer's side, the
radiance F that the pixel would get from it and its weight G, both times the lights that it stands for and what the
pixel takes of light from there, whether it is visible; its number in the pass, the number of the surface on its way
and among all that are met, and how many lights were asked there."""
_LIT_COLUMNS = LIT.itemsize // 4

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_CAUSTICS = np.int32(1 << CAUSTIC)


@device
def _put(rows, row, si, beta, L, radius, what):
    """A look-up into rows, float32 (n, columns of ROW); `what`: purpose, class mask, depth, both_sides, surface.
    Returns the next free row."""
    if row >= len(rows):
        return row
    for k in range(3):
        rows[row, k], rows[row, 3 + k], rows[row, 6 + k] = si.p[k], si.ng[k], si.wo[k]
        rows[row, 9 + k], rows[row, 12 + k] = beta[k], L[k]
    rows[row, 15] = radius
    for k in range(5):
        rows[row, 16 + k] = _f4(what[k])
    return row + 1


@device
def _stored(given, radii, pixel, si, beta, numbers, rows, row):
    """The look-ups by the STORED lobes of a surface with those numbers on its way and among all."""
    eye = given.eye
    depth, surface = numbers
    if eye.caustic_mask != 0:
        r = own_radius(radii_of(radii, pixel), OF_CAUSTIC, eye.caustic_radius)
        L = reflected(given.scene, given.caustic_map, eye, r, si, eye.caustic_mask)
        row = _put(rows, row, si, beta, L, r, (_i8(OF_CAUSTICS), _i8(eye.caustic_mask), depth, _i8(0), surface))
    for k in range(4):
        mask, r = eye.global_mask, own_radius(radii_of(radii, pixel), OF_GLOBAL, eye.global_radius)
        if k == 1:
            mask = eye.direct_mask
        elif k == 2:
            mask = eye.global_caustics
        elif k == 3:
            mask, r = _i4(0), eye.global_radius
            if eye.gather_rays > 0:
                mask = _i4(ALL_CLASSES)
        if mask != 0:
            L = reflected(given.scene, given.global_map, eye, r, si, mask)
            purpose = _i8(AS_INDIRECT + k) if k < 3 else _i8(GATHERED)
            row = _put(rows, row, si, beta, L, r, (purpose, _i8(mask), depth, _i8(0), surface))
    return row


@specialised
def _lit(given, si, beta, seed, numbers, lights, n):
    """The virtual lights at a surface with those numbers on its way and among all, from row n on, where there are any.
    Returns the next free row."""
    if absent(part(given, "virtual")):
        return lambda given, si, beta, seed, numbers, lights, n: n
    return lambda given, si, beta, seed, numbers, lights, n: _each_light(given, si, beta, seed, numbers, lights, n)


@device
def _each_light(given, si, beta, seed, numbers, lights, n):
    virtual = given.virtual
    cut = stack_i4(CUT_WORDS)
    asked, own = asked_for(given, si, seed, cut), _f4(1.0) - share_of_rays(given, si)
    for i in range(asked[0]):
        j, each = asked_light(given, si, i, asked, cut)
        if j < 0 or n >= len(lights):
            continue
        F, G, geometry, wi, end = one_light(given, si, j)
        if not (F[0] + F[1] + F[2] > _f4(0.0) or _f4(0.0) < G):
            continue
        T = let_through(given.scene, si, wi, end)
        seen = largest(T) > _f4(0.0)
        if _f4(0.0) < G:
            F, G = scale(F, own), G * own
        F = scale(mul(beta, mul(F, T) if seen else F), each)
        if virtual.estimator == CLAMPED and geometry > virtual.clamp:
            F = scale(F, virtual.clamp / geometry)
        for k in range(3):
            lights[n, k], lights[n, 3 + k], lights[n, 6 + k] = si.p[k], si.ng[k], F[k]
        lights[n, 9] = luminance(beta) * each * G
        lights[n, 10] = _f4(1.0) if seen else _f4(0.0)
        lights[n, 11], lights[n, 12], lights[n, 13], lights[n, 14] = (
            _f4(j),
            _f4(numbers[0]),
            _f4(numbers[1]),
            _f4(asked[0]),
        )
        n += 1
    return n


@device
def _shares(si, group, wi, shares):
    """What a group of lobes reflects of light from each wi (m, 3), into shares (m, 3)."""
    for i in range(len(wi)):
        w = (wi[i, 0], wi[i, 1], wi[i, 2])
        n = si.ng if dot(si.ng, w) > _f4(0.0) else scale(si.ng, _f4(-1.0))
        share = reflected_share(si.bsdf, group, n, si.wo, w)
        for k in range(3):
            shares[i, k] = share[k]


@device
def _expected(given, si, expected):
    """The light samples that are expected on each light at a surface into expected (n_lights,)."""
    choice = choose(given.scene, given.eye, given.choice_map, si, stack_i4(LIST_WORDS))
    for light in range(len(expected)):
        expected[light] = expected_samples(given.scene, choice, light)


@kernel
def replay_pixel(given, radii, asked, wi, shares, rows, vertices, prims, expected, lights, counts):
    """Replay a pixel in the pass of the eye record.

    given, radii: as for `pmviewer.render.eye.eye_pass`; asked: int64 (4,), the pixel, its samples in the pass, and the
    number of a surface (−1: of none) and the group of its lobes whose `reflected_share` of light from the directions
    wi, float32 (m, 3), goes into shares (m, 3); rows: float32 (n, columns of ROW) of what is looked up, in the order of
    the eye pass; vertices: float32 (v, 3), the ray's origin and the points that the path meets, of its first sample's
    ways the one that never waits; prims: int64 (v,), the primitives there; expected: float32 (n_lights,), light samples
    that the first surface of that way that stores photons spends on each light, left alone where there is none; lights:
    float32 (n, columns of LIT) of the virtual lights that face the surfaces of the pixel; counts: int64 (4,), how many
    rows and points there are, at the surface number counts[2] − 1 the lights were chosen, 0 for nowhere, and how many
    of `lights` are filled.
    """
    given = opened(given)
    scene, eye = given.scene, given.eye
    pixel, samples, index = asked[0], asked[1], eye.index
    main, surface = True, _i8(-1)
    row, points = _i8(0), _i8(1)
    for sample in range(samples):
        take_sample(eye, index * samples + sample)
        seed, ray = sampled_ray(scene, eye, pixel)
        way, ways = first_way(ray)
        if main:
            for k in range(3):
                vertices[0, k] = ray.o[k]
        while True:
            ray, beta, first, splits, u = way
            for depth in range(first, eye.max_depth + 1):
                hit = cast(scene, ray)
                if hit.prim < 0:
                    break
                if main and points < len(vertices):
                    prims[points] = hit.prim
                    for k in range(3):
                        vertices[points, k] = hit.p[k]
                    points += 1
                si, beta = arrive(scene, eye.glossy, ray.d, hit, beta)
                groups = si.bsdf.groups
                by_map = shows_map(given, si, beta, u, hit.t)
                beyond = thinned(beta, u, groups)
                if groups == NOTHING or not (by_map or largest(beyond) > _f4(0.0)):
                    break
                surface += 1
                if surface == asked[2]:
                    _shares(si, asked[3], wi, shares)
                if by_map:
                    what = _i8(WEAKLY), _i8(ALL_CLASSES), _i8(depth), _i8(0), surface
                    taken = scale(beta, _f4(1.0) / _f4(samples))
                    row = _put(rows, row, si, taken, gathered(given, si), eye.global_radius, what)
                beta = beyond
                if not largest(beta) > _f4(0.0):
                    break
                taken = scale(beta, _f4(1.0) / _f4(samples))
                if groups & STORED != 0 and not by_map:
                    if main and eye.direct != 0 and counts[2] == 0:
                        _expected(given, si, expected)
                        counts[2] = depth + 1
                    row = _stored(given, radii, pixel, si, taken, (_i8(depth), surface), rows, row)
                    counts[3] = _lit(given, si, taken, seed, (_i8(depth), surface), lights, counts[3])
                if groups & FOLLOWED == 0 or depth == eye.max_depth:
                    break
                if eye.unfound != 0 and not is_delta(si.bsdf):
                    r = own_radius(radii_of(radii, pixel), OF_CAUSTIC, eye.caustic_radius)
                    L = unfound(given.caustic_map, eye, r, si)
                    both = _i8(1) if transmits(si.bsdf) else _i8(0)
                    row = _put(rows, row, si, taken, L, r, (_i8(NOT_FOUND), _i8(_CAUSTICS), _i8(depth), both, surface))
                ray, beta, _, u, splits, ways = split_camera_path(scene, eye, si, beta, u, seed, depth, splits, ways)
                if not largest(beta) > _f4(0.0):
                    break
            main = False
            if ways.n == 0:
                break
            way, ways = next_way(ways)
    take_sample(eye, index)
    counts[0], counts[1] = row, points


def empty_rows(n: int) -> np.ndarray:
    """Room for n look-ups, as `replay_pixel` takes it."""
    return np.zeros((n, _COLUMNS), np.float32)


def empty_lights(n: int) -> np.ndarray:
    """Room for n virtual lights, as `replay_pixel` takes it."""
    return np.zeros((n, _LIT_COLUMNS), np.float32)


def as_lit(rows: np.ndarray) -> np.ndarray:
    """Filled rows as records (n,) of LIT: the kernel writes whole numbers as float32."""
    made = np.zeros(len(rows), LIT)
    for k, name in enumerate(("p", "n", "F")):
        made[name] = rows[:, 3 * k : 3 * k + 3]
    for k, name in enumerate(("G", "seen", "light", "depth", "surface", "asked")):
        made[name] = rows[:, 9 + k]
    return made


def as_look_ups(rows: np.ndarray) -> np.ndarray:
    """Filled rows as records (n,) of ROW: the kernel writes whole numbers as float32."""
    made = np.zeros(len(rows), ROW)
    for k, name in enumerate(("p", "n", "wo", "beta", "L")):
        made[name] = rows[:, 3 * k : 3 * k + 3]
    for k, name in enumerate(("radius", "purpose", "class_mask", "depth", "both_sides", "surface")):
        made[name] = rows[:, 15 + k]
    return made
