"""Reprojection of known hit points within the estimation of a pass (R8; course guide §6.3.3).

What gathers of the pass have shot is kept until the next one: `KnownHits`. In each round of
`pmviewer.engine.stages.estimation` the corners that have to gather do so in two steps: those near which too little is
known gather in full, some of them first, so that the others find them; the rest takes what the full gathers around it
know. Full gathers of a step then take what those around them have found (`pmviewer.render.gather.pooling`). A share of
the corners that grows with the pass gathers in full whatever is known, and the cover that hits must have of a cell
tends to all of it, as fast as radii shrink, so that in the limit nothing is reprojected. Every step depends on the
steps before alone, and nothing on threads.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.pool import WorkPool
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.gather.estimation import ESTIMATE, SAMPLE, TOLD
from pmviewer.render.gather.pooling import pool_gathers
from pmviewer.render.gather.reprojection import FULL, NOT_GATHERED, PARTIAL, SOURCES, gather_reprojected, sources_of
from pmviewer.render.gather.zbuffer import HIT
from pmviewer.render.given import PassData
from pmviewer.settings.schema import Gather

FEWEST = 2
"""Sources without which a corner gathers in full: one alone hides what only others see."""
BATCH_HITS = 16384
"""Directions a task."""


Hits = tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]
"""`begin`, `count` and `hits` of `KnownHits`."""


def rule_of(gather: Gather, shrink: float) -> tuple[np.float32, np.int64]:
    """The cover that cells must have in a pass by which radii have shrunk so far, and the parts that they have."""
    return np.float32(1.0 - (1.0 - gather.reprojection_cover) * shrink), np.int64(gather.reprojection_parts)


def no_hits() -> Hits:
    """Nothing is known of a single pixel."""
    return np.zeros(1, np.int64), np.zeros(1, np.int32), np.zeros((1, HIT), np.float32)


class KnownHits:
    """What the full gathers of a pass have found, and which pixel gathered how: `how` uint8 (h, w) of NOT_GATHERED,
    PARTIAL, FULL; `begin` int64 and `count` int32 (pixels,) of their rows in `hits`, float32 (m, HIT); `shot`: rays of
    all gathers."""

    def __init__(self, given: PassData, samples: NDArray[np.float32], gather: Gather, spacing: int, shrink: float):
        eye, record = given.eye[0], given.cache[0]
        self.height, self.width = int(eye["height"]), int(eye["width"])
        self.samples, self.reach = samples, spacing
        self.cells = int(record["rings"]) * int(record["sectors"])
        self.rule = rule_of(gather, shrink)
        self.how = np.zeros((self.height, self.width), np.uint8)
        self.begin = np.zeros(self.height * self.width, np.int64)
        self.count = np.zeros(self.height * self.width, np.int32)
        self.hits = np.zeros((0, HIT), np.float32)
        self.shot = 0
        chance = np.random.default_rng([int(eye["seed"]), int(eye["index"]), 2])
        self.anew = chance.random(self.height * self.width) >= shrink
        """Pixels that gather in full whatever is known."""

    @property
    def counts(self) -> dict[str, int]:
        """Gathers in full (`full`) and those that reprojected directions (`partial`), and how many directions both
        have shot (`shot`)."""
        full, some = int((self.how == FULL).sum()), int((self.how == PARTIAL).sum())
        return {"full": full, "partial": some, "shot": self.shot}

    def gather(
        self,
        given: PassData,
        corners: NDArray[np.int32],
        estimates: NDArray[np.float32],
        told: NDArray[np.float32],
        pool: WorkPool,
    ) -> NDArray[np.int64]:
        """Gathers at pixels `corners`, into estimates and told as `gather_samples` does; the counts of its kernels."""
        counts = np.zeros(N_COUNTS, np.int64)
        for chosen, sources in self._steps(corners, pool):
            counts += self._gather(given, chosen, sources, estimates, told, pool)
            self._pool(given, chosen, estimates, told, pool)
        return counts

    def sources(self, pixels: NDArray[np.int32], pool: WorkPool) -> NDArray[np.int32]:
        """The full gathers around pixels, (n, SOURCES); all −1 where they are too few."""
        found = np.empty((len(pixels), SOURCES), np.int32)
        batch = 1024
        run = [
            partial(sources_of, pixels[a : a + batch], self.samples, self.how, self.reach, found[a : a + batch])
            for a in range(0, len(pixels), batch)
        ]
        pool.run(run)
        found[(found >= 0).sum(axis=1) < FEWEST] = -1
        return found

    def _steps(self, corners: NDArray[np.int32], pool: WorkPool) -> Any:
        """Which corners gather, step by step, and from what."""
        alone = (self.sources(corners, pool) < 0).all(axis=1)
        first = self.anew[corners] | (alone & self._spread(corners))
        chosen, rest = corners[first], corners[~first]
        yield chosen, np.full((len(chosen), SOURCES), -1, np.int32)
        yield rest, self.sources(rest, pool)

    def _spread(self, corners: NDArray[np.int32]) -> NDArray[np.bool_]:
        """The first of the corners in each square of half a tile of the undivided grid."""
        side = max(self.reach // 2, 1)
        square = corners // self.width // side * self.width + corners % self.width // side
        chosen = np.zeros(len(corners), bool)
        chosen[np.unique(square, return_index=True)[1]] = True
        return chosen

    def _gather(
        self,
        given: PassData,
        pixels: NDArray[np.int32],
        sources: NDArray[np.int32],
        estimates: NDArray[np.float32],
        told: NDArray[np.float32],
        pool: WorkPool,
    ) -> NDArray[np.int64]:
        batch = max(1, BATCH_HITS // self.cells)
        known = self.begin, self.count, self.hits
        full: NDArray[np.bool_] = np.all(sources < 0, axis=1)

        def task(first: int) -> Any:
            def run() -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float32]]:
                span = first, min(first + batch, len(pixels))
                counts, made = np.zeros(N_COUNTS, np.int64), np.zeros(span[1] - span[0], np.int32)
                found = np.empty((len(made) * self.cells, HIT), np.float32)
                gather_reprojected(
                    given, pixels, sources, self.samples, known, self.rule, estimates, told, found, made, counts, span
                )
                kept = np.repeat(full[slice(*span)], made)  # no one asks for the others' hits
                return counts, made, found[: made.sum()][kept]

            return run

        parts = pool.run([task(first) for first in range(0, len(pixels), batch)])
        if not parts:
            return np.zeros(N_COUNTS, np.int64)
        counts, made, found = zip(*parts, strict=True)
        shot = np.concatenate(made)
        self.shot += int(shot.sum())
        self.count[pixels] = np.where(full, shot, 0)
        self.begin[pixels] = len(self.hits) + np.cumsum(self.count[pixels]) - self.count[pixels]
        self.hits = np.concatenate([self.hits, *found])
        good = estimates[pixels, 3] > 0
        how = self.how.reshape(-1)
        how[pixels[good & full]], how[pixels[good & ~full]] = FULL, PARTIAL
        return np.asarray(sum(counts))

    def _pool(
        self,
        given: PassData,
        pixels: NDArray[np.int32],
        estimates: NDArray[np.float32],
        told: NDArray[np.float32],
        pool: WorkPool,
    ) -> None:
        """Full gathers among `pixels` take what others around them have found."""
        full = pixels[(self.how.reshape(-1)[pixels] == FULL) & ~self.anew[pixels]]
        others = self.sources(full, pool)
        near = (others >= 0).any(axis=1)
        full, sources = full[near], np.column_stack([full, others])[near]
        known, batch = (self.begin, self.count, self.hits), max(1, BATCH_HITS // self.cells)
        pooled = partial(pool_gathers, given, full, sources, self.samples, known, self.rule, estimates, told)
        pool.run([partial(pooled, first, min(first + batch, len(full))) for first in range(0, len(full), batch)])


def prepare_reprojection(given: PassData) -> None:
    """Call every kernel of this stage once, on nothing. given: as for the eye pass, with a record of estimates."""
    nobody, how = np.empty(0, np.int32), np.full((1, 1), NOT_GATHERED, np.uint8)
    samples, plane, told, hits = (np.zeros((1, columns), np.float32) for columns in (SAMPLE, ESTIMATE, TOLD, HIT))
    sources = np.empty((0, SOURCES), np.int32)
    sources_of(nobody, samples, how, 1, sources)
    rule, counts = rule_of(Gather(), 1.0), np.zeros(N_COUNTS, np.int64)
    made = np.empty(0, np.int32)
    gather_reprojected(given, nobody, sources, samples, no_hits(), rule, plane, told, hits, made, counts, (0, 0))
    pool_gathers(given, nobody, np.empty((0, SOURCES + 1), np.int32), samples, no_hits(), rule, plane, told, 0, 0)
