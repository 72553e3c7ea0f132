"""How the picture is made, pixel by pixel: kernels of their own, so that the eye pass pays nothing for them (V3).

Each follows the camera ray through the pixel's middle to the first surface that stores photons, over mirrors and
through glass on the way that a lobe's middle random number picks, and asks there what the eye pass would ask, of the
maps of the latest pass. Nothing is changed by it: not the film, and no radiance photon is filled in.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.bsdf.scattering import (
    FOLLOWED,
    NOTHING,
    STORED,
    bsdf_at,
    bsdf_f,
    bsdf_sample,
    same_side,
    shading_normal,
)
from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.lights.light import sample_one_light
from pmviewer.kernels.memory import bits_of_float, stack_i4
from pmviewer.kernels.random import draw4, hash3
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face, leave, surface_at
from pmviewer.kernels.vector import dot, largest
from pmviewer.maps.photon_words import encode_direction
from pmviewer.maps.radiance import nearest_site, site_place
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.render.direct.choice import BY_POWER, LIST_WORDS, choose_by_power, choose_near, chosen_light
from pmviewer.render.direct.shadow import UNKNOWN, known_visibility
from pmviewer.render.eye import BSDF_SET, PIXEL_SET, camera_ray, pixel_seed
from pmviewer.render.lookup import irradiance, looked_up
from pmviewer.render.pixel_radius import own_radius

FEWEST_SAMPLES = 8
"""Light samples that decide about a pixel, at least."""
FAMILY_CHANNELS = {"look-up": 2, "shadow rays": 1, "radiance photons": 4}
"""Radius and photons; share in percent; irradiance and number of the radiance photon."""
BEYOND = 0.5
"""Added to the number of a cell whose radiance photon is the nearest, but not near enough to be used; as in
`pmviewer.output.diagnostic_views`."""

_f4 = np.float32
_f8 = np.float64
_i4 = np.int32
_i8 = np.int64
_u4 = np.uint32
_INF = _f4(np.inf)
_NOWHERE = (_f4(0.0), _f4(0.0), _f4(0.0))
_NONE = _f4(-1.0)


@device
def stored_hit(scene, eye, pixel):
    """The first surface seen through the pixel's middle that stores photons.

    Returns primitive (−1: none) with its coordinates u, v, the point, geometric and shading normal (the first on the
    viewer's side), gap and wo.
    """
    half = _f4(0.5)
    o, d, near, far = camera_ray(eye, pixel, half, half)
    for _ in range(eye.max_depth + 1):
        t, prim, u, v = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, far)
        if prim < 0:
            break
        p, ng, ns, gap = surface_at(scene, prim, u, v, o[0], o[1], o[2], d[0], d[1], d[2], t)
        wo = (-d[0], -d[1], -d[2])
        b = bsdf_at(scene, prim, material_of(scene, prim), u, v, p, ng, ns, wo, eye.glossy)
        if b.groups & STORED != 0:
            return prim, u, v, p, face(ng, wo), ns, gap, wo
        if b.groups == NOTHING:
            break
        d, weight, _, _ = bsdf_sample(scene, b, FOLLOWED, wo, half, half, half)
        if not largest(weight) > _f4(0.0) or same_side(b, FOLLOWED, face(ng, wo), wo, d) == 0:
            break
        o = leave(p, face(ng, wo), gap, d[0], d[1], d[2])
        near, far = _f4(0.0), _INF
    return _i8(-1), _f4(0.0), _f4(0.0), _NOWHERE, _NOWHERE, _NOWHERE, _f4(0.0), _NOWHERE


@kernel
def seen_places(scenes, eyes, points, normals, found, first, last):
    """Point (pixels, 3) and normal's code (pixels,) of `stored_hit` for pixels first … last−1; found: bool, whether it
    found one."""
    scene, eye = scenes[0], eyes[0]
    for pixel in range(first, last):
        prim, _, _, p, ng, _, _, _ = stored_hit(scene, eye, pixel)
        found[pixel] = prim >= 0
        points[pixel, 0], points[pixel, 1], points[pixel, 2] = p
        normals[pixel] = encode_direction(ng[0], ng[1], ng[2]) if prim >= 0 else _u4(0)


@kernel
def lookup_view(scenes, eyes, maps, radii, which, radius, class_mask, out, first, last):
    """Radius (scene units) and photons of the look-up in pixels first … last−1; −1 where nothing is looked up.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,); maps: record (1,) of a grid or kd-tree; radii and which: as
    for `pmviewer.render.pixel_radius.own_radius`; radius: float32, of the pass or the largest; class_mask: int32; out:
    float32 (pixels, 2).
    """
    scene, eye, photons = scenes[0], eyes[0], maps[0]
    for pixel in range(first, last):
        prim, _, _, p, ng, _, _, _ = stored_hit(scene, eye, pixel)
        out[pixel, 0] = out[pixel, 1] = _NONE
        if prim >= 0:
            r = own_radius(radii, which, pixel, radius)
            out[pixel, 0], out[pixel, 1] = looked_up(photons, eye, r, p, ng, class_mask)


@device
def cell_number(p):
    """A number below 2²² for the cell of the radiance photon at p, which depends on its position alone."""
    h = hash3(_u4(bits_of_float(p[0])), _u4(bits_of_float(p[1])), _u4(bits_of_float(p[2])))
    return _f4(_i4(h & _u4(0x3FFFFF)))


@kernel
def site_view(scenes, eyes, maps, site_maps, cell_maps, out, first, last):
    """What a gather ray would take from the first surface: irradiance (W per unit area) of the nearest radiance photon,
    or of a look-up where none is near; and the `cell_number` of the nearest radiance photon, plus a half where it is
    beyond the cut-off, −1 where there is none at all. All −1 where no surface stores photons.

    maps: record (1,) of the global map; site_maps: record (1,) of the radiance photons; cell_maps: of the same in a
    grid for look-ups farther out; out: float32 (pixels, 4); the rest as for `lookup_view`.
    """
    scene, eye, photons, sites, cells = scenes[0], eyes[0], maps[0], site_maps[0], cell_maps[0]
    for pixel in range(first, last):
        prim, _, _, p, ng, _, _, _ = stored_hit(scene, eye, pixel)
        for c in range(4):
            out[pixel, c] = _NONE
        if prim < 0:
            continue
        site = nearest_site(sites, p, ng, eye.site_radius, eye.flatness, eye.site_similarity)
        if site >= 0:
            p, ng = site_place(sites, site)
            out[pixel, 3] = cell_number(p)
        else:
            cell = nearest_site(cells, p, ng, cells.radius, eye.flatness, eye.site_similarity)
            if cell >= 0:
                q, _ = site_place(cells, cell)
                out[pixel, 3] = cell_number(q) + _f4(BEYOND)
        E = irradiance(photons, eye, eye.global_radius, p, ng, _i4(ALL_CLASSES))
        out[pixel, 0], out[pixel, 1], out[pixel, 2] = E


@kernel
def shadow_view(scenes, eyes, choice_maps, shadow_maps, out, first, last):
    """Share of the light samples, in percent, that shadow photons decide; −1 where no light sample counts.

    choice_maps: record (1,) of the grid of photons that choose lights; shadow_maps: record (1,) of the shadow photons;
    out: float32 (pixels, 1); the rest as for `lookup_view`.
    """
    scene, eye, choice_map, shadows = scenes[0], eyes[0], choice_maps[0], shadow_maps[0]
    lights = stack_i4(LIST_WORDS)
    for pixel in range(first, last):
        out[pixel, 0] = _NONE
        prim, u, v, p, ng, ns, _, wo = stored_hit(scene, eye, pixel)
        if prim < 0:
            continue
        b = bsdf_at(scene, prim, material_of(scene, prim), u, v, p, ng, ns, wo, eye.glossy)
        if eye.choice == BY_POWER:
            choice = choose_by_power(lights, eye.light_samples)
        else:
            choice = choose_near(scene, eye, choice_map, p, ng, lights)
        if choice[4] == 0:
            continue
        seed = pixel_seed(eye, pixel)
        counted, known = _i8(0), _i8(0)
        for round_ in range((FEWEST_SAMPLES + choice[4] - 1) // choice[4]):
            for s in range(choice[4]):
                index = _u4(round_ * choice[4] + s)
                _, _, lu, lv = draw4(eye.sequence, seed, index, PIXEL_SET)
                u_pick, _, _, _ = draw4(eye.sequence, seed, index, BSDF_SET)
                light, m = chosen_light(scene, choice, s, u_pick)
                wi, _, _, pdf, _ = sample_one_light(scene, light, p, lu, lv)
                if not m * pdf > _f4(0.0) or same_side(b, STORED, ng, wo, wi) == 0:
                    continue
                f = bsdf_f(b, STORED, wo, wi)
                if f[0] + f[1] + f[2] > _f4(0.0) and abs(dot(wi, shading_normal(b))) > _f4(0.0):
                    counted += 1
                    if known_visibility(shadows, p, ng, light) != UNKNOWN:
                        known += 1
        if counted > 0:
            out[pixel, 0] = _f4(100.0) * _f4(known) / _f4(counted)
