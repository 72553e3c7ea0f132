"""How the picture is made, pixel by pixel: kernels of their own, so that the eye pass pays nothing for them (V3).

Each follows the camera ray through the pixel's middle to the first surface that stores photons, over mirrors and
through glass on the way that a lobe's middle random number picks, and asks there what the eye pass would ask, of the
maps of the latest pass. Nothing is changed by it: not the film, and no radiance photon is filled in.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED, bsdf_f, same_side, shading_normal
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.dimensions import LIGHT
from pmviewer.kernels.lights.light import sample_one_light
from pmviewer.kernels.lights.sky_facing import place_on_light
from pmviewer.kernels.memory import bits_of_float, stack_i4
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.vector import dot, largest
from pmviewer.maps.photon_words import encode_direction
from pmviewer.maps.radiance import nearest_radiance_photon, radiance_photon_place
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.render.cast import Hit, cast
from pmviewer.render.chain import BLACK, WHITE, arrive, follow
from pmviewer.render.covered import ENOUGH_KEPT, Spot
from pmviewer.render.direct.choice import LIST_WORDS, chosen_light
from pmviewer.render.direct.choose import choose
from pmviewer.render.direct.shadow import UNKNOWN, known_visibility
from pmviewer.render.hidden_lights import past_lights
from pmviewer.render.lookup import irradiance, looked_up
from pmviewer.render.pixel import camera_ray, pixel_seed
from pmviewer.render.pixel_radius import own_radius, radii_of

FEWEST_SAMPLES = 8
"""Light samples that decide about a pixel, at least."""
FAMILY_CHANNELS = {"look-up": 2, "shadow rays": 1, "radiance photons": 4}
"""Radius and photons; share in percent; irradiance and number of the radiance photon."""
BEYOND = 0.5
"""Added to the number of a cell whose radiance photon is the nearest, but not near enough to be used; as in
`pmviewer.output.diagnostic_views`."""

_f4 = np.float32
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
_NONE = _f4(-1.0)


@device
def stored_hit(scene, eye, pixel):
    """The first surface seen through the pixel's middle that stores photons: a Hit (of primitive −1 where there is
    none), its geometric normal on the viewer's side, and the direction in which it is seen."""
    half = _f4(0.5)
    ray = past_lights(scene, eye, camera_ray(eye, pixel, half, half))
    hit = cast(scene, ray)
    beta = WHITE
    for _ in range(eye.max_depth + 1):
        if hit.prim < 0:
            break
        si, beta = arrive(scene, eye.glossy, ray.d, hit, beta)
        if si.bsdf.groups & STORED != 0:
            return hit, si.ng, ray.d
        if si.bsdf.groups & FOLLOWED == 0:
            break
        ray, beta, _ = follow(scene, si, beta, half, half, half)
        if not largest(beta) > _f4(0.0):
            break
        hit = cast(scene, ray)
    missed = Hit(_i8(-1), hit.u, hit.v, hit.t, hit.p, hit.ng, hit.ns, hit.gap, hit.medium, hit.crossed, hit.wave)
    return missed, hit.ng, ray.d


@kernel
def seen_places(scenes, eyes, points, normals, found, first, last):
    """Point (pixels, 3) and normal's code (pixels,) of `stored_hit` for pixels first … last−1; found: bool, whether it
    found one."""
    scene, eye = scenes[0], eyes[0]
    for pixel in range(first, last):
        hit, ng, _ = stored_hit(scene, eye, pixel)
        found[pixel] = hit.prim >= 0
        points[pixel, 0], points[pixel, 1], points[pixel, 2] = hit.p if hit.prim >= 0 else BLACK
        normals[pixel] = encode_direction(ng[0], ng[1], ng[2]) if hit.prim >= 0 else _u4(0)


@kernel
def lookup_view(scenes, eyes, maps, radii, which, radius, class_mask, out, first, last):
    """Radius (scene units) and photons of the look-up in pixels first … last−1; −1 where nothing is looked up.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,); maps: record (1,) of a grid or kd-tree; radii and which: as
    for `pmviewer.render.pixel_radius.own_radius`; radius: float32, of the pass or the largest; class_mask: int32; out:
    float32 (pixels, 2).
    """
    scene, eye, photons = scenes[0], eyes[0], maps[0]
    for pixel in range(first, last):
        hit, ng, _ = stored_hit(scene, eye, pixel)
        out[pixel, 0] = out[pixel, 1] = _NONE
        if hit.prim >= 0:
            r = own_radius(radii_of(radii, pixel), which, radius)
            out[pixel, 0], out[pixel, 1] = looked_up(photons, eye, r, hit.p, ng, class_mask)


