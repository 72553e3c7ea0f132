"""One light pass: planned, its photons traced in batches over the threads, and joined in batch order into the caustic
and the global map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.photons.deposition.fates import Fates
from pmviewer.photons.deposition.rules import Deposition
from pmviewer.photons.emission.guided import Guidance, Guided, Known, guided_emission
from pmviewer.photons.emission.scattered import scattered_record
from pmviewer.photons.emission.tested import TraceBatch
from pmviewer.photons.light_pass.batch import (
    BATCH,
    GLOBAL_NORMALS,
    NO_NORMALS,
    NORMALS,
    TASK,
    Batch,
    Codes,
    Float,
    Numbered,
    Task,
    bounded,
    joined,
    joined_batches,
    joined_codes,
    trace_batch,
)
from pmviewer.photons.light_pass.deposit import deposit
from pmviewer.photons.light_pass.ledger import C_DROPPED, C_PIECES, C_RAYS
from pmviewer.photons.light_pass.parts import cuts_of
from pmviewer.photons.light_pass.paths import PhotonPaths
from pmviewer.photons.light_pass.photon_maps import PhotonMaps
from pmviewer.photons.light_pass.plan import PassPlan, pass_record, plan_pass
from pmviewer.photons.projection.projection import Projection
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Photons
from pmviewer.tasks import Runner, in_turn


def trace_pass(
    scene: FlatScene,
    settings: Photons,
    seed: int,
    first_index: int,
    N: int,
    has_specular: bool,
    run: Runner,
    with_normals: bool = False,
    projection: Projection | None = None,
    deposition: Deposition | None = None,
    guided: Guided | None = None,
    watch: PhotonPaths | Fates | None = None,
) -> PhotonMaps:
    """Trace one pass of N trajectories; `pmviewer.photons.light_pass.plan.plan_pass` says which these are, with
    projection maps or with guided emission.

    With `deposition` its rules decide about storing; the maps then hold the path classes that it names alone.

    With `watch` only the first trajectories: paths are written there; or photons are kept there with what the rules of
    `deposition` made of them, of whole batches.
    """
    plan = plan_pass(scene, settings, seed, first_index, N, has_specular, projection, guided)
    paths = watch if isinstance(watch, PhotonPaths) else None
    last = plan.traced if paths is None else min(plan.traced, paths.n)
    normals = NORMALS if deposition is not None else GLOBAL_NORMALS if with_normals else NO_NORMALS
    each = TASK if deposition is None else BATCH
    batches = _batches(scene, plan, last, each, normals, paths)
    if deposition is not None:
        fates = watch if isinstance(watch, Fates) else None
        maps = deposit(plan, deposition, batches, last, first_index, run, fates)
    else:
        results = bounded([task for _, task in batches], each * plan.most_stored, run)
        maps = _joined(plan, results, last, run)
    return maps if guided is None else _with_tests(maps, guided)


def _batches(
    scene: FlatScene, plan: PassPlan, last: int, each: int, normals: int, paths: PhotonPaths | None
) -> list[Numbered]:
    """The batches of the first `last` trajectories, `each` of that many, test photons that are stored among them."""

    def batch(i0: int) -> Task:
        i1 = min(i0 + each, last)
        return lambda: trace_batch(scene, plan.record, plan.emission, i0, i1, normals, paths)

    batches = [(i0, batch(i0)) for i0 in range(0, last, each)]
    if plan.guided is None or paths is not None:
        return batches
    return _mixed(batches, [(last + j, task) for j, task in enumerate(plan.guided.kept)])


def _mixed(traced: list[Numbered], kept: list[Numbered]) -> list[Numbered]:
    """Both in one order in which each is spread evenly, so that the first batches tell about all."""
    places = [
        ((j + 0.5) / len(part), which, task) for which, part in enumerate((traced, kept)) for j, task in enumerate(part)
    ]
    return [task for _, _, task in sorted(places, key=lambda place: place[:2])]


def joined_parts(plan: PassPlan, parts: Sequence[Batch]) -> PhotonMaps:
    """The maps of a planned pass from all of its parts, in order, wherever they were traced
    (`pmviewer.photons.light_pass.parts.trace_part`)."""
    return replace(_joined(plan, parts, plan.traced, in_turn), cuts=cuts_of(parts))


def _joined(plan: PassPlan, results: Sequence[Batch], last: int, run: Runner) -> PhotonMaps:
    """The maps of a pass that stores all that arrives, of its first `last` trajectories."""
    whole = joined_batches(results, run)
    return PhotonMaps(
        caustic=whole.caustic,
        global_=whole.global_,
        caustic_unit=plan.caustic_unit(plan.traced),
        global_unit=plan.global_unit,
        emitted=last,
        rays=int(whole.counts[C_RAYS]),
        pieces=int(whole.counts[C_PIECES]),
        dropped=int(whole.counts[C_DROPPED]),
        ledgers=whole.ledgers,
        energy=plan.energy(whole.ledgers),
        normals=whole.global_normals,
        volume=whole.volume,
        volume_unit=plan.global_unit * plan.store_probability,
    )


def _with_tests(maps: PhotonMaps, guided: Guided) -> PhotonMaps:
    """Test photons count as traced; those that are stored are in the maps, and needed no more."""
    return replace(
        maps,
        emitted=maps.emitted + guided.tested,
        rays=maps.rays + guided.rays,
        dropped=maps.dropped + guided.dropped,
        guided=replace(guided, kept=[]),
    )


def guided_emission_of(
    scene: FlatScene,
    settings: Photons,
    seed: int,
    first_index: int,
    N: int,
    has_specular: bool,
    guidance: Guidance,
    run: Runner,
    before: Known | None = None,
) -> Guided | None:
    """The guided emission of a pass of N trajectories for `trace_pass`, with what is known `before` from earlier
    passes; None where they are too few to test the lights."""
    trace = testing(scene, settings, first_index, has_specular)
    return guided_emission(scene, guidance, seed, N, BATCH, trace, run, before)


def testing(scene: FlatScene, settings: Photons, first_index: int, has_specular: bool) -> TraceBatch:
    """Traces batches of test photons for `pmviewer.photons.emission.tested`."""

    def trace(table: NDArray[np.void], seed: int, i0: int, i1: int, n: int) -> Batch:
        record = pass_record(settings, seed, first_index, n, has_specular, scene.has_media)
        record["store_probability"], record["unfound"] = settings.q, scene.delta_lights and has_specular
        return trace_batch(scene, record, table, i0, i1, NORMALS)

    return trace


def scattered_photons(
    scene: FlatScene, settings: Photons, seed: int, places: Float, run: Runner
) -> tuple[Float, Codes]:
    """Where importons arrive that are scattered on once from each of places (n, 7), see
    `pmviewer.photons.emission.scattered`: as photons (m, 6) whose power is their importance, with normals (m,)."""
    emission, n = scattered_record(places), len(places)
    record = pass_record(settings, seed, 0, n, False, scene.has_media)

    def batch(i0: int) -> Callable[[], Batch]:
        return lambda: trace_batch(scene, record, emission, i0, min(i0 + BATCH, n), GLOBAL_NORMALS)

    results = run([batch(i0) for i0 in range(0, n, BATCH)])
    return joined(r.global_ for r in results), joined_codes(r.global_normals for r in results)
