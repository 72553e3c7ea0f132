"""Light that a surface reflects from a photon map: irradiance where it is Lambertian (R1, E5)."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.bsdf.plain import INV_PI
from pmviewer.kernels.bsdf.scattering import FOLLOWED, STORED, is_lambertian, is_plain, shading_normal, transmits
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import part, specialised
from pmviewer.kernels.surface import STRAIGHT
from pmviewer.kernels.vector import add, dot, largest, mul, scale
from pmviewer.maps.estimate.combined import Lobe, combined
from pmviewer.maps.estimate.filters import Filter
from pmviewer.maps.estimate.glossy import radiance_knn, radiance_radius
from pmviewer.maps.estimate.nearest import Neighbours
from pmviewer.maps.record import CAUSTIC, UNFOUND
from pmviewer.maps.search.disc import Place
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.variant import is_kdtree, is_parts
from pmviewer.render.covered import ENOUGH, Spot, over_covered
from pmviewer.render.lookup import gathered_irradiance, irradiance

_f4 = np.float32


_i8 = np.int64
_u4 = np.uint32
_BLACK = (_f4(0.0), _f4(0.0), _f4(0.0))
_CAUSTICS = np.int32(1 << CAUSTIC)


@device
def _by_radius(photons, eye, radius, si, n, group, flags, class_mask):
    L = radiance_radius(photons, eye, radius, si.p, n, class_mask, si.bsdf, group, flags, si.wo)
    return L, min(radius, photons.radius)


@device
def _by_nearest(photons, eye, radius, si, n, group, flags, class_mask):
    return radiance_knn(photons, eye, radius, si.p, n, class_mask, si.bsdf, group, flags, si.wo)


@device
def _by_parts(photons, eye, radius, si, n, group, flags, class_mask):
    L, _, r = combined(
        photons,
        Place(si.p, n, eye.flatness, class_mask),
        Neighbours(eye.k, radius, eye.rim, eye.share),
        Filter(eye.filter, eye.cone_k),
        Lobe(n, si.bsdf, group, flags, si.wo),
    )
    return L, r


def _photon_by_photon(photons):
    """The search for the kind of map that the type of its record says: radiance, and the radius of the disc."""
    if is_parts(photons):
        return _by_parts
    return _by_nearest if is_kdtree(photons) else _by_radius


@specialised
def unfound(photons, eye, radius, si):
    """Radiance towards wo by the FOLLOWED lobes of the BSDF, which are no deltas, from those photons of the caustic map
    that stand for light which no path from the eye finds: from point, spot and directional lights over mirrors and
    clear glass alone. Light samples at p see through neither, and no ray from p meets such a light.

    Arguments as for `reflected`. Rough glass takes photons on both of its sides.
    """
    if is_plain(part(si, "bsdf")):
        return lambda photons, eye, radius, si: _BLACK
    each = _photon_by_photon(photons)

    def from_both_sides(photons, eye, radius, si):
        L, _ = each(photons, eye, radius, si, si.ng, FOLLOWED, _u4(UNFOUND), _CAUSTICS)
        if transmits(si.bsdf):
            behind = scale(si.ng, _f4(-1.0))
            other, _ = each(photons, eye, radius, si, behind, FOLLOWED, _u4(UNFOUND), _CAUSTICS)
            L = add(L, other)
        return L

    return from_both_sides


@specialised
def reflected(scene, photons, eye, radius, si, class_mask):
    """Radiance towards wo from the photons of a map around p, reflected by the STORED lobes of the BSDF.

    `photons`, `eye`, `radius` and `class_mask` as for `pmviewer.render.lookup.irradiance`.
    """
    if is_plain(part(si, "bsdf")):
        return lambda scene, photons, eye, radius, si, class_mask: _lambertian(
            scene, photons, eye, radius, si, class_mask
        )
    each = _photon_by_photon(photons)

    def any_bsdf(scene, photons, eye, radius, si, class_mask):
        if is_lambertian(si.bsdf) and dot(shading_normal(si.bsdf), si.ng) > STRAIGHT:
            return _lambertian(scene, photons, eye, radius, si, class_mask)
        L, r = each(photons, eye, radius, si, si.ng, STORED, _u4(0), class_mask)
        if largest(L) > _f4(0.0):
            return scale(L, over_covered(scene, eye, _spot(si), r, _i8(ENOUGH)))
        return L

    return any_bsdf


@device
def _lambertian(scene, photons, eye, radius, si, class_mask):
    E = irradiance(scene, photons, eye, radius, _spot(si), class_mask, _i8(ENOUGH))
    return scale(mul(si.bsdf.albedo, E), INV_PI)


@device
def _spot(si):
    return Spot(si.prim, si.p, si.ng)


@specialised
def gathered(given, si):
    """The same where a gather ray ends: from photons of all classes, or from radiance photons."""
    if is_plain(part(si, "bsdf")):

        def lambertian(given, si):
            return scale(mul(si.bsdf.albedo, gathered_irradiance(given, _spot(si))), INV_PI)

        return lambertian

    def any_bsdf(given, si):
        if is_lambertian(si.bsdf) and dot(shading_normal(si.bsdf), si.ng) > STRAIGHT:
            return scale(mul(si.bsdf.albedo, gathered_irradiance(given, _spot(si))), INV_PI)
        eye = given.eye
        return reflected(given.scene, given.global_map, eye, eye.global_radius, si, np.int32(ALL_CLASSES))

    return any_bsdf
