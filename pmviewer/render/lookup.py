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

_f4 = np.float32
_i8 = np.int64


@device
def _in_parts(photons, eye, radius, p, n, class_mask):
    """`combined` by the eye record: irradiance, photons that count, and the radius."""
    place, neighbours = Place(p, n, eye.flatness, class_mask), Neighbours(eye.k, radius, eye.rim, eye.share)
    return combined(photons, place, neighbours, Filter(eye.filter, eye.cone_k), None)


@specialised
def irradiance(photons, eye, radius, p, n, class_mask):
    """Irradiance (red, green, blue) at the point p with normal n from photons of the classes in `class_mask`.

    `photons` is the record of a grid, a kd-tree or several trees, `eye` an EYE_DTYPE record, `radius` the radius of the
    pass or the maximum radius of the search for neighbours.
    """
    if has(photons, "hull"):

        def by_hull(photons, eye, radius, p, n, class_mask):
            return hull_irradiance(photons, eye, radius, p, n, class_mask)

        return by_hull

    if has(photons, "differential"):

        def checked(photons, eye, radius, p, n, class_mask):
            return checked_irradiance(photons, eye, radius, p, n, class_mask)

        return checked

    if is_parts(photons):

        def of_parts(photons, eye, radius, p, n, class_mask):
            E, _, _ = _in_parts(photons, eye, radius, p, n, class_mask)
            return E

        return of_parts

    if is_kdtree(photons):

        def nearest(photons, eye, radius, p, n, class_mask):
            r, g, b, _, _ = irradiance_knn(
                photons,
                Place(p, n, eye.flatness, class_mask),
                Neighbours(eye.k, radius, eye.rim, eye.share),
                Filter(eye.filter, eye.cone_k),
            )
            return r, g, b

        return nearest

    def within(photons, eye, radius, p, n, class_mask):
        r, g, b, _ = irradiance_radius(
            photons, Place(p, n, eye.flatness, class_mask), radius, Filter(eye.filter, eye.cone_k)
        )
        return r, g, b

    return within


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
def gathered_irradiance(given, p, n):
    """Irradiance from photons of all classes where a gather ray ends, at p with normal n.

    Where the pass has radiance photons, that of the nearest one, made by the first ray that needs it, and where none is
    near a look-up of its own; without them always that.
    """
    if absent(part(given, "radiance")):

        def plain(given, p, n):
            return irradiance(given.global_map, given.eye, given.eye.global_radius, p, n, np.int32(ALL_CLASSES))

        return plain

    def through_radiance_photons(given, p, n):
        radiance, eye = given.radiance, given.eye
        index = nearest_radiance_photon(radiance, p, n, eye.radiance_cutoff, eye.flatness, eye.radiance_similarity)
        if index >= 0:
            word = radiance_photon_slot(radiance, index)
            if word != UNKNOWN:
                return radiance_photon_irradiance(radiance, word)
            p, n = radiance_photon_place(radiance, index)
        E = irradiance(given.global_map, eye, eye.global_radius, p, n, np.int32(ALL_CLASSES))
        if index < 0:
            return E
        # What was stored, not E: it must not matter who comes first.
        return radiance_photon_irradiance(radiance, store_irradiance(radiance, index, E))

    return through_radiance_photons
