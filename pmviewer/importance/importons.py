"""Importance maps of a camera: importons traced in batches over the threads, and the maps from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.importance.trace import (
    C_CAUSTIC,
    C_DROPPED,
    C_GLOBAL,
    C_RAYS,
    IMPORTON_COLUMNS,
    IMPORTON_PASS_DTYPE,
    N_COUNTS,
    trace_importons,
)
from pmviewer.kernels.dimensions import IMPORTON_SALT
from pmviewer.maps.importance.importance_map import Importons
from pmviewer.scene.arrays.flatten import FlatScene

Runner = Callable[[list[Callable[[], Any]]], list[Any]]

BATCH = 2048
"""Importons a task: fixed, so that the result does not depend on the number of threads."""


@dataclass(frozen=True)
class Rule:
    """Where importons are stored: as the final pass looks maps up, see `pmviewer.importance.trace`. `corner` in scene
    units, `glossy` a roughness; `pixel` (x, y) is the only one that importons start through, None for all."""

    caustic: bool
    global_: bool
    gather: bool
    gather_specular: bool
    corner: float
    glossy: float
    max_depth: int
    unfound: bool = False
    pixel: tuple[int, int] | None = None


@dataclass(frozen=True, eq=False)
class Traced:
    """Importons first … first + N − 1 of a camera: those of the `caustic` and of the `global_` importance map, with
    weights in units of an importon's at the start; `rays` cast and importons `dropped` for weights that are not
    numbers."""

    N: int
    caustic: Importons
    global_: Importons
    rays: int
    dropped: int

    @property
    def bytes(self) -> int:
        """Of both maps, for the stage store."""
        return self.caustic.bytes + self.global_.bytes


def trace(scene: FlatScene, eye: NDArray[np.void], rule: Rule, seed: int, first: int, N: int, run: Runner) -> Traced:
    """Trace importons first … first + N − 1, the same ones for any number of threads.

    eye: EYE_DTYPE (1,), camera and size of the image.
    """
    camera = eye[0]
    part = (0, 0, camera["width"], camera["height"]) if rule.pixel is None else (*rule.pixel, 1, 1)
    record = np.zeros(1, IMPORTON_PASS_DTYPE)
    record[0] = (
        (seed ^ IMPORTON_SALT) & 0xFFFFFFFF,
        rule.max_depth,
        rule.glossy,
        rule.caustic,
        rule.global_,
        rule.gather,
        rule.gather_specular,
        rule.corner,
        rule.unfound,
        *part,
    )
    most = 2 * rule.max_depth + 2
    last = first + N

    def batch(i0: int, i1: int) -> tuple[list[NDArray[np.float32]], list[NDArray[np.float32]], NDArray[np.int64]]:
        caustic, global_, total = [], [], np.zeros(N_COUNTS, np.int64)
        while i0 < i1:
            rows = 2 * (i1 - i0) + most
            caustic_out = np.empty((rows if rule.caustic else most, IMPORTON_COLUMNS), np.float32)
            global_out = np.empty((rows if rule.global_ else most, IMPORTON_COLUMNS), np.float32)
            counts = np.zeros(N_COUNTS, np.int64)
            i0 = trace_importons(scene.record, eye, record, i0, i1, caustic_out, global_out, counts)
            caustic.append(caustic_out[: counts[C_CAUSTIC]].copy())
            global_.append(global_out[: counts[C_GLOBAL]].copy())
            total += counts
        return caustic, global_, total

    starts = range(first, last, BATCH)
    results = run([lambda i0=i0: batch(i0, min(i0 + BATCH, last)) for i0 in starts])  # type: ignore[misc]
    total = sum((counts for _, _, counts in results), np.zeros(N_COUNTS, np.int64))
    return Traced(
        N,
        _importons([part for parts, _, _ in results for part in parts]),
        _importons([part for _, parts, _ in results for part in parts]),
        int(total[C_RAYS]),
        int(total[C_DROPPED]),
    )


def _importons(parts: list[NDArray[np.float32]]) -> Importons:
    rows = np.concatenate(parts) if parts else np.empty((0, IMPORTON_COLUMNS), np.float32)
    return Importons(
        np.ascontiguousarray(rows[:, :3]),
        np.ascontiguousarray(rows[:, 3]).view(np.uint32),
        np.ascontiguousarray(rows[:, 4]),
        np.ascontiguousarray(rows[:, 5]),
    )


def joined(parts: list[Traced], pixels: int) -> tuple[Importons, Importons]:
    """Caustic and global importons of all parts together, with weights Ψ in pixels, of which they stand for so many."""
    unit = np.float32(pixels / max(sum(part.N for part in parts), 1))

    def of(importons: list[Importons]) -> Importons:
        whole = Importons.joined(importons)
        return Importons(whole.positions, whole.normals, whole.weights * unit, whole.footprints)

    return of([part.caustic for part in parts]), of([part.global_ for part in parts])
