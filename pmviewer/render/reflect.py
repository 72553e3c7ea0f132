"""Light that a surface reflects from a photon map: irradiance where it is Lambertian (R1, E5)."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.jit import device
from pmviewer.kernels.plain_bsdf import INV_PI
from pmviewer.kernels.scattering import FOLLOWED, STORED, is_lambertian, is_plain, shading_normal, transmits
from pmviewer.kernels.specialise import has, specialised
from pmviewer.kernels.surface import STRAIGHT
from pmviewer.kernels.vector import add, dot, mul, scale
from pmviewer.maps.glossy import radiance_knn, radiance_radius
from pmviewer.maps.record import CAUSTIC, UNFOUND
from pmviewer.maps.stored import ALL_CLASSES
from pmviewer.render.lookup import gathered_irradiance, irradiance

_f4 = np.float32


_u4 = np.uint32
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))
_CAUSTICS = np.int32(1 << CAUSTIC)


@device
def _by_radius(photons, eye, radius, p, n, b, group, flags, wo, class_mask):
    how = eye.filter, eye.cone_k
    return radiance_radius(photons, p, n, radius, eye.flatness, class_mask, how[0], how[1], b, group, flags, wo)


@device
def _by_nearest(photons, eye, radius, p, n, b, group, flags, wo, class_mask):
    how = eye.filter, eye.cone_k, eye.rim, eye.share
    return radiance_knn(photons, p, n, eye.k, radius, eye.flatness, class_mask, *how, b, group, flags, wo)


def _photon_by_photon(photons):
    """The search for the kind of map that the type of its record says."""
    return _by_nearest if has(photons, "planes") else _by_radius


@specialised
def unfound(photons, eye, radius, p, n, b, wo):
    """Radiance towards wo by the FOLLOWED lobes of the BSDF b, which are no deltas, from those photons of the caustic
    map that stand for light which no path from the eye finds: from point, spot and directional lights over mirrors and
    clear glass alone. Light samples at p see through neither, and no ray from p meets such a light.

    Arguments as for `reflected`. Rough glass takes photons on both of its sides.
    """
    if is_plain(b):
        return lambda photons, eye, radius, p, n, b, wo: _BLACK
    each = _photon_by_photon(photons)

    def from_both_sides(photons, eye, radius, p, n, b, wo):
        L = each(photons, eye, radius, p, n, b, FOLLOWED, _u4(UNFOUND), wo, _CAUSTICS)
        if transmits(b):
            behind = scale(n, _f4(-1.0))
            L = add(L, each(photons, eye, radius, p, behind, b, FOLLOWED, _u4(UNFOUND), wo, _CAUSTICS))
        return L

    return from_both_sides


def _rich(photons):
    """`reflected` for materials of all kinds, by the type of the map's record."""
    each = _photon_by_photon(photons)

    def any_bsdf(photons, eye, radius, p, n, b, wo, class_mask):
        if is_lambertian(b) and dot(shading_normal(b), n) > STRAIGHT:
            return scale(mul(b.albedo, irradiance(photons, eye, radius, p, n, class_mask)), INV_PI)
        return each(photons, eye, radius, p, n, b, STORED, _u4(0), wo, class_mask)

    return any_bsdf


@specialised
def reflected(photons, eye, radius, p, n, b, wo, class_mask):
    """Radiance towards wo from the photons of a map around p, reflected by the STORED lobes of the BSDF b.

    `photons`, `eye`, `radius` and `class_mask` as for `pmviewer.render.lookup.irradiance`; n is the geometric normal on
    the side of wo.
    """
    if not is_plain(b):
        return _rich(photons)

    def lambertian(photons, eye, radius, p, n, b, wo, class_mask):
        return scale(mul(b.albedo, irradiance(photons, eye, radius, p, n, class_mask)), INV_PI)

    return lambertian


@specialised
def gathered(photons, sites, eye, p, n, b, wo):
    """The same where a gather ray ends: from photons of all classes, or from radiance photons (`sites`)."""
    if not is_plain(b):

        def any_bsdf(photons, sites, eye, p, n, b, wo):
            if is_lambertian(b) and dot(shading_normal(b), n) > STRAIGHT:
                return scale(mul(b.albedo, gathered_irradiance(photons, sites, eye, p, n)), INV_PI)
            return reflected(photons, eye, eye.global_radius, p, n, b, wo, np.int32(ALL_CLASSES))

        return any_bsdf

    def lambertian(photons, sites, eye, p, n, b, wo):
        return scale(mul(b.albedo, gathered_irradiance(photons, sites, eye, p, n)), INV_PI)

    return lambertian
