"""Gathering walks that normalise weighted sums: estimates of C = E[ΣG] and of the albedo of x (R10).

A walk leaves x by the STORED lobes. Of a single step it counts when its ray meets a surface that can hold virtual
lights. Of whole paths it goes on over STORED lobes and connects to a sample of the lights at every vertex z:

    full path       counts (1 − s)·V there
    every vertex    counts V
    modified        counts (1 − s)·V; where V is 0 the walk goes on with 1/s times the weight

Light samples are drawn as photons leave the lights. The walk is a weighted one with Y(f)·cosθ as density, the very one
that q stands for, so that C is right for BSDFs whose sampling is no exact inverse; roulette keeps its weight near 1.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.albedo import stored_albedo
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_at, bsdf_f, bsdf_sample, keeps, same_side
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, part, specialised
from pmviewer.kernels.lights.light import pick_light
from pmviewer.kernels.lights.start import seen_from
from pmviewer.kernels.random import draw1, draw4
from pmviewer.kernels.scene import material_of
from pmviewer.kernels.surface import face
from pmviewer.kernels.vector import luminance
from pmviewer.maps.virtual_lights import FULL, MODIFIED
from pmviewer.render.cast import cast
from pmviewer.render.direct.direct import visible
from pmviewer.render.given import SurfaceInteraction
from pmviewer.render.record import C_RAYS, C_SHADOW_RAYS
from pmviewer.render.virtual_lights.light import LEAST_ALBEDO

_f4 = np.float32
_u4 = np.uint32
_i8 = np.int64
WALK_SET, START_SET, LIGHT_SET = _i8(0x50000), _i8(0x60000), _i8(0x70000)


@device
def sees_light(given, si, seed, index, step, counts):
    """Whether a sample of the lights is visible from the surface: 1 or 0; the direction to it."""
    scene, eye = given.scene, given.eye
    u0, u1, u2, u3 = draw4(eye.sequence, seed, index, START_SET + step)
    light, _, _ = pick_light(scene, draw1(eye.sequence, seed, index, LIGHT_SET + step))
    wi, end, area = seen_from(scene, light, (u2, u3), (u0, u1), si.p)
    if not area > _f4(0.0) or same_side(si.bsdf, STORED, si.ng, si.wo, wi) == 0:
        return _f4(0.0), wi
    counts[C_RAYS] += 1
    counts[C_SHADOW_RAYS] += 1
    return (_f4(1.0) if visible(scene, si.p, si.ng, si.gap, wi, end) else _f4(0.0)), wi


@device
def step_counts(given, hit, wi):
    """1 where the ray in direction wi met a surface that can hold virtual lights (`cast`)."""
    scene = given.scene
    prim, u, v, q, nq, sq, _, _ = hit
    if prim < 0:
        return _f4(0.0)
    wo = (-wi[0], -wi[1], -wi[2])
    material = material_of(scene, prim)
    b = bsdf_at(scene, prim, material, u, v, q, nq, sq, wo, given.eye.glossy)
    return _f4(1.0) if keeps(scene, material, b, nq, wo, given.eye.glossy) & STORED != 0 else _f4(0.0)


@device
def path_counts(given, hit, wi, seed, index, counts):
    """What a walk counts that has just left x in direction wi and met `hit` (`cast`)."""
    scene, eye, virtual = given.scene, given.eye, given.virtual
    stops = virtual.estimator == FULL or virtual.estimator == MODIFIED
    total, weight = _f4(0.0), _f4(1.0)
    for step in range(virtual.max_bounces):
        prim, u, v, z, nz, sz, gap, _ = hit
        if prim < 0:
            break
        wo = (-wi[0], -wi[1], -wi[2])
        b = bsdf_at(scene, prim, material_of(scene, prim), u, v, z, nz, sz, wo, eye.glossy)
        if b.groups & STORED == 0:
            break
        si = SurfaceInteraction(z, face(nz, wo), gap, b, wo)
        seen, to_light = sees_light(given, si, seed, index, step, counts)
        stop = _f4(1.0)
        albedo = _f4(0.0)
        if stops:
            albedo = stored_albedo(scene, b, wo)
            stop = max(_f4(1.0) - albedo, _f4(0.0))
        # Beyond the first hit a photon must have been scattered from the light into this walk.
        if seen > _f4(0.0) and (step == 0 or luminance(bsdf_f(b, STORED, wo, to_light)) > _f4(0.0)):
            total += weight * stop
        u0, u1, u_lobe, u_end = draw4(eye.sequence, seed, index, WALK_SET + 1 + step)
        wi, w, _, _ = bsdf_sample(scene, b, STORED, wo, u_lobe, u0, u1)
        if same_side(b, STORED, si.ng, wo, wi) == 0:
            break
        weight *= luminance(w)
        if virtual.estimator == MODIFIED and not seen > _f4(0.0):
            weight /= max(albedo, LEAST_ALBEDO)
        survival = min(weight, _f4(1.0))
        if not u_end < survival:
            break
        weight /= survival
        counts[C_RAYS] += 1
        hit = cast(scene, z, nz, gap, wi)
    return total


@specialised
def walk_counts(given, hit, wi, seed, index, counts):
    """What a gathering walk counts by the estimator of the record."""
    if has(part(given, "virtual"), "paths"):
        return lambda given, hit, wi, seed, index, counts: path_counts(given, hit, wi, seed, index, counts)
    return lambda given, hit, wi, seed, index, counts: step_counts(given, hit, wi)


@device
def normalisation(given, si, seed, counts):
    """Estimates of a_x, the albedo of x towards wo, and of C by `walks` walks."""
    scene, eye, virtual = given.scene, given.eye, given.virtual
    albedo, counted = _f4(0.0), _f4(0.0)
    for k in range(virtual.walks):
        index = _u4(eye.index * _u4(virtual.walks) + _u4(k))
        u0, u1, u_lobe, _ = draw4(eye.sequence, seed, index, WALK_SET)
        wi, w, _, _ = bsdf_sample(scene, si.bsdf, STORED, si.wo, u_lobe, u0, u1)
        if same_side(si.bsdf, STORED, si.ng, si.wo, wi) == 0:
            continue
        weight = luminance(w)
        albedo += weight
        if virtual.normalised != 0 and weight > _f4(0.0):
            counts[C_RAYS] += 1
            counted += weight * walk_counts(given, cast(scene, si.p, si.ng, si.gap, wi), wi, seed, index, counts)
    return albedo / _f4(virtual.walks), counted / _f4(virtual.walks)
