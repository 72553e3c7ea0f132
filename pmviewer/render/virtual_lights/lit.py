"""Indirect light at a surface point from the virtual lights of a pass (R10).

Sums go to the film's columns beyond its planes (`pmviewer.maps.virtual_lights`) and are divided when the film is looked
at: a mean of ratios would keep the bias of a pass for ever.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.instance import find_instance
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_f, same_side, shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, part, specialised
from pmviewer.kernels.dimensions import VIRTUAL_SUBSET
from pmviewer.kernels.media.medium import has_media
from pmviewer.kernels.memory import load_i4, stack_i4
from pmviewer.kernels.random import draw1
from pmviewer.kernels.surface import leave
from pmviewer.kernels.vector import dot, is_good, largest, luminance, mul, scale
from pmviewer.maps.virtual_lights import (
    CLAMPED,
    PRINTED_FULL,
    UNWEIGHTED,
    W_A,
    W_C,
    W_F,
    W_G,
    W_INDIRECT,
    W_LIGHTS,
    W_LOST,
    W_OBJECT,
    W_SPECULAR,
    W_SQUARES,
    W_SUM,
)
from pmviewer.render.counts import C_DROPPED, C_RAYS, C_SHADOW_RAYS
from pmviewer.render.pixel import INDIRECT, SPECULAR, shared
from pmviewer.render.planes import CHANNELS, MEDIA_CHANNELS
from pmviewer.render.straight import let_through
from pmviewer.render.virtual_lights.descent import CUT_WORDS, ask_cut, descend
from pmviewer.render.virtual_lights.light import facing_of, sent, towards, weight_of
from pmviewer.render.virtual_lights.walk import normalisation, share_of_rays

_f4 = np.float32
_f8 = np.float64
_i8 = np.int64
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))


@specialised
def virtual_light(given, si, beta, pixel, whole):
    """Adds the light from virtual lights by the STORED lobes of a surface to the film. `whole`: at the camera ray's own
    surface. Without virtual lights nothing is compiled."""
    if absent(part(given, "virtual")):
        return lambda given, si, beta, pixel, whole: None

    def lit(given, si, beta, pixel, whole):
        from_virtual_lights(given, si, beta, pixel, whole)

    return lit


@specialised
def asked_for(given, si, seed, cut):
    """How many virtual lights a pixel with that seed asks for at a surface, for how many each of them stands by an even
    choice, and where between two of them the choice begins, in [0, 1). `cut` points to CUT_WORDS words of scratch."""
    if not has(part(given, "virtual"), "descent"):
        return lambda given, si, seed, cut: _asked(given, seed, min(given.virtual.per_pixel, given.virtual.n), False)

    def perhaps_by_tree(given, si, seed, cut):
        virtual = given.virtual
        by_tree = virtual.descent != 0
        if by_tree:
            ask_cut(virtual, si.p, si.ng, cut)
        return _asked(given, seed, min(virtual.per_pixel, virtual.n), by_tree)

    return perhaps_by_tree


@device
def _asked(given, seed, m, by_chance):
    n, start = given.virtual.n, _f4(0.0)
    if m < n or by_chance:
        start = draw1(given.eye.sequence, seed, given.eye.index, VIRTUAL_SUBSET)
    return m, _f4(n) / _f4(max(m, _i8(1))), start


@specialised
def asked_light(given, si, i, asked, cut):
    """The number of the light that a pixel asks for as its i-th at a surface, and for how many lights it stands; −1
    for none. `asked`, cut: of `asked_for`."""
    if not has(part(given, "virtual"), "descent"):
        return lambda given, si, i, asked, cut: _evenly(given.virtual, i, asked)

    def perhaps_by_tree(given, si, i, asked, cut):
        if given.virtual.descent == 0:
            return _evenly(given.virtual, i, asked)
        m, _, start = asked
        j, probability = descend(given.virtual, si.p, si.ng, cut, (_f8(i) + _f8(start)) / _f8(m))
        return j, (_f4(1.0 / (probability * _f8(m))) if j >= 0 else _f4(0.0))

    return perhaps_by_tree


@device
def _evenly(virtual, i, asked):
    _, each, start = asked
    j = _i8(i)
    if virtual.per_pixel < virtual.n:
        j = min(_i8((_f8(i) + _f8(start)) * _f8(each)), virtual.n - 1)
    return j, each


@device
def one_light(given, si, j):
    """Virtual light j at the surface before visibility: reflected radiance F, its weight G, the geometry term, the
    direction and the end of the shadow ray. F is black where nothing can arrive."""
    scene, virtual, b = given.scene, given.virtual, si.bsdf
    row, y, ny, gap, wi, distance2 = towards(virtual, j, si.p)
    facing = facing_of(scene, virtual, row, ny, wi)
    nothing = (_BLACK, _f4(0.0), _f4(0.0), wi, y)
    if not (distance2 > _f4(0.0) and facing > _f4(0.0)) or same_side(b, STORED, si.ng, si.wo, wi) == 0:
        return nothing
    cos = abs(dot(shading_normal(b), wi))
    f = bsdf_f(b, STORED, si.wo, wi)
    if not (luminance(f) > _f4(0.0) and cos > _f4(0.0)):
        return nothing
    wo = (-wi[0], -wi[1], -wi[2])
    geometry = cos * facing / distance2
    light, f_y, albedo = sent(scene, virtual, row, given.eye.glossy, wo)
    F = scale(mul(f, light), geometry)
    G = luminance(f) * geometry * weight_of(virtual, row, f_y, albedo)
    return F, G, geometry, wi, leave(y, ny, gap, wo[0], wo[1], wo[2])


@device
def from_virtual_lights(given, si, beta, pixel, whole):
    """See `virtual_light`."""
    scene, virtual, film, counts = given.scene, given.virtual, pixel.film, pixel.counts
    weighted = virtual.estimator != UNWEIGHTED and virtual.estimator != CLAMPED
    cut = stack_i4(CUT_WORDS)
    asked = asked_for(given, si, pixel.seed, cut)
    sums = sums_at(scene)
    base = sums + (W_INDIRECT if whole else W_SPECULAR)
    plane = _i8(INDIRECT if whole else SPECULAR)
    throughput, rays = luminance(beta), share_of_rays(given, si)
    lights = _f4(1.0) - rays
    for i in range(asked[0]):
        j, each = asked_light(given, si, i, asked, cut)
        if j < 0:
            continue
        F, G, geometry, wi, end = one_light(given, si, j)
        if not (F[0] + F[1] + F[2] > _f4(0.0) or _f4(0.0) < G):
            continue
        counts[C_RAYS] += 1
        counts[C_SHADOW_RAYS] += 1
        T = let_through(scene, si, wi, end)
        if not largest(T) > _f4(0.0):
            continue
        F = scale(mul(mul(beta, F), T), each)
        if not (is_good(F) and _f4(np.inf) > G):
            counts[C_DROPPED] += 1
            continue
        Y = _f8(luminance(F))
        film[sums + W_SUM] += Y
        film[sums + W_SQUARES] += Y * Y
        if virtual.estimator == CLAMPED and geometry > virtual.clamp:
            F = scale(F, virtual.clamp / geometry)
            film[sums + W_LOST] += Y - _f8(luminance(F))
        target = _i8(plane)
        if weighted and _f4(0.0) < G:
            target, F = _i8(base + W_F), scale(F, lights)
            film[base + W_G] += _f8(lights * throughput * each * G)
        film[target] += shared(pixel, _f8(F[0]))
        film[target + 1] += shared(pixel, _f8(F[1]))
        film[target + 2] += shared(pixel, _f8(F[2]))
    film[sums + W_LIGHTS] += _f8(asked[0])
    if weighted:
        albedo, counted, light = normalisation(given, si, pixel)
        if rays > _f4(0.0):
            light = scale(mul(beta, light), rays)
            if is_good(light):
                film[base + W_G] += _f8(rays * throughput * counted)
                film[base + W_F] += shared(pixel, _f8(light[0]))
                film[base + W_F + 1] += shared(pixel, _f8(light[1]))
                film[base + W_F + 2] += shared(pixel, _f8(light[2]))
        if virtual.estimator == PRINTED_FULL:
            albedo = _f4(1.0)
        film[base + W_A] += _f8(throughput * albedo)
        film[base + W_C] += _f8(throughput * counted)


@specialised
def sums_at(scene):
    """Column of the film at which the sums begin: behind its planes."""
    if has_media(scene):
        return lambda scene: MEDIA_CHANNELS
    return lambda scene: CHANNELS


@specialised
def note_object(given, prim, pixel):
    """Notes the object of the primitive that the camera ray met, for a normalisation by object: the shape, or the
    instance."""
    if absent(part(given, "virtual")):
        return lambda given, prim, pixel: None
    if has(part(given, "scene"), "instances"):

        def instanced(given, prim, pixel):
            if prim < given.scene.n_stored:
                number = _i8(load_i4(given.virtual.objects, prim))
            else:
                number = given.virtual.n_objects + find_instance(given.scene, prim)
            pixel.film[sums_at(given.scene) + W_OBJECT] = _f8(number)

        return instanced

    def stored(given, prim, pixel):
        pixel.film[sums_at(given.scene) + W_OBJECT] = _f8(load_i4(given.virtual.objects, prim))

    return stored
