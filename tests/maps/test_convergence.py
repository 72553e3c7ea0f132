"""The convergence criterion of caustic maps: its three states, and that a pass ends when all is converged (I5)."""

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.convergence import (
    CONVERGED,
    DENSE,
    FEWEST,
    MORE,
    NO_CAUSTIC,
    Converged,
    Convergence,
    Criterion,
    other_light,
)
from pmviewer.maps.record import DIRECT
from pmviewer.output.diagnostic_views import CLASS_COLOURS, GREY, coloured
from tests.maps.test_density_control import in_order, plane
from tests.support.scenes import cornell_box, rendered, settings_of

f4 = np.float32
UP = np.array([[0.0, 0.0, 1.0]], f4)
CAUSTICS = 0b1010


def judge(caustics, others, m=2, caustic_power=1.0, other_power=1.0):
    """So many photons of either kind on the unit square, evenly at random, of such powers in all."""
    criterion = Criterion(m, 1.0, CAUSTICS)
    sample = plane(others, 2)
    sample.view(np.uint32)[:, 3] |= DIRECT << 6
    light = other_light(criterion, sample, other_power / max(others, 1))
    return Convergence(criterion, plane(caustics, 1), caustic_power / max(caustics, 1), light)


def state(made, required, own=False):
    middle = np.linspace(0.3, 0.7, 21)
    points = np.stack([middle, middle[::-1], 0 * middle], axis=1).astype(f4)
    return made.states(points, np.repeat(UP, 21, axis=0), np.full(21, required, f4), own, in_order)


def test_three_states_by_density_and_other_light():
    """1000 photons per unit area where 10 000 are stored at most: converged if (L_g/L_c)^m is ten or more."""
    required = 10_000.0
    assert np.all(state(judge(20_000, 1000), required) == DENSE)
    assert np.all(state(judge(1000, 1000, other_power=0.2), required) == MORE)
    assert np.all(state(judge(1000, 1000, other_power=10.0), required) == CONVERGED)
    some = judge(1000, 1000, 2, other_power=1.7), judge(1000, 1000, 3, other_power=1.7)
    assert (state(some[0], required) == CONVERGED).mean() < 0.3  # 2.7² = 7
    assert (state(some[1], required) == CONVERGED).mean() > 0.7  # 2.7³ = 20


def test_places_without_caustics_and_nothing_at_all():
    made = judge(1000, 1000)
    far = made.states(np.array([[9.0, 9.0, 0.0]], f4), UP, np.array([100.0], f4), False, in_order)
    below = made.states(np.array([[0.5, 0.5, 0.0]], f4), -UP, np.array([100.0], f4), False, in_order)
    assert (far[0], below[0]) == (NO_CAUSTIC, NO_CAUSTIC)
    assert np.all(state(judge(0, 1000), 100.0) == NO_CAUSTIC)
    assert np.all(state(judge(1000, 0), 10_000.0) == MORE)
    for required in (0.0, np.nan, np.inf):
        assert set(state(made, required)) <= {NO_CAUSTIC, MORE, CONVERGED, DENSE}
    empty = plane(0, 1)
    assert made.of_map(empty, np.empty(0, np.uint32), np.empty(0), np.empty(0, f4), in_order) == Converged()


def test_all_is_said_by_light():
    assert Converged(0.5, 0.495, 0.005, FEWEST).done
    assert not Converged(0.5, 0.4, 0.1, FEWEST).done
    assert not Converged(1.0, 0.0, 0.0, FEWEST - 1).done


def settings(convergence, N=120_000, q=0.1, method="progressive", photons=None, **importance):
    importance = {"deposition": "constant density", "density": 100.0, "convergence": convergence, **importance}
    return settings_of(
        render={"method": method},
        photons={"N": N, "q": q, "projection": "off"} | (photons or {}),
        importance=importance,
    )


@pytest.fixture(scope="module")
def box():
    return open_scene(cornell_box(size=16))


def caustic_light(renderer):
    photons = renderer.light.photons
    return renderer.tally.deposited["caustic"].stored_power, photons.emitted


AIMED = {"projection": "on", "indirect_caustics": False}


@pytest.mark.parametrize("photons", [{}, AIMED], ids=["anywhere", "projection maps"])
def test_a_pass_ends_when_all_is_converged(box, photons):
    """The power stored stays that of the light: fewer trajectories, each with more."""
    off, on = (rendered(box, settings(how, photons=photons), 1) for how in ("off", "cube"))
    all_, some = caustic_light(off), caustic_light(on)
    found = on.tally.deposited["caustic"].converged
    assert found.done
    assert found.spared == all_[1] - some[1] > 0
    assert all_[1] == 120_000
    assert some[0] == pytest.approx(all_[0], rel=0.03)
    assert off.tally.deposited["caustic"].converged is None
    np.testing.assert_array_equal(off.light.photons.global_, on.light.photons.global_)  # only the others are spared
    more = rendered(box, settings("cube", photons=photons), 1, threads=3)
    np.testing.assert_array_equal(on.light.photons.caustic, more.light.photons.caustic)


def test_a_pass_goes_on_while_more_is_needed(box):
    strict = rendered(box, settings("square", density=1e6), 1)
    found = strict.tally.deposited["caustic"].converged
    assert found.more > 0.05
    assert found.spared == 0
    mixed = rendered(box, settings("cube", photons={"projection": "on"}), 1).tally  # weights of two kinds
    assert mixed.deposited["caustic"].converged.spared == 0
    assert mixed.emitted == 120_000
    assert found.dense + found.converged + found.more == pytest.approx(1)


def test_view(box):
    pool = WorkPool(2)
    try:
        renderer = Renderer(box, settings("square", 20_000, 1.0, density=1.5e4), pool, StageStore(0))
        renderer.step()
        plane = renderer.inspect(Wanted("convergence")).planes["caustic convergence"]
    finally:
        pool.close()
    assert plane.shape == (16, 16, 1)
    found = set(np.unique(plane).tolist())
    assert {NO_CAUSTIC, MORE, CONVERGED} <= found <= {NO_CAUSTIC, MORE, CONVERGED, DENSE}
    shown = coloured("caustic convergence", plane)
    for value, colour in zip((NO_CAUSTIC, MORE, CONVERGED), (GREY, *CLASS_COLOURS[:2]), strict=True):
        assert np.allclose(shown[plane[..., 0] == value], colour)


def test_greyed_without_effect(box):
    on, plain = settings("square"), settings("square", deposition="all")
    for path in ("importance.convergence", "display.view=caustic convergence"):
        assert inactive_reason(path, on, box.traits) is None
        assert "density control" in inactive_reason(path, plain, box.traits)
    off = settings("off")
    assert "importance.convergence" in inactive_reason("display.view=caustic convergence", off, box.traits)
