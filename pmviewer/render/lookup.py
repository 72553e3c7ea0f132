"""One look-up for all kinds of map: a grid searches the pass's radius, a kd-tree the k nearest photons, several trees
some of them in each.

Kernels are compiled for the kind of map they are given and for the mark it may bear (`pmviewer.maps.variant`),
so that nobody compiles a search or an estimate that is not used.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import absent, has, part, specialised
from pmviewer.kernels.memory import stack_i4
from pmviewer.kernels.vector import largest, scale
from pmviewer.maps.estimate.combined import combined
from pmviewer.maps.estimate.differential import checked_irradiance, reach
from pmviewer.maps.estimate.estimate import irradiance_knn, irradiance_radius
from pmviewer.maps.estimate.filters import Filter
from pmviewer.maps.estimate.hull import hull_irradiance
from pmviewer.maps.estimate.nearest import Neighbours
from pmviewer.maps.estimate.neighbours import BATCH_WORDS, FOUND_WORDS, SQUARED_WORDS, next_batch, search
from pmviewer.maps.radiance import (
    UNKNOWN,
    nearest_radiance_photon,
    radiance_photon_irradiance,
    radiance_photon_place,
    radiance_photon_slot,
    store_irradiance,
)
from pmviewer.maps.search.disc import Place
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.variant import ABSENT, is_kdtree, is_parts
from pmviewer.render.covered import ENOUGH_GATHERED, ENOUGH_KEPT, Spot, over_covered

_f4 = np.float32
_i8 = np.int64


@device
def _in_parts(photons, eye, radius, p, n, class_mask):
    """`combined` by the eye record: irradiance, photons that count, and the radius."""
    place, neighbours = Place(p, n, eye.flatness, class_mask), Neighbours(eye.k, radius, eye.rim, eye.share)
    return combined(photons, place, neighbours, Filter(eye.filter, eye.cone_k), None)


@specialised
def estimate(photons, eye, radius, p, n, class_mask):
    """Irradiance (red, green, blue) at the point p with normal n from photons of the classes in `class_mask`, and the
    radius of the disc whose area their power was divided by, 0 where it is no disc's.

    `photons` is the record of a grid, a kd-tree or several trees, `eye` an EYE_DTYPE record, `radius` the radius of the
    pass or the maximum radius of the search for neighbours.
    """
    if has(photons, "hull"):

        def by_hull(photons, eye, radius, p, n, class_mask):
            return hull_irradiance(photons, eye, radius, p, n, class_mask), _f4(0.0)

        return by_hull

    if has(photons, "differential"):

        def checked(photons, eye, radius, p, n, class_mask):
            return checked_irradiance(photons, eye, radius, p, n, class_mask), _f4(0.0)

        return checked

    if is_parts(photons):

        def of_parts(photons, eye, radius, p, n, class_mask):
            E, _, r = _in_parts(photons, eye, radius, p, n, class_mask)
            return E, r

        return of_parts

    if is_kdtree(photons):

        def nearest(photons, eye, radius, p, n, class_mask):
            red, green, blue, _, r = irradiance_knn(
                photons,
                Place(p, n, eye.flatness, class_mask),
                Neighbours(eye.k, radius, eye.rim, eye.share),
                Filter(eye.filter, eye.cone_k),
            )
            return (red, green, blue), r

        return nearest

    def within(photons, eye, radius, p, n, class_mask):
        red, green, blue, _ = irradiance_radius(
            photons, Place(p, n, eye.flatness, class_mask), radius, Filter(eye.filter, eye.cone_k)
        )
        return (red, green, blue), min(radius, photons.radius)

    return within


@device
def irradiance(scene, photons, eye, radius, at, class_mask, enough):
    """Irradiance (red, green, blue) at a Spot, of the part of the disc that surfaces cover; `enough` as for
    `over_covered`, the rest as for `estimate`."""
    E, r = estimate(photons, eye, radius, at.p, at.n, class_mask)
    if largest(E) > _f4(0.0):  # most look-ups for caustics find nothing
        return scale(E, over_covered(scene, eye, at, r, enough))
    return E


@specialised
def looked_up(photons, eye, radius, p, n, class_mask):
    """Radius of a look-up as `irradiance` makes it, and photons in it.

    Of a convex hull, the disc in which its photons were searched. With differential checking the mean of the folds'
    discs (of their areas), and the photons summed. Of a map in several parts that of the mean area of their discs, and
    the photons of all.
    """
    if has(photons, "hull"):

        def searched(photons, eye, radius, p, n, class_mask):
            scratch = (stack_i4(FOUND_WORDS), stack_i4(SQUARED_WORDS), stack_i4(BATCH_WORDS))
            found, r2, rim = search(photons, eye, radius, p, n, class_mask, scratch)
            run, at, total = _i8(0), _i8(0), _i8(0)
            while True:
                run, at, some = next_batch(photons, found, run, at, scratch)
                if some == 0:
                    break
                total += some
            if rim >= 0:
                total += 1
            return np.sqrt(r2), _f4(total)

        return searched

    if has(photons, "differential"):

        def checked(photons, eye, radius, p, n, class_mask):
            return reach(photons, eye, radius, p, n, class_mask)

        return checked

    if is_parts(photons):

        def of_parts(photons, eye, radius, p, n, class_mask):
            _, count, r = _in_parts(photons, eye, radius, p, n, class_mask)
            return r, _f4(count)

        return of_parts

    if is_kdtree(photons):

        def nearest(photons, eye, radius, p, n, class_mask):
            _, _, _, count, r = irradiance_knn(
                photons,
                Place(p, n, eye.flatness, class_mask),
                Neighbours(eye.k, radius, eye.rim, eye.share),
                Filter(eye.filter, eye.cone_k),
            )
            return r, _f4(count)

        return nearest

    def within(photons, eye, radius, p, n, class_mask):
        _, _, _, count = irradiance_radius(
            photons, Place(p, n, eye.flatness, class_mask), radius, Filter(eye.filter, eye.cone_k)
        )
        return min(radius, photons.radius), _f4(count)

    return within


NO_RADIANCE_PHOTONS = ABSENT
"""Stands for radiance photons where there are none."""


@specialised
def gathered_irradiance(given, at):
    """Irradiance from photons of all classes where a gather ray ends, at a Spot.

    Where the pass has radiance photons, that of the nearest one, made by the first ray that needs it, and where none is
    near a look-up of its own; without them always that.
    """
    if absent(part(given, "radiance")):

        def plain(given, at):
            return _of_all(given, at, _i8(ENOUGH_GATHERED))

        return plain

    def through_radiance_photons(given, at):
        radiance, eye = given.radiance, given.eye
        index = nearest_radiance_photon(
            radiance, at.p, at.n, eye.radiance_cutoff, eye.flatness, eye.radiance_similarity
        )
        if index < 0:
            return _of_all(given, at, _i8(ENOUGH_GATHERED))
        word = radiance_photon_slot(radiance, index)
        if word != UNKNOWN:
            return radiance_photon_irradiance(radiance, word)
        p, n = radiance_photon_place(radiance, index)
        E = _of_all(given, Spot(_i8(-1), p, n), _i8(ENOUGH_KEPT))
        # What was stored, not E: it must not matter who comes first.
        return radiance_photon_irradiance(radiance, store_irradiance(radiance, index, E))

    return through_radiance_photons


@device
def _of_all(given, at, enough):
    eye = given.eye
    return irradiance(given.scene, given.global_map, eye, eye.global_radius, at, np.int32(ALL_CLASSES), enough)
