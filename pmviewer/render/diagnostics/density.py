"""Density of stored photons at what the camera sees, pixel by pixel, for the views (I3).

Density is the irradiance of photons that all have the power 1. So it is estimated as irradiance is: from the NEAREST
photons and the area of their convex hull (`pmviewer.maps.estimate.hull`), which has the right mean at edges and corners
too, where a disc would halve it. Whatever the method looks up, so that pictures of different settings compare.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.estimate.hull import hull_irradiance
from pmviewer.maps.search.kdtree import PhotonKdTree, build_kdtree
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.render.diagnostics.diagnostics import stored_hit

NEAREST = 50
"""Photons of an estimate: 14 % of noise where they are independent."""
WIDEST = 0.25
"""Largest disc relative to the scene's radius, where photons are few."""
FLATNESS = 0.2
"""Half-thickness of the discs relative to their radius, that of look-ups and of density control."""
ONE = 47 << 10
"""Code of the power 1 (`pmviewer.maps.record`)."""

_f4 = np.float32
_i4 = np.int32


def counting_tree(photons: NDArray[np.float32]) -> PhotonKdTree:
    """A kd-tree of photons (n, 6) that all have the power 1."""
    alike = np.array(photons, np.float32, order="C")
    words = alike.view(np.uint32)
    words[:, 4], words[:, 5] = ONE | ONE << 16, ONE
    return build_kdtree(alike)


def counting_eye(eye: NDArray[np.void]) -> NDArray[Any]:
    """The eye record (1,) with the look-up of `density_view`."""
    counting = eye.copy()
    counting["k"], counting["share"], counting["flatness"], counting["boundary"] = NEAREST, 1.0, FLATNESS, 0.0
    return counting


@kernel
def density_view(scenes, eyes, trees, widest, out, first, last):
    """Photons stored per unit area at the first surface seen through the middle of pixels first … last−1, on the side
    seen; −1 where no surface stores photons.

    scenes: SCENE_DTYPE (1,); eyes: EYE_DTYPE (1,) of `counting_eye`; trees: record (1,) of a `counting_tree`; widest:
    float32, the largest radius searched; out: float32 (pixels, 1).
    """
    scene, eye, tree = scenes[0], eyes[0], trees[0]
    for pixel in range(first, last):
        hit, ng, _ = stored_hit(scene, eye, pixel)
        out[pixel, 0] = _f4(-1.0)
        if hit.prim >= 0:
            out[pixel, 0], _, _ = hull_irradiance(tree, eye, widest, hit.p, ng, _i4(ALL_CLASSES))