@device
def cell_number(p):
    """A number below 2²² for the cell of the radiance photon at p, which depends on its position alone."""
    h = hash3(_u4(bits_of_float(p[0])), _u4(bits_of_float(p[1])), _u4(bits_of_float(p[2])))
    return _f4(_i4(h & _u4(0x3FFFFF)))


@kernel
def radiance_view(scenes, eyes, maps, radiance_maps, cell_maps, out, first, last):
    """What a gather ray would take from the first surface: irradiance (W per unit area) of the nearest radiance photon,
    or of a look-up where none is near; and the `cell_number` of the nearest radiance photon, plus a half where it is
    beyond the cut-off, −1 where there is none at all. All −1 where no surface stores photons.

    maps: record (1,) of the global map; radiance_maps: record (1,) of the radiance photons; cell_maps: of the same in a
    grid for look-ups farther out; out: float32 (pixels, 4); the rest as for `lookup_view`.
    """
    scene, eye, photons, radiance, cells = scenes[0], eyes[0], maps[0], radiance_maps[0], cell_maps[0]
    for pixel in range(first, last):
        hit, ng, _ = stored_hit(scene, eye, pixel)
        for c in range(4):
            out[pixel, c] = _NONE
        if hit.prim < 0:
            continue
        p = hit.p
        index = nearest_radiance_photon(radiance, p, ng, eye.radiance_cutoff, eye.flatness, eye.radiance_similarity)
        if index >= 0:
            p, ng = radiance_photon_place(radiance, index)
            out[pixel, 3] = cell_number(p)
        else:
            cell = nearest_radiance_photon(cells, p, ng, cells.radius, eye.flatness, eye.radiance_similarity)
            if cell >= 0:
                q, _ = radiance_photon_place(cells, cell)
                out[pixel, 3] = cell_number(q) + _f4(BEYOND)
        at = Spot(_i8(hit.prim) if index < 0 else _i8(-1), p, ng)
        E = irradiance(scene, photons, eye, eye.global_radius, at, _i4(ALL_CLASSES), _i8(ENOUGH_KEPT))
        out[pixel, 0], out[pixel, 1], out[pixel, 2] = E


@device
def known_share(scene, eye, choice_map, shadows, si, pixel, lights):
    """Light samples at a surface that count, and how many of them shadow photons decide. `lights`: LIST_WORDS words of
    scratch; the rest as for `shadow_view`."""
    choice = choose(scene, eye, choice_map, si, lights)
    samples = choice[4]
    seed = pixel_seed(eye, pixel)
    counted, known = _i8(0), _i8(0)
    rounds = (FEWEST_SAMPLES + samples - 1) // samples if samples > 0 else 0
    for i in range(rounds * samples):
        u, v, u_pick, _ = draw4(eye.sequence, seed, _u4(i), LIGHT)
        light, m = chosen_light(scene, choice, i % samples, u_pick)
        u, v, _ = place_on_light(scene, light, choice[5], u, v)
        wi, _, _, pdf, _ = sample_one_light(scene, light, si.p, u, v)
        if not m * pdf > _f4(0.0) or same_side(si.bsdf, STORED, si.ng, si.wo, wi) == 0:
            continue
        f = bsdf_f(si.bsdf, STORED, si.wo, wi)
        if f[0] + f[1] + f[2] > _f4(0.0) and abs(dot(wi, shading_normal(si.bsdf))) > _f4(0.0):
            counted += 1
            if known_visibility(shadows, si.p, si.ng, light) != UNKNOWN:
                known += 1
    return counted, known


@kernel
def shadow_view(scenes, eyes, choice_maps, shadow_maps, out, first, last):
    """Share of the light samples, in percent, that shadow photons decide; −1 where no light sample counts.

    choice_maps: record (1,) of the grid of photons that choose lights; shadow_maps: record (1,) of the shadow photons;
    out: float32 (pixels, 1); the rest as for `lookup_view`.
    """
    scene, eye = scenes[0], eyes[0]
    lights = stack_i4(LIST_WORDS)
    for pixel in range(first, last):
        out[pixel, 0] = _NONE
        hit, _, d = stored_hit(scene, eye, pixel)
        if hit.prim >= 0:
            si, _ = arrive(scene, eye.glossy, d, hit, WHITE)
            counted, known = known_share(scene, eye, choice_maps[0], shadow_maps[0], si, pixel, lights)
            if counted > 0:
                out[pixel, 0] = _f4(100.0) * _f4(known) / _f4(counted)
