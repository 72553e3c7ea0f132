"""The final gather where there is an irradiance cache: interpolated where records say enough, else cast (R6).

Only irradiance of Lambertian lobes is cached, and only indirect light; direct light is sampled everywhere. Kernels are
compiled for the cache or, given NO_CACHE, for the gather alone.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.plain_bsdf import INV_PI
from pmviewer.kernels.scattering import STORED, bsdf_sample, is_lambertian, shading_normal
from pmviewer.kernels.specialise import has, specialised
from pmviewer.kernels.vector import dot, largest, mul, scale
from pmviewer.maps.irradiance_cache import interpolate
from pmviewer.render.cast import cast
from pmviewer.render.direct import BLACK, found_light
from pmviewer.render.gather import gather_rays
from pmviewer.render.record import C_CACHED, C_GATHERED, C_RAYS

_f4 = np.float32


@specialised
def cached(cache, eye, p, b, counts):
    """(irradiance, gather rays that are still to be cast) at the point p of a surface with the BSDF b.

    `cache` is the record of an IrradianceCache, or of NO_CACHE: always all rays."""
    if has(cache, "none"):
        return lambda cache, eye, p, b, counts: (BLACK, eye.gather_rays)

    def from_records(cache, eye, p, b, counts):
        if is_lambertian(b):
            E, weight = interpolate(cache, p, shading_normal(b))
            if weight > _f4(0.0):
                counts[C_CACHED] += 1
                return E, np.int32(0)
        counts[C_GATHERED] += 1
        return BLACK, eye.gather_rays

    return from_records


@specialised
def surface_rays(
    cache,
    known,
    gather,
    scene,
    eye,
    photons,
    sites,
    guides,
    corner,
    shadows,
    caustic_map,
    choice_map,
    choice,
    found,
    guided,
    m,
    beta,
    p,
    ng,
    gap,
    b,
    wo,
    n,
    u_lobe,
    u,
    v,
    seed,
    counts,
):
    """`pmviewer.render.gather.gather_rays` where `gather` rays are to be cast, else direct light by n rays and indirect
    light from the irradiance `known`. Both are sums over n rays."""
    if has(cache, "none"):

        def plain(
            cache,
            known,
            gather,
            scene,
            eye,
            photons,
            sites,
            guides,
            corner,
            shadows,
            caustic_map,
            choice_map,
            choice,
            found,
            guided,
            m,
            beta,
            p,
            ng,
            gap,
            b,
            wo,
            n,
            u_lobe,
            u,
            v,
            seed,
            counts,
        ):
            return gather_rays(
                scene,
                eye,
                photons,
                sites,
                guides,
                corner,
                shadows,
                caustic_map,
                choice_map,
                choice,
                found,
                guided,
                m,
                beta,
                p,
                ng,
                gap,
                b,
                wo,
                n,
                u_lobe,
                u,
                v,
                seed,
                counts,
            )

        return plain

    def with_cache(
        cache,
        known,
        gather,
        scene,
        eye,
        photons,
        sites,
        guides,
        corner,
        shadows,
        caustic_map,
        choice_map,
        choice,
        found,
        guided,
        m,
        beta,
        p,
        ng,
        gap,
        b,
        wo,
        n,
        u_lobe,
        u,
        v,
        seed,
        counts,
    ):
        if gather > 0:
            return gather_rays(
                scene,
                eye,
                photons,
                sites,
                guides,
                corner,
                shadows,
                caustic_map,
                choice_map,
                choice,
                found,
                guided,
                m,
                beta,
                p,
                ng,
                gap,
                b,
                wo,
                n,
                u_lobe,
                u,
                v,
                seed,
                counts,
            )
        direct = BLACK
        if eye.direct != 0 and eye.mis != 0:
            wi, weight, pdf, _ = bsdf_sample(scene, b, STORED, wo, u_lobe, u, v)
            if dot(wi, ng) > _f4(0.0) and largest(weight) > _f4(0.0):
                counts[C_RAYS] += 1
                hit = cast(scene, p, ng, gap, wi)
                L = found_light(scene, p, wi, pdf, n, choice, eye.biased, hit[0], hit[3], hit[4])
                direct = mul(weight, L)
        return direct, scale(mul(b.albedo, known), INV_PI)

    return with_cache
