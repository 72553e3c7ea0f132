"""Light that a surface reflects from a photon map: irradiance where it is Lambertian (R1, E5)."""

from __future__ import annotations

import numpy as np
from numba.extending import overload

from pmviewer.kernels.jit import device
from pmviewer.kernels.plain_bsdf import INV_PI
from pmviewer.kernels.scattering import is_lambertian, is_plain, shading_normal
from pmviewer.kernels.surface import STRAIGHT
from pmviewer.kernels.vector import dot, mul, scale
from pmviewer.maps.glossy import radiance_knn, radiance_radius
from pmviewer.maps.stored import ALL_CLASSES
from pmviewer.render.lookup import gathered_irradiance, irradiance

_f4 = np.float32


@device
def _by_radius(photons, eye, radius, p, n, b, wo, class_mask):
    return radiance_radius(photons, p, n, radius, eye.flatness, class_mask, eye.filter, eye.cone_k, b, wo)


@device
def _by_nearest(photons, eye, radius, p, n, b, wo, class_mask):
    return radiance_knn(
        photons, p, n, eye.k, radius, eye.flatness, class_mask, eye.filter, eye.cone_k, eye.rim, eye.share, b, wo
    )


def _rich(photons):
    """`reflected` for materials of all kinds, by the type of the map's record."""
    each = _by_nearest if "planes" in photons.fields else _by_radius

    def any_bsdf(photons, eye, radius, p, n, b, wo, class_mask):
        if is_lambertian(b) and dot(shading_normal(b), n) > STRAIGHT:
            return scale(mul(b.albedo, irradiance(photons, eye, radius, p, n, class_mask)), INV_PI)
        return each(photons, eye, radius, p, n, b, wo, class_mask)

    return any_bsdf


def reflected(photons, eye, radius, p, n, b, wo, class_mask):
    """Radiance towards wo from the photons of a map around p, reflected by the STORED lobes of the BSDF b.

    `photons`, `eye`, `radius` and `class_mask` as for `pmviewer.render.lookup.irradiance`; n is the geometric normal on
    the side of wo.
    """
    raise NotImplementedError("only for kernels")


@overload(reflected)
def _reflected(photons, eye, radius, p, n, b, wo, class_mask):
    if not is_plain(b):
        return _rich(photons)

    def lambertian(photons, eye, radius, p, n, b, wo, class_mask):
        return scale(mul(b.albedo, irradiance(photons, eye, radius, p, n, class_mask)), INV_PI)

    return lambertian


def gathered(photons, sites, eye, p, n, b, wo):
    """The same where a gather ray ends: from photons of all classes, or from radiance photons (`sites`)."""
    raise NotImplementedError("only for kernels")


@overload(gathered)
def _gathered(photons, sites, eye, p, n, b, wo):
    if not is_plain(b):

        def any_bsdf(photons, sites, eye, p, n, b, wo):
            if is_lambertian(b) and dot(shading_normal(b), n) > STRAIGHT:
                return scale(mul(b.albedo, gathered_irradiance(photons, sites, eye, p, n)), INV_PI)
            return reflected(photons, eye, eye.global_radius, p, n, b, wo, np.int32(ALL_CLASSES))

        return any_bsdf

    def lambertian(photons, sites, eye, p, n, b, wo):
        return scale(mul(b.albedo, gathered_irradiance(photons, sites, eye, p, n)), INV_PI)

    return lambertian
