"""The hemisphere of a pixel's first surface as a gather of the latest pass sees it, and as it is reprojected (R8)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import Fisheye, Float
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.engine.stages.reprojection import no_hits, rule_of
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.gather.estimation import DIFFUSE, KIND, NORMAL, POINT, SAMPLE, trace_samples
from pmviewer.render.gather.reprojection import SOURCES, look_around
from pmviewer.settings.schema import Gather


def fisheye_of(rendered: RenderedPass, pixel: int, origin: Float, gather: Gather, pool: WorkPool) -> Fisheye | None:
    """Of a pixel whose camera ray starts at `origin` (3,), with the numbers of that pass; None where its first surface
    is no diffuse one.

    A pixel that gathered itself is not among its own sources: what would have been found without it is told.
    """
    estimates, given = rendered.estimates, rendered.given
    assert estimates is not None
    eye, record = given.eye[0], given.cache[0]
    pixels, counts = int(eye["width"]) * int(eye["height"]), np.zeros(N_COUNTS, np.int64)
    samples = np.empty((pixels, SAMPLE), np.float32)
    pool.run([lambda: trace_samples(given, samples, counts, pixel, pixel + 1)])
    sample = samples[pixel]
    if sample[KIND] != np.float32(DIFFUSE):
        return None
    rings, sectors = int(record["rings"]), int(record["sectors"])
    known = estimates.known
    rule = rule_of(gather, 1.0) if known is None else known.rule
    hits = no_hits() if known is None else (known.begin, known.count, known.hits)
    axes = np.zeros((2, 3))

    def seen(sources: NDArray[np.int32]) -> tuple[Float, NDArray[np.bool_]]:
        cells, found = np.zeros((rings * sectors, 5), np.float32), np.zeros(rings * sectors, bool)
        pool.run([lambda: look_around(given, pixel, sources, samples, hits, rule, cells, found, axes, counts)])
        return cells[:, :3].astype(np.float64).reshape(sectors, rings, 3).swapaxes(0, 1), found

    gathered, _ = seen(np.full(SOURCES, -1, np.int32))
    n, p = (sample[at : at + 3].astype(np.float64) for at in (NORMAL, POINT))
    wo = (origin - p) / max(float(np.linalg.norm(origin - p)), 1e-30)
    taken = estimates.plane[pixel].astype(np.float64)
    estimate = taken[:3] if taken[3] > 0 else None
    if known is None:
        return Fisheye(gathered, n, axes[0], axes[1], wo, estimate=estimate)
    reprojected, found = seen(known.sources(np.array([pixel], np.int32), pool)[0])
    return Fisheye(gathered, n, axes[0], axes[1], wo, reprojected, ~found.reshape(sectors, rings).T, estimate)
