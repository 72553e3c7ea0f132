"""Gathering walks that normalise weighted sums: estimates of C = E[ΣG] and of the albedo of x (R10).

A walk leaves x by the STORED lobes. Of a single step it counts when its ray meets a surface that can hold virtual
lights, and photons of the map that tells their density lie around; on a glossy surface it brings the light of these,
too (`pmviewer.render.virtual_lights.gathered`). Of whole paths it goes on over STORED lobes and connects to a sample
of the lights at every vertex z:

    full path       counts (1 − s)·V there
    every vertex    counts V
    modified        counts (1 − s)·V; where V is 0 the walk goes on with 1/s times the weight

Light samples are drawn as photons leave the lights. The walk is a weighted one with Y(f)·cosθ as density, the very one
that q stands for, so that C is right for BSDFs whose sampling is no exact inverse; roulette keeps its weight near 1.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.opacity import over_opacity
from pmviewer.kernels.bsdf.albedo import stored_albedo
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_f, is_lambertian, keeps, same_side
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, part, specialised
from pmviewer.kernels.dimensions import WALK, WALK_EMITTER, WALK_LIGHT, WALK_SCATTER
from pmviewer.kernels.lights.light import pick_light
from pmviewer.kernels.lights.start import seen_from
from pmviewer.kernels.random import draw1, draw4
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.vector import add, luminance, mul, scale
from pmviewer.maps.virtual_lights import FULL, MODIFIED
from pmviewer.render.cast import cast, leaving
from pmviewer.render.chain import BLACK, WHITE, arrive, scatter
from pmviewer.render.counts import C_RAYS, C_SHADOW_RAYS
from pmviewer.render.straight import visible
from pmviewer.render.virtual_lights.gathered import IN_A_LOBE, lit_by_photons
from pmviewer.render.virtual_lights.light import LEAST_ALBEDO

_f4 = np.float32
_u4 = np.uint32


@device
def sees_light(given, si, pixel, index, step):
    """Whether a sample of the lights is visible from the surface, 1 or 0, and the direction to it."""
    scene, eye = given.scene, given.eye
    u0, u1, u2, u3 = draw4(eye.sequence, pixel.seed, index, WALK_LIGHT + step)
    light, _, _ = pick_light(scene, draw1(eye.sequence, pixel.seed, index, WALK_EMITTER + step))
    wi, end, area = seen_from(scene, light, (u2, u3), (u0, u1), si.p)
    if not area > _f4(0.0) or same_side(si.bsdf, STORED, si.ng, si.wo, wi) == 0:
        return _f4(0.0), wi
    pixel.counts[C_RAYS] += 1
    pixel.counts[C_SHADOW_RAYS] += 1
    return (_f4(1.0) if visible(scene, si.p, si.ng, si.gap, wi, end) else _f4(0.0)), wi


@device
def step_counts(given, ray, pixel, index, brings):
    """1 where the ray meets a surface that can hold virtual lights and that photons reach, and if it `brings` light the
    radiance from there."""
    scene, glossy = given.scene, given.eye.glossy
    hit = cast(scene, ray)
    if hit.prim < 0:
        return _f4(0.0), BLACK
    si, beta = arrive(scene, glossy, ray.d, hit, WHITE)
    kept = keeps(scene, material_of(scene, hit.prim), si.bsdf, hit.ng, si.wo, glossy)
    if kept & STORED == 0:
        return _f4(0.0), BLACK
    lit, L = lit_by_photons(given, si, pixel, index, brings)
    if brings:
        L = over_opacity(scene, hit.prim, hit.u, hit.v, hit.p, mul(beta, L))
    return lit, L


@device
def path_counts(given, ray, pixel, index):
    """What a walk counts that leaves x by the ray."""
    scene, eye, virtual = given.scene, given.eye, given.virtual
    stops = virtual.estimator == FULL or virtual.estimator == MODIFIED
    total, weight = _f4(0.0), _f4(1.0)
    for step in range(virtual.max_bounces):
        hit = cast(scene, ray)
        if step > 0:
            pixel.counts[C_RAYS] += 1
        if hit.prim < 0:
            break
        si, _ = arrive(scene, eye.glossy, ray.d, hit, WHITE)
        if si.bsdf.groups & STORED == 0:
            break
        seen, to_light = sees_light(given, si, pixel, index, step)
        albedo, stop = _f4(0.0), _f4(1.0)
        if stops:
            albedo = stored_albedo(scene, si.bsdf, si.wo)
            stop = max(_f4(1.0) - albedo, _f4(0.0))
        # Beyond the first hit a photon must have been scattered from the light into this walk.
        if seen > _f4(0.0) and (step == 0 or luminance(bsdf_f(si.bsdf, STORED, si.wo, to_light)) > _f4(0.0)):
            total += weight * stop
        u0, u1, u_lobe, u_end = draw4(eye.sequence, pixel.seed, index, WALK_SCATTER + step)
        wi, w, _, _ = scatter(scene, si, STORED, WHITE, u_lobe, u0, u1)
        weight *= luminance(w)
        if virtual.estimator == MODIFIED and not seen > _f4(0.0):
            weight /= max(albedo, LEAST_ALBEDO)
        survival = min(weight, _f4(1.0))
        if not u_end < survival:
            break
        weight /= survival
        ray = leaving(si, wi)
    return total


@specialised
def walk_counts(given, ray, pixel, index, brings):
    """What a gathering walk counts that begins with the ray, by the estimator of the record, and the radiance that it
    brings, if it does."""
    if has(part(given, "virtual"), "paths"):
        return lambda given, ray, pixel, index, brings: (path_counts(given, ray, pixel, index), BLACK)
    return lambda given, ray, pixel, index, brings: step_counts(given, ray, pixel, index, brings)


@device
def gather_rays(given, si):
    """Gather rays that bring light to a surface beside the virtual lights."""
    if is_lambertian(si.bsdf) or given.virtual.normalised == 0:
        return np.int32(0)
    return given.virtual.gather_rays


@device
def share_of_rays(given, si):
    """The share that gather rays have in the sums of a surface; its weighted lights have the rest."""
    n = _f4(gather_rays(given, si))
    return n / (n + _f4(IN_A_LOBE))


@device
def normalisation(given, si, pixel):
    """Estimates by walks of a_x, the albedo of x towards wo, of C, and, where gather rays bring some, of the light that
    x reflects."""
    scene, eye, virtual = given.scene, given.eye, given.virtual
    albedo, counted, light = _f4(0.0), _f4(0.0), BLACK
    bringing = gather_rays(given, si)
    walks, most = max(virtual.walks, bringing), max(virtual.walks, virtual.gather_rays)
    for k in range(walks):
        index = _u4(eye.index * _u4(most) + _u4(k))
        u0, u1, u_lobe, _ = draw4(eye.sequence, pixel.seed, index, WALK)
        wi, w, _, _ = scatter(scene, si, STORED, WHITE, u_lobe, u0, u1)
        weight = luminance(w)
        albedo += weight
        if virtual.normalised != 0 and weight > _f4(0.0):
            pixel.counts[C_RAYS] += 1
            count, L = walk_counts(given, leaving(si, wi), pixel, index, bringing > 0)
            counted += weight * count
            light = add(light, mul(w, L))
    each = _f4(1.0) / _f4(walks)
    return albedo * each, counted * each, scale(light, each)
