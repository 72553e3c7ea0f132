"""One light pass: batches of photons over the threads, joined in batch order into the caustic and the global map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.kernels.random import INDEPENDENT, SOBOL
from pmviewer.photons.trace import (
    C_CAUSTIC,
    C_DROPPED,
    C_GLOBAL,
    C_RAYS,
    LIGHT_PASS_DTYPE,
    N_COUNTS,
    N_LEDGER,
    trace_photons,
)
from pmviewer.scene.flatten import FlatScene
from pmviewer.settings import Photons

Float = NDArray[np.float32]
Runner = Callable[[list[Callable[[], Any]]], list[Any]]
"""Runs the given functions, on any number of threads, and returns their results in order."""

BATCH = 8192
"""Photons a task: fixed, so that the result does not depend on the number of threads."""


@dataclass(frozen=True)
class PhotonMaps:
    """Photons of one pass: `caustic` and `global_` (n, 6) float32 as in `pmviewer.maps.record`, with their units of
    power in watts, `normals` (n,) uint32 of the surfaces that the global photons lie on, on the side that they came
    from, as codes of `encode_direction` (empty unless asked for), `emitted` trajectories, `rays` cast, `dropped`
    non-finite photons and the energy `ledger`."""

    caustic: Float
    global_: Float
    caustic_unit: float
    global_unit: float
    emitted: int
    rays: int
    dropped: int
    ledger: NDArray[np.float64]
    normals: NDArray[np.uint32]

    @property
    def bytes(self) -> int:
        return self.caustic.nbytes + self.global_.nbytes + self.normals.nbytes


def trajectories(settings: Photons, N: int, has_specular: bool) -> tuple[int, int, float]:
    """Trajectories traced, trajectories that fill the global map, and the probability of storing a global photon.

    Trajectories that would fill the caustic map alone are not traced when nothing in the scene makes caustics.
    """
    if settings.q_rule == "photons":
        return N, N, settings.q
    filling = max(1, int(settings.q * N))
    return (N if has_specular else filling), filling, 1.0


def trace_pass(
    scene: FlatScene,
    settings: Photons,
    seed: int,
    first_index: int,
    N: int,
    has_specular: bool,
    run: Runner,
    with_normals: bool = False,
) -> PhotonMaps:
    """Trace one pass of N trajectories.

    Photon powers are the same for all trajectories of a map: Φ/N in the caustic map, Φ/⌊qN⌋ in the global one
    (trajectory split) or Φ/(qN) (photon rule), K §2.4.
    """
    traced, filling, probability = trajectories(settings, N, has_specular)
    record = np.zeros(1, LIGHT_PASS_DTYPE)
    record[0] = (
        seed & 0xFFFFFFFF,
        first_index,
        SOBOL if settings.sequence == "sobol" else INDEPENDENT,
        settings.max_bounces,
        filling,
        probability,
        has_specular,
        settings.indirect_caustics,
    )

    def batch(i0: int) -> Callable[[], _Batch]:
        return lambda: _trace_batch(scene, record, i0, min(i0 + BATCH, traced), filling, has_specular, with_normals)

    results = run([batch(i0) for i0 in range(0, traced, BATCH)])
    counts = sum((r[2] for r in results), np.zeros(N_COUNTS, np.int64))
    unit = scene.total_luminance
    return PhotonMaps(
        caustic=_join([part for r in results for part in r[0]]),
        global_=_join([part for r in results for part in r[1]]),
        caustic_unit=unit / traced,
        global_unit=unit / (filling * probability),
        emitted=traced,
        rays=int(counts[C_RAYS]),
        dropped=int(counts[C_DROPPED]),
        ledger=sum((r[3] for r in results), np.zeros(N_LEDGER)),
        normals=np.concatenate([np.empty(0, np.uint32), *(part for r in results for part in r[4])]),
    )


_Batch = tuple[list[Float], list[Float], NDArray[np.int64], NDArray[np.float64], list[NDArray[np.uint32]]]


def _trace_batch(
    scene: FlatScene,
    record: NDArray[np.void],
    i0: int,
    i1: int,
    filling: int,
    has_specular: bool,
    with_normals: bool,
) -> _Batch:
    """Photons i0 … i1−1, resumed with fresh buffers whenever one is full."""
    max_bounces = int(record[0]["max_bounces"])
    total, ledger = np.zeros(N_COUNTS, np.int64), np.zeros(N_LEDGER)
    caustic_parts: list[Float] = []
    global_parts: list[Float] = []
    normal_parts: list[NDArray[np.uint32]] = []
    while i0 < i1:
        rows = 5 * (i1 - i0) + 2 * max_bounces
        global_out = np.empty((rows if i0 < filling else max_bounces, 6), np.float32)
        caustic_out = np.empty((rows // 2 + max_bounces if has_specular else max_bounces, 6), np.float32)
        normals_out = np.empty(len(global_out) if with_normals else 0, np.uint32)
        counts = np.zeros(N_COUNTS, np.int64)
        i0 = trace_photons(scene.record, record, i0, i1, global_out, normals_out, caustic_out, counts, ledger)
        global_parts.append(global_out[: counts[C_GLOBAL]].copy())
        normal_parts.append(normals_out[: counts[C_GLOBAL]].copy())
        caustic_parts.append(caustic_out[: counts[C_CAUSTIC]].copy())
        total += counts
    return caustic_parts, global_parts, total, ledger, normal_parts


def _join(parts: list[Float]) -> Float:
    return np.ascontiguousarray(np.concatenate(parts)) if parts else np.empty((0, 6), np.float32)
