"""The final gather where there is an irradiance cache: interpolated where records say enough, else cast (R6); and
where gathers are estimated: the pixel's estimate where there is one, else cast (R7).

Records don't know what is narrower than they reach: a lamp just below a ceiling leaves a dark strip that light leaks
into from both sides. So a short ray looks about before records are believed, and where it meets something the surface
gathers. That is right whatever the ray's chance, since what is gathered knows nothing of it.

Only irradiance of Lambertian lobes is known, and only indirect light; direct light is sampled everywhere. Kernels are
compiled for the cache, for estimates or, given NO_CACHE, for the gather alone.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.occlusion import occluded
from pmviewer.kernels.bsdf.plain import INV_PI
from pmviewer.kernels.bsdf.scattering import STORED, bsdf_sample, is_lambertian, shading_normal
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, part, specialised
from pmviewer.kernels.dimensions import OCCLUSION
from pmviewer.kernels.lights.reach import may_meet_light
from pmviewer.kernels.random import draw4
from pmviewer.kernels.surface import leave
from pmviewer.kernels.vector import dot, from_basis, largest, mul, scale
from pmviewer.kernels.warp import square_to_cosine_hemisphere
from pmviewer.maps.irradiance_cache import interpolate
from pmviewer.render.chain import BLACK
from pmviewer.render.counts import C_CACHED, C_GATHERED, C_RAYS
from pmviewer.render.direct.direct import found_light
from pmviewer.render.gather.estimation import estimated
from pmviewer.render.gather.gather import gather_rays
from pmviewer.render.straight import cast_straight

_f4 = np.float32
NEARBY = np.float32(0.5)
"""How far the short ray goes, over the records' mean reach."""


@device
def occluded_nearby(given, si, pixel, length):
    """Whether a ray of that length by the cosine meets something."""
    eye = given.eye
    u, v, _, _ = draw4(eye.sequence, pixel.seed, eye.index, OCCLUSION)
    x, y, z = square_to_cosine_hemisphere(u, v)
    wi = from_basis(si.ng, x, y, z)
    pixel.counts[C_RAYS] += 1
    o = leave(si.p, si.ng, si.gap, wi[0], wi[1], wi[2])
    return occluded(given.scene, o[0], o[1], o[2], wi[0], wi[1], wi[2], _f4(0.0), length)


@specialised
def rays_unknown(given, si):
    """Gather rays of a surface where nothing is known."""
    if absent(part(given, "cache")) or has(part(given, "cache"), "estimates"):
        return lambda given, si: given.eye.gather_rays
    return lambda given, si: given.eye.cache_rays if is_lambertian(si.bsdf) else given.eye.gather_rays


@specialised
def cached(given, si, pixel, whole):
    """(irradiance, gather rays that are still to be cast) at a surface that a Pixel sees: all rays where nothing is
    known. `whole`: at the camera ray's own surface."""
    if absent(part(given, "cache")):
        return lambda given, si, pixel, whole: (BLACK, given.eye.gather_rays)
    if has(part(given, "cache"), "estimates"):

        def from_estimates(given, si, pixel, whole):
            if whole and is_lambertian(si.bsdf):
                E, known = estimated(given.cache, pixel.number)
                if known:
                    pixel.counts[C_CACHED] += 1
                    return E, np.int32(0)
            pixel.counts[C_GATHERED] += 1
            return BLACK, given.eye.gather_rays

        return from_estimates

    def from_records(given, si, pixel, whole):
        if is_lambertian(si.bsdf):
            E, weight, reach = interpolate(given.cache, si.p, shading_normal(si.bsdf))
            if weight > _f4(0.0) and not occluded_nearby(given, si, pixel, NEARBY * reach):
                pixel.counts[C_CACHED] += 1
                return E, np.int32(0)
        pixel.counts[C_GATHERED] += 1
        return BLACK, rays_unknown(given, si)

    return from_records


@specialised
def surface_rays(given, known, gather, si, beta, rays, counts):
    """`pmviewer.render.gather.gather.gather_rays` where `gather` rays are to be cast, else direct light by the rays of
    the BSDF and indirect light from the irradiance `known`. Both are sums over the rays."""
    if absent(part(given, "cache")):
        return lambda given, known, gather, si, beta, rays, counts: gather_rays(given, si, beta, rays, counts)

    def with_cache(given, known, gather, si, beta, rays, counts):
        if gather > 0:
            return gather_rays(given, si, beta, rays, counts)
        scene, eye = given.scene, given.eye
        direct = BLACK
        if eye.direct != 0 and rays.n_bsdf > 0:
            u_lobe, u, v = rays.numbers
            wi, weight, pdf, _ = bsdf_sample(scene, si.bsdf, STORED, si.wo, u_lobe, u, v)
            met = dot(wi, si.ng) > _f4(0.0) and largest(weight) > _f4(0.0)
            if met and may_meet_light(scene, si.p, wi):
                counts[C_RAYS] += 1
                hit, tint = cast_straight(scene, si, wi)
                weight = mul(weight, tint)
                direct = mul(weight, found_light(scene, si.p, wi, pdf, rays.n_bsdf, rays.choice, eye.biased, hit))
        return direct, scale(mul(si.bsdf.albedo, known), INV_PI)

    return with_cache
