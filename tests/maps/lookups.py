"""Look-ups as the eye pass makes them, from Python: with any estimate, in either kind of map."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.estimate.filters import FILTERS
from pmviewer.maps.search.stored import ALL_CLASSES
from pmviewer.maps.variant import looked_up_by
from pmviewer.render.lookup import estimate as estimated
from pmviewer.render.record import EYE_DTYPE

UP = np.array([0, 0, 1], np.float32)


@kernel
def look_up(maps, eyes, radius, points, normals, classes, E):
    """The eye pass's estimates at points (m, 3) with normals (m, 3) into E (m, 3)."""
    photons, eye = maps[0], eyes[0]
    for i in range(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        (E[i, 0], E[i, 1], E[i, 2]), _ = estimated(photons, eye, radius, p, n, classes)


def estimate(
    structure, points, radius, estimator="disc", normals=UP, classes=ALL_CLASSES, kind="constant", **fields
) -> np.ndarray:
    """Irradiance (m, 3) at points (m, 3). `structure` is a PhotonGrid or a PhotonKdTree; `fields` go into the eye
    record: k, share (1), rim, boundary, flatness (1), cone_k (1.1)."""
    eye = np.zeros(1, EYE_DTYPE)
    for name, value in {
        "flatness": 1,
        "cone_k": 1.1,
        "k": 50,
        "share": 1,
        "filter": FILTERS.index(kind),
        **fields,
    }.items():
        eye[name] = value
    points = np.ascontiguousarray(points, np.float32)
    normals = np.array(np.broadcast_to(normals, points.shape), np.float32, order="C")
    E = np.full(points.shape, np.nan, np.float32)
    look_up(looked_up_by(structure.record, estimator), eye, np.float32(radius), points, normals, np.int32(classes), E)
    return E
