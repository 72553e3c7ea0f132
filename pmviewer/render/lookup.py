"""One look-up for both kinds of map: a grid searches the pass's radius, a kd-tree the k nearest photons.

Kernels are compiled for the kind of map they are given, so that nobody compiles a search that is not used.
"""

from __future__ import annotations

from numba.extending import overload

from pmviewer.maps.estimate import irradiance_knn, irradiance_radius


def irradiance(photons, eye, radius, p, n, class_mask):
    """Irradiance (red, green, blue) at the point p with normal n from photons of the classes in `class_mask`.

    `photons` is the record of a grid or a kd-tree, `eye` an EYE_DTYPE record, `radius` the radius of the pass or the
    maximum radius of the search for neighbours.
    """
    raise NotImplementedError("only for kernels")


@overload(irradiance)
def _irradiance(photons, eye, radius, p, n, class_mask):
    if "planes" in photons.fields:

        def nearest(photons, eye, radius, p, n, class_mask):
            r, g, b, _, _ = irradiance_knn(
                photons,
                p[0],
                p[1],
                p[2],
                n[0],
                n[1],
                n[2],
                eye.k,
                radius,
                eye.flatness,
                class_mask,
                eye.filter,
                eye.cone_k,
                eye.rim,
            )
            return r, g, b

        return nearest

    def within(photons, eye, radius, p, n, class_mask):
        r, g, b, _ = irradiance_radius(
            photons,
            p[0],
            p[1],
            p[2],
            n[0],
            n[1],
            n[2],
            radius,
            eye.flatness,
            class_mask,
            eye.filter,
            eye.cone_k,
        )
        return r, g, b

    return within
