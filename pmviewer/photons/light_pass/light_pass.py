"""One light pass: batches of photons over the threads, joined in batch order into the caustic and the global map."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SettingError
from pmviewer.kernels.random import INDEPENDENT, SOBOL
from pmviewer.maps.convergence import other_light
from pmviewer.maps.record import in_classes
from pmviewer.photons.deposition.fates import Fates
from pmviewer.photons.deposition.rules import Deposited, Deposition, Filling, Prepared, rounds
from pmviewer.photons.emission.guided import Guidance, Guided, Known, guided_emission
from pmviewer.photons.emission.scattered import scattered_record
from pmviewer.photons.emission.tested import TraceBatch
from pmviewer.photons.light_pass.paths import PhotonPaths
from pmviewer.photons.light_pass.roulette import EQUAL, MOST_COPIES, RULES
from pmviewer.photons.light_pass.trace import (
    C_CAUSTIC,
    C_DROPPED,
    C_GLOBAL,
    C_RAYS,
    E_ABSORBED,
    E_DROPPED,
    E_EMITTED,
    E_ESCAPED,
    E_TERMINATED,
    LIGHT_PASS_DTYPE,
    N_COUNTS,
    empty_ledger,
    trace_photons,
)
from pmviewer.photons.projection.projected import NO_PROJECTION
from pmviewer.photons.projection.projection import Projection
from pmviewer.resources import available_memory
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.settings.access import Photons

Float = NDArray[np.float32]
Runner = Callable[[list[Callable[[], Any]]], list[Any]]
"""Runs the given functions, on any number of threads, and returns their results in order."""

BATCH = 8192
"""Photons a task: fixed, so that the result does not depend on the number of threads."""
LARGEST_SCALE = 2.0**12
"""Most that indirect caustics count, in units of the caustic map: powers of stored photons end at 2¹⁷."""
SAMPLED = 64 * BATCH
"""Trajectories whose photons are also kept as they arrive, where a deposition rule asks for a sample."""


@dataclass(frozen=True)
class PhotonMaps:
    """Photons of one pass: `caustic` and `global_` (n, 6) float32 as in `pmviewer.maps.record`, with their units of
    power in watts, `normals` (n,) uint32 of the surfaces that the global photons lie on, on the side that they came
    from, as codes of `encode_direction` (empty unless asked for), `emitted` trajectories, `rays` cast, `dropped`
    non-finite photons, the energy ledgers `books` (2, N_LEDGER), see `pmviewer.photons.light_pass.trace`, and what they
    say of the light: `energy` (5,), watts of luminance that the lights emit and that are absorbed, escape, are still on
    their way after the last scattering allowed, and were dropped.

    With a deposition rule, `caustic_normals` are those of the caustic photons, `sample` (n, 6) are photons of the first
    trajectories as they arrived, a map by themselves in units of `sample_unit`, for whoever counts photons, and
    `deposited` says what became of each map's."""

    caustic: Float
    global_: Float
    caustic_unit: float
    global_unit: float
    emitted: int
    rays: int
    dropped: int
    books: NDArray[np.float64]
    energy: NDArray[np.float64]
    normals: NDArray[np.uint32]
    caustic_normals: NDArray[np.uint32] = field(default_factory=lambda: np.empty(0, np.uint32))
    sample: Float = field(default_factory=lambda: np.empty((0, 6), np.float32))
    sample_unit: float = 0.0
    deposited: Mapping[str, Deposited] = field(default_factory=dict)
    guided: Guided | None = None
    """The emission, where it is guided; the books then leave out its test photons."""

    @property
    def ledger(self) -> NDArray[np.float64]:
        """The books of all trajectories (N_LEDGER,)."""
        return np.asarray(self.books.sum(axis=0))

    @property
    def bytes(self) -> int:
        arrays = self.caustic, self.global_, self.normals, self.caustic_normals, self.sample
        return sum(array.nbytes for array in arrays)


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
    projection: Projection | None = None,
    paths: PhotonPaths | None = None,
    deposition: Deposition | None = None,
    guided: Guided | None = None,
    fates: Fates | None = None,
) -> PhotonMaps:
    """Trace one pass of N trajectories; with `paths` only the first ones, whose paths are written there; with
    `deposition` and `fates` only the first batches, whose photons are kept there with what the rules made of them.

    Photon powers are the same for all trajectories of a map: Φ/N in the caustic map, Φ/⌊qN⌋ in the global one
    (trajectory split) or Φ/(qN) (photon rule), Keller and Wald 2000, §2.4.

    With projection maps the first ⌊qN⌋ trajectories start where they can meet surfaces, with power W₁ in all, and
    the others where they can meet what makes caustics, with W₂. A light's path L S⁺ D is found by a = ⌊qN⌋/W₁
    trajectories a watt of the first kind and b = (N − ⌊qN⌋)/W₂ of the second, so that each of its photons has the
    power 1/(a + b). The second kind ends there: caustics after a diffuse bounce may come from anywhere, they are the
    first kind's, with 1/a.

    With `deposition` its rules decide about storing; the maps then hold the path classes that it names alone.

    With `guided` emission, which takes no projection, its n trajectories are traced after its test photons, and all of
    them fill both maps: q is the probability of storing a global photon whatever its rule.
    """
    traced, filling, probability = trajectories(settings, N, has_specular)
    unit = scene.total_luminance
    if guided is not None:
        traced = filling = guided.n
        probability = settings.q
    projections, surface_power, caustic_power = NO_PROJECTION, unit, unit
    if projection is not None:
        projections = projection.records
        surface_power, caustic_power = projection.surface_power, projection.caustic_power
        if not caustic_power > 0:  # no light reaches what makes caustics
            traced = filling
    if guided is not None:
        projections = guided.table.records
    density = filling / surface_power
    direct_density = density
    if traced > filling:
        direct_density += (traced - filling) / caustic_power
    only_direct = projection is not None or not settings.indirect_caustics
    indirect_scale = direct_density / density if projection is not None else 1.0
    direct_scale = min(1.0, LARGEST_SCALE / indirect_scale)
    scales = indirect_scale * direct_scale, direct_scale
    unfound = scene.delta_lights and has_specular
    record = _record(settings, seed, first_index, filling, probability, has_specular, only_direct, scales, unfound)

    last = traced if paths is None else min(traced, paths.n)
    normals = NORMALS if deposition is not None else GLOBAL_NORMALS if with_normals else NO_NORMALS

    def batch(i0: int) -> Callable[[], _Batch]:
        return lambda: _trace_batch(
            scene, record, projections, i0, min(i0 + BATCH, last), filling, has_specular, normals, paths
        )

    def caustic_unit(n: int) -> float:
        """That of the caustic map when the first n trajectories are traced, of those that make caustics."""
        if guided is not None:
            return unit / guided.N
        if projection is None:
            return unit / n
        first = min(n, filling)
        found = first / surface_power + ((n - first) / caustic_power if n > first else 0.0)
        return 1.0 / (found * direct_scale)

    def energy(books: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the books of trajectories that fill the global map say of the scene's light: they start where they can
        meet something, so that what no trajectory starts with has escaped."""
        entries = books[0, [E_EMITTED, E_ABSORBED, E_ESCAPED, E_TERMINATED, E_DROPPED]]
        if guided is not None:
            return np.asarray(entries * (unit / guided.N))
        watts = entries * (surface_power / max(entries[0], 1.0))
        return np.asarray(watts + (unit - surface_power) * np.array([1.0, 0.0, 1.0, 0.0, 0.0]))

    batches = [(i0, batch(i0)) for i0 in range(0, last, BATCH)]
    if guided is not None:
        global_unit = unit / (guided.N * probability)
        kept = [(last + j, task) for j, task in enumerate(guided.kept)] if paths is None else []
        batches = _mixed(batches, kept)
    else:
        global_unit = surface_power / (filling * probability)
    if deposition is not None:
        N = filling if guided is None else guided.N
        if fates is not None:
            batches = batches[: -(-fates.trajectories // BATCH)]
        # Those for the caustic map alone can be left out where all photons of that map have one weight.
        alike = projection is None or not settings.indirect_caustics
        spare = deposition.criterion is not None and guided is None and alike
        must = last if not spare else filling if deposition.global_classes else 0
        many = last, must
        made = _deposited(deposition, batches, many, first_index, run, caustic_unit, global_unit, N, energy, fates)
        return made if guided is None else _with_tests(made, guided)
    most = settings.max_bounces * (MOST_COPIES if settings.roulette == "equal" else 1)
    results = _bounded([task for _, task in batches], BATCH * most, run)
    counts = sum((r[2] for r in results), np.zeros(N_COUNTS, np.int64))
    made = PhotonMaps(
        caustic=_join([part for r in results for part in r[0]]),
        global_=_join([part for r in results for part in r[1]]),
        caustic_unit=caustic_unit(traced),
        global_unit=global_unit,
        emitted=last,
        rays=int(counts[C_RAYS]),
        dropped=int(counts[C_DROPPED]),
        books=(books := sum((r[3] for r in results), empty_ledger())),
        energy=energy(books),
        normals=_joined([part for r in results for part in r[4]]),
    )
    return made if guided is None else _with_tests(made, guided)


def guided_emission_of(
    scene: FlatScene,
    settings: Photons,
    seed: int,
    first_index: int,
    N: int,
    has_specular: bool,
    how: Guidance,
    run: Runner,
    before: Known | None = None,
) -> Guided | None:
    """The guided emission of a pass of N trajectories for `trace_pass`, with what is known `before` from earlier
    passes; None where they are too few to test the lights."""

    trace = testing(scene, settings, first_index, has_specular)
    return guided_emission(scene, how, seed, N, BATCH, trace, run, before)


def testing(scene: FlatScene, settings: Photons, first_index: int, has_specular: bool) -> TraceBatch:
    """Traces batches of test photons for `pmviewer.photons.emission.tested`."""

    def trace(table: NDArray[np.void], seed: int, i0: int, i1: int, n: int) -> Any:
        unfound = scene.delta_lights and has_specular
        record = _record(settings, seed, first_index, n, settings.q, has_specular, False, (1.0, 1.0), unfound)
        caustics, globals_, counts, ledger, *normals = _trace_batch(
            scene, record, table, i0, i1, n, has_specular, NORMALS, None
        )
        return _join(caustics), _join(globals_), counts, ledger, *(_joined(part) for part in normals)

    return trace


def scattered_photons(
    scene: FlatScene, settings: Photons, seed: int, places: Float, run: Runner
) -> tuple[Float, Codes]:
    """Where importons arrive that are scattered on once from each of places (n, 7), see
    `pmviewer.photons.emission.scattered`: as photons (m, 6) whose power is what they count, with their normals (m,)."""
    records, n = scattered_record(places), len(places)
    record = _record(settings, seed, 0, n, 1.0, False, False, (1.0, 1.0))

    def batch(i0: int) -> Callable[[], _Batch]:
        return lambda: _trace_batch(scene, record, records, i0, min(i0 + BATCH, n), n, False, GLOBAL_NORMALS, None)

    results = run([batch(i0) for i0 in range(0, n, BATCH)])
    return _join([part for r in results for part in r[1]]), _joined([part for r in results for part in r[4]])


def _record(
    settings: Photons,
    seed: int,
    first_index: int,
    filling: int,
    probability: float,
    has_specular: bool,
    only_direct: bool,
    scales: tuple[float, float],
    unfound: bool = False,
) -> NDArray[np.void]:
    record = np.zeros(1, LIGHT_PASS_DTYPE)
    record[0] = (
        seed & 0xFFFFFFFF,
        first_index,
        SOBOL if settings.sequence == "sobol" else INDEPENDENT,
        settings.max_bounces,
        RULES.index(settings.roulette),
        settings.glossy,
        filling,
        probability,
        has_specular,
        settings.indirect_caustics,
        only_direct,
        *scales,
        unfound,
    )
    return record


def _mixed(traced: list[Numbered], kept: list[Numbered]) -> list[Numbered]:
    """Both in one order in which each is spread evenly, so that the first batches tell about all."""
    places = [
        ((j + 0.5) / len(part), which, task) for which, part in enumerate((traced, kept)) for j, task in enumerate(part)
    ]
    return [task for _, _, task in sorted(places, key=lambda place: place[:2])]


def _with_tests(made: PhotonMaps, guided: Guided) -> PhotonMaps:
    """Test photons count as traced; those that are stored are in the maps, and needed no more."""
    return replace(
        made,
        emitted=made.emitted + guided.tested,
        rays=made.rays + guided.rays,
        dropped=made.dropped + guided.dropped,
        guided=replace(guided, kept=[]),
    )


def _deposited(
    deposition: Deposition,
    numbered: list[Numbered],
    trajectories: tuple[int, int],
    first_index: int,
    run: Runner,
    caustic_unit: Callable[[int], float],
    global_unit: float,
    filling: int,
    energy: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    fates: Fates | None = None,
) -> PhotonMaps:
    """The pass's maps by the rules of `deposition`, from its batches, round by round where rounds matter.

    trajectories: how many there are, and how many must be traced even if the caustic map has converged before; beyond,
    the pass ends when it has. caustic_unit: by the number of trajectories traced.
    """
    last, must = trajectories
    criterion, others, sampled_of, converged = deposition.criterion, None, 0, None
    caustic, global_ = Filling(deposition.caustic), Filling(deposition.global_)
    if fates is not None:
        caustic, global_ = fates.fillings(deposition)
    sampled: list[Float] = []
    counts, books = np.zeros(N_COUNTS, np.int64), empty_ledger()

    def judged(place: int) -> Callable[[], tuple[Prepared, Prepared, Float, NDArray[np.int64], NDArray[np.float64]]]:
        def task() -> tuple[Prepared, Prepared, Float, NDArray[np.int64], NDArray[np.float64]]:
            i0, batch = numbered[place]
            caustics, globals_, counts, ledger, global_normals, caustic_normals = batch()
            photons, normals = _join(globals_), _joined(global_normals)
            sample = photons[:0]
            if deposition.sample_classes and place * BATCH < SAMPLED:
                wanted = in_classes(photons, deposition.sample_classes)
                sample = photons if wanted is None else photons[wanted]
            of_caustic = _chosen(_join(caustics), _joined(caustic_normals), deposition.caustic_classes)
            of_global = _chosen(photons, normals, deposition.global_classes)
            index = first_index + i0
            return caustic.judge(*of_caustic, index), global_.judge(*of_global, index), sample, counts, ledger

        return task

    for some in rounds(len(numbered)) if deposition.in_rounds else [range(len(numbered))]:
        results = run([judged(place) for place in some])
        caustic.take([r[0] for r in results], run)
        global_.take([r[1] for r in results], run)
        sampled += [r[2] for r in results]
        counts += sum((r[3] for r in results), np.zeros(N_COUNTS, np.int64))
        books += sum((r[4] for r in results), empty_ledger())
        traced = min(some.stop * BATCH, last)
        if criterion is None or traced < min(must, last):
            continue
        if others is None or sampled_of < min(filling, SAMPLED):
            sampled_of = min(filling, SAMPLED, traced)
            others = other_light(criterion, _join(sampled), global_unit * filling / sampled_of)
        converged = caustic.converged(criterion, others, caustic_unit(traced), run)
        if converged.done and traced < last:
            converged = replace(converged, spared=last - traced)
            last = traced
            break
    in_caustic, in_global = run([lambda: caustic.finish(caustic_unit(last)), lambda: global_.finish(global_unit)])
    return PhotonMaps(
        caustic=in_caustic[0],
        global_=in_global[0],
        caustic_unit=in_caustic[2],
        global_unit=in_global[2],
        emitted=last,
        rays=int(counts[C_RAYS]),
        dropped=int(counts[C_DROPPED]),
        books=books,
        energy=energy(books),
        normals=in_global[1],
        caustic_normals=in_caustic[1],
        sample=_join(sampled),
        sample_unit=global_unit * filling / max(min(filling, SAMPLED, last), 1),
        deposited={"caustic": replace(in_caustic[3], converged=converged), "global": in_global[3]},
    )


def _chosen(photons: Float, normals: Codes, mask: int) -> tuple[Float, Codes]:
    """Photons of the path classes in the mask, with their normals."""
    wanted = in_classes(photons, mask)
    return (photons, normals) if wanted is None else (photons[wanted], normals[wanted])


NO_NORMALS, GLOBAL_NORMALS, NORMALS = range(3)

Codes = NDArray[np.uint32]
_Batch = tuple[list[Float], list[Float], NDArray[np.int64], NDArray[np.float64], list[Codes], list[Codes]]
Numbered = tuple[int, Callable[[], _Batch]]
"""A batch with a number that no other batch has in any pass."""


def _trace_batch(
    scene: FlatScene,
    record: NDArray[np.void],
    projections: NDArray[np.void],
    i0: int,
    i1: int,
    filling: int,
    has_specular: bool,
    with_normals: int,
    paths: PhotonPaths | None,
) -> _Batch:
    """Photons i0 … i1−1, resumed with fresh buffers whenever one is full."""
    where = None if paths is None else paths.arguments
    most = int(record[0]["max_bounces"])
    if record[0]["roulette"] == EQUAL:
        most *= MOST_COPIES
    total, ledger = np.zeros(N_COUNTS, np.int64), empty_ledger()
    caustic_parts: list[Float] = []
    global_parts: list[Float] = []
    normal_parts: list[Codes] = []
    caustic_normal_parts: list[Codes] = []
    while i0 < i1:
        rows = 5 * (i1 - i0) + 2 * most
        global_out = np.empty((rows if i0 < filling else most, 6), np.float32)
        caustic_out = np.empty((rows // 2 + most if has_specular else most, 6), np.float32)
        normals_out = (
            np.empty(len(global_out) if with_normals != NO_NORMALS else 0, np.uint32),
            np.empty(len(caustic_out) if with_normals == NORMALS else 0, np.uint32),
        )
        counts = np.zeros(N_COUNTS, np.int64)
        i0 = trace_photons(
            scene.record, record, projections, i0, i1, global_out, normals_out, caustic_out, counts, ledger, where
        )
        global_parts.append(global_out[: counts[C_GLOBAL]].copy())
        normal_parts.append(normals_out[0][: counts[C_GLOBAL]].copy())
        caustic_normal_parts.append(normals_out[1][: counts[C_CAUSTIC]].copy())
        caustic_parts.append(caustic_out[: counts[C_CAUSTIC]].copy())
        total += counts
    return caustic_parts, global_parts, total, ledger, normal_parts, caustic_normal_parts


PROBED = 16
"""Batches that tell how much memory all of them need, where they might need more than there is."""
BYTES_PER_STORED = 60
"""A photon as it arrived, joined to the others, and in its map."""


def _bounded(tasks: list[Callable[[], _Batch]], most: int, run: Runner) -> list[_Batch]:
    """The batches, of at most so many photons each. Raises SettingError before they fill the memory."""
    available = available_memory()
    if available is None or len(tasks) <= PROBED or len(tasks) * most * BYTES_PER_STORED < available:
        return run(tasks)
    first = run(tasks[:PROBED])
    stored = sum(len(part) for batch in first for part in (*batch[0], *batch[1])) * len(tasks) / PROBED
    if stored * BYTES_PER_STORED > available:
        need, free = stored * BYTES_PER_STORED / 1e9, available / 1e9
        raise SettingError(
            f"A pass stores about {stored:,.0f} photons here, which need {need:.1f} GB of memory, and {free:.1f} GB "
            "are free. Lower photons.N, photons.q or photons.max_bounces."
        )
    return first + run(tasks[PROBED:])


def _join(parts: list[Float]) -> Float:
    return np.ascontiguousarray(np.concatenate(parts)) if parts else np.empty((0, 6), np.float32)


def _joined(parts: list[Codes]) -> Codes:
    return np.concatenate([np.empty(0, np.uint32), *parts])
