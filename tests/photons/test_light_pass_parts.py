"""Parts of a light pass (M4): traced alone, in whatever order and place, they are the photons of the pass."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.projection import projection_for
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.engine.store import StageStore
from pmviewer.photons.light_pass.batch import Batch, joined_batches
from pmviewer.photons.light_pass.ledger import N_COUNTS, empty_ledger
from pmviewer.photons.light_pass.parts import runs_of_part
from pmviewer.tasks import in_turn
from tests.support.scenes import cornell_box, settings_of

PARTS, N, INDEX = 3, 25_000, 2
FIELDS = ("caustic", "global_", "normals", "volume", "ledgers", "energy")


def tracer_of(**photons):
    scene = open_scene(cornell_box(size=8))
    settings = settings_of(photons={"N": N, "q": 0.4, **photons}, estimate={"lookup": "nearest"})
    plan = plan_of(settings, scene.traits)
    return Tracer(scene.flat, settings, plan, projection_for(scene, settings), in_turn)


def rows_of(photons):
    """In an order of their own."""
    words = np.ascontiguousarray(photons).view(np.uint32)
    return words[np.lexsort(words.T)]


@pytest.mark.parametrize("projection", ["off", "on"])
def test_parts_traced_elsewhere_are_those_of_the_pass(projection):
    """Bit for bit, from another tracer, the last part first; every trajectory in one part."""
    there, here = tracer_of(maps=PARTS, projection=projection), tracer_of(maps=PARTS, projection=projection)
    parts = {part: there.trace_part(INDEX, N, part, normals=True) for part in reversed(range(PARTS))}
    joined = here.of_parts(INDEX, N, [parts[part] for part in range(PARTS)])
    whole = here.trace(INDEX, N, normals=True)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))
    for field in ("caustic_unit", "global_unit", "volume_unit", "emitted", "rays", "dropped"):
        assert getattr(joined, field) == getattr(whole, field)
    for name in ("caustic", "global"):
        np.testing.assert_array_equal(joined.cuts[name], whole.cuts[name])
        for part in range(PARTS):
            stored = parts[part].caustic if name == "caustic" else parts[part].global_
            assert len(stored) > 1000
            np.testing.assert_array_equal(whole.parts(name)[part], stored)


def part_elsewhere(part):
    """What another process does: it opens the scene itself, and traces one part."""
    return tracer_of(maps=PARTS).trace_part(INDEX, N, part)


@pytest.mark.slow
def test_parts_from_another_process_are_those_of_the_pass():
    with ProcessPoolExecutor(1, get_context("spawn")) as process:
        parts = list(process.map(part_elsewhere, range(PARTS)))
    here = tracer_of(maps=PARTS)
    joined, whole = here.of_parts(INDEX, N, parts), here.trace(INDEX, N)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))


def test_the_parts_are_the_pass_undivided():
    """The same photons in the same units, so that several maps change nothing but what is looked up."""
    one, several = tracer_of().trace(INDEX, N), tracer_of(maps=PARTS).trace(INDEX, N)
    assert (one.emitted, one.rays, one.caustic_unit, one.global_unit) == (
        several.emitted,
        several.rays,
        several.caustic_unit,
        several.global_unit,
    )
    np.testing.assert_array_equal(rows_of(one.caustic), rows_of(several.caustic))
    np.testing.assert_array_equal(one.global_, several.global_)
    np.testing.assert_allclose(one.ledgers, several.ledgers, rtol=1e-12)


def test_trajectories_are_dealt_out_evenly():
    """Both kinds, whatever their numbers; more parts than trajectories leave some without any."""
    for n, parts in ((25_000, 3), (10, 4), (2, 5)):
        plan = tracer_of(maps=parts).planned(0, n, None)
        runs = [runs_of_part(plan, part, parts) for part in range(parts)]
        taken = sorted(i for part in runs for first, end in part for i in range(first, end))
        assert taken == list(range(plan.traced))
        filling = [sum(max(0, min(end, plan.filling) - first) for first, end in part) for part in runs]
        assert max(filling) - min(filling) <= 1


def test_each_part_lights_the_whole_scene():
    """Runs of a Sobol sequence, not every fourth point: each part is spread over the floor as all photons are."""
    photons = tracer_of(maps=4, q=1.0).trace(0, 16_384)
    shares = [
        np.histogram2d(part[:, 0], part[:, 2], bins=4, range=[(-1, 1), (-1, 1)])[0] / len(part)
        for part in photons.parts("global")
    ]
    for share in shares:
        assert np.abs(share - np.mean(shares, axis=0)).max() < 0.01


@pytest.mark.parametrize("combine", ["powers and areas", "irradiances"])
def test_pictures_of_several_maps_have_the_same_mean(combine):
    """In gather rays and shown directly, glossy surfaces and mirrors included: over some passes as with one map."""
    pool = WorkPool(2)
    try:
        for method in ("progressive", "gather"):
            means = {}
            for maps in (1, 4):
                settings = settings_of(
                    photons={"N": 12_000, "maps": maps, "sequence": "independent"},
                    estimate={"lookup": "nearest", "k": 40, "combine": combine, "alpha": 1.0},
                    render={"method": method},
                )
                renderer = Renderer(open_scene(cornell_box(size=24)), settings, pool, StageStore(0))
                for _ in range(8):
                    renderer.step()
                means[maps] = renderer.frame(0).image("beauty").mean()
            print(method, combine, means)
            assert means[4] == pytest.approx(means[1], rel=0.01)
    finally:
        pool.close()


def test_batches_of_many_photons_are_joined_in_order():
    rng = np.random.default_rng(4)
    sizes = [0, 30_000, 1, 50_000, 0, 12_345]

    def batch(n):
        photons = rng.random((n, 6), np.float32)
        none = np.empty(0, np.uint32)
        counts, ledgers = np.zeros(N_COUNTS, np.int64), empty_ledger()
        counts[0] = n
        return Batch(photons[: n // 10], photons, counts, ledgers, rng.integers(0, 9, n).astype(np.uint32), none)

    batches = [batch(n) for n in sizes]
    pool = WorkPool(3)
    whole = joined_batches(batches, pool.run)
    pool.close()
    assert np.array_equal(whole.global_, np.concatenate([b.global_ for b in batches]))
    assert np.array_equal(whole.caustic, np.concatenate([b.caustic for b in batches]))
    assert np.array_equal(whole.global_normals, np.concatenate([b.global_normals for b in batches]))
    assert (len(whole.caustic_normals), len(whole.volume), whole.counts[0]) == (0, 0, sum(sizes))
    for none in (joined_batches([]), joined_batches([joined_batches([]), batch(0), batch(0)])):
        assert (none.global_.shape, none.caustic.shape, none.volume.shape) == ((0, 6), (0, 6), (0, 6))
        assert (none.global_normals.shape, none.caustic_normals.shape) == ((0,), (0,))
