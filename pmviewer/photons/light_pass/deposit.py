"""The maps of a pass by deposition rules, from its batches, round by round where rounds matter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.convergence import Converged, other_light
from pmviewer.maps.record import in_classes
from pmviewer.maps.search.kdtree import PhotonKdTree
from pmviewer.photons.deposition.depositor import Depositor, Judged
from pmviewer.photons.deposition.fates import Fates
from pmviewer.photons.deposition.rules import Deposition, rounds
from pmviewer.photons.light_pass.batch import BATCH, Codes, Float, Numbered, joined
from pmviewer.photons.light_pass.ledger import C_DROPPED, C_PIECES, C_RAYS, N_COUNTS, empty_ledger
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.photons.light_pass.plan import PassPlan
from pmviewer.tasks import Runner

SAMPLED = 64 * BATCH
"""Trajectories whose photons are also kept as they arrive, where a deposition rule asks for a sample."""


@dataclass(frozen=True, eq=False)
class JudgedBatch:
    """A batch as the rules of both maps judge it, its photons that go into the sample and those in media, its counts
    and ledgers."""

    caustic: Judged
    global_: Judged
    sample: Float
    volume: Float
    counts: NDArray[np.int64]
    ledgers: NDArray[np.float64]


def deposit(
    plan: PassPlan,
    deposition: Deposition,
    numbered: list[Numbered],
    last: int,
    first_index: int,
    run: Runner,
    fates: Fates | None = None,
) -> PhotonMaps:
    """The pass's maps, from batches of its first `last` trajectories. Where the caustic map has converged before them
    by the rules' criterion the pass ends, unless the global map needs them."""
    depositors = Depositor(deposition.caustic), Depositor(deposition.global_)
    if fates is not None:
        depositors = fates.depositors(deposition)
        numbered = numbered[: -(-fates.trajectories // BATCH)]
    caustic, global_ = depositors
    convergence = _Convergence(plan, deposition, last)
    sampled: list[Float] = []
    volume: list[Float] = []
    counts, ledgers = np.zeros(N_COUNTS, np.int64), empty_ledger()

    def judge(place: int) -> Callable[[], JudgedBatch]:
        return lambda: _judged(deposition, numbered[place], place, first_index, caustic, global_)

    for some in rounds(len(numbered)) if deposition.in_rounds else [range(len(numbered))]:
        results = run([judge(place) for place in some])
        caustic.take([r.caustic for r in results], run)
        global_.take([r.global_ for r in results], run)
        sampled += [r.sample for r in results]
        volume += [r.volume for r in results]
        counts += sum((r.counts for r in results), np.zeros(N_COUNTS, np.int64))
        ledgers += sum((r.ledgers for r in results), empty_ledger())
        if convergence.ends_pass(min(some.stop * BATCH, last), caustic, sampled, run):
            last = min(some.stop * BATCH, last)
            break
    in_caustic, in_global = run(
        [lambda: caustic.finish(plan.caustic_unit(last)), lambda: global_.finish(plan.global_unit)]
    )
    sample_unit = plan.global_unit * plan.global_photons / max(min(plan.global_photons, SAMPLED, last), 1)
    return PhotonMaps(
        caustic=in_caustic[0],
        global_=in_global[0],
        caustic_unit=in_caustic[2],
        global_unit=in_global[2],
        emitted=last,
        rays=int(counts[C_RAYS]),
        pieces=int(counts[C_PIECES]),
        dropped=int(counts[C_DROPPED]),
        ledgers=ledgers,
        energy=plan.energy(ledgers),
        normals=in_global[1],
        caustic_normals=in_caustic[1],
        sample=joined(sampled),
        sample_unit=sample_unit,
        volume=joined(volume),
        volume_unit=plan.global_unit * plan.store_probability,
        deposited={"caustic": replace(in_caustic[3], converged=convergence.latest), "global": in_global[3]},
    )


def _judged(
    deposition: Deposition,
    numbered: Numbered,
    place: int,
    first_index: int,
    caustic: Depositor,
    global_: Depositor,
) -> JudgedBatch:
    """A batch, which is number `place` of the pass, traced and judged."""
    i0, task = numbered
    batch = task()
    sample = batch.global_[:0]
    if deposition.sample_classes and place * BATCH < SAMPLED:
        wanted = in_classes(batch.global_, deposition.sample_classes)
        sample = batch.global_ if wanted is None else batch.global_[wanted]
    of_caustic = _chosen(batch.caustic, batch.caustic_normals, deposition.caustic_classes)
    of_global = _chosen(batch.global_, batch.global_normals, deposition.global_classes)
    index = first_index + i0
    return JudgedBatch(
        caustic.judge(*of_caustic, index),
        global_.judge(*of_global, index),
        sample,
        batch.volume,
        batch.counts,
        batch.ledgers,
    )


def _chosen(photons: Float, normals: Codes, mask: int) -> tuple[Float, Codes]:
    """Photons of the path classes in the mask, with their normals."""
    wanted = in_classes(photons, mask)
    return (photons, normals) if wanted is None else (photons[wanted], normals[wanted])


class _Convergence:
    """Whether the caustic map needs no more photons, asked after each round; `latest` is the answer, None before the
    first."""

    def __init__(self, plan: PassPlan, deposition: Deposition, last: int) -> None:
        self.plan, self.criterion, self.last = plan, deposition.criterion, last
        # Those for the caustic map alone can be left out where all photons of that map have one weight.
        alike = not plan.projected or not plan.record[0]["indirect_caustics"]
        spare = self.criterion is not None and plan.guided is None and alike
        self.must = min(last if not spare else plan.filling if deposition.global_classes or plan.media else 0, last)
        """Trajectories that are traced in any case."""
        self.latest: Converged | None = None
        self._others: PhotonKdTree | None = None
        self._sampled_of = 0

    def ends_pass(self, traced: int, caustic: Depositor, sampled: list[Float], run: Runner) -> bool:
        """Whether the pass ends after so many trajectories, with others left; sampled: the sample's parts so far."""
        if self.criterion is None or traced < self.must:
            return False
        plan, sampled_of = self.plan, min(self.plan.global_photons, SAMPLED)
        if self._others is None or self._sampled_of < sampled_of:
            self._sampled_of = min(sampled_of, traced)
            unit = plan.global_unit * plan.global_photons / self._sampled_of
            self._others = other_light(self.criterion, joined(sampled), unit)
        self.latest = caustic.converged(self.criterion, self._others, plan.caustic_unit(traced), run)
        if not (self.latest.done and traced < self.last):
            return False
        self.latest = replace(self.latest, spared=self.last - traced)
        return True
