"""More samples where the noise is the pixels' own: which pixels, and that the picture stays the same."""

import numpy as np
import pytest

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.pass_data import blank_eye
from pmviewer.engine.store import StageStore
from pmviewer.render.adaptive import DECIDED_AFTER, MOST, cost_of, doublings_of
from pmviewer.render.moments import Moments
from pmviewer.render.pixel_samples import DOUBLINGS, EDGED, MIRRORED, samples_by_marks
from tests.support.scenes import cornell_box, settings_of

SIZE, PASSES = 24, 14


def noisy(passes):
    """Moments of a film of those pictures, (n, h, w): the last pass is not closed yet."""
    moments = Moments(passes[0].size)
    sums = np.zeros((passes[0].size, 16))
    for index, picture in enumerate(passes):
        sums[:, :3] += picture.reshape(-1, 1)
        moments.add(sums, 16, 0, len(sums))
        if index < len(passes) - 1:
            moments.close_pass()
    return moments


def decided(passes, reach=0, refined=None, cost=None):
    size = passes[0].shape
    cost = np.ones(passes[0].size) if cost is None else cost
    return doublings_of(noisy(passes), size, cost, reach, refined).reshape(size)


@pytest.fixture
def rooms():
    """Eight pictures of 1 with noise: to the left each pixel's own, on the right that of patches of 8 × 8."""
    generator = np.random.default_rng(3)
    own = generator.normal(size=(DECIDED_AFTER, 64, 64))
    shared = generator.normal(size=(DECIDED_AFTER, 8, 8)).repeat(8, axis=1).repeat(8, axis=2)
    weight = np.zeros((3, 64, 64))
    weight[0, :, :16], weight[1, :, 48:], weight[2, :, 16:48] = 0.5, 0.25, 0.02
    return 1.0 + weight[0] * own + weight[1] * shared + weight[2] * own


def test_noise_of_a_pixels_own_gets_samples_and_shared_noise_does_not(rooms):
    found = decided(rooms)
    assert found.dtype == np.uint8
    assert found.max() <= MOST
    assert (found[:, :15] > 0).mean() > 0.9
    assert found[:, 20:44].max() == 0
    assert (found[:, 52:] > 0).mean() < 0.2


def test_how_often_is_what_saves_most():
    """A third of the pixels with 16 times the noise of the others: √16 times as many samples, since the variance of m
    samples a pixel is least for its cost at m ∝ σ."""
    generator = np.random.default_rng(5)
    spread = np.full((60, 60), 0.1)
    spread[:, :20] = 0.4
    found = decided(1.0 + spread * generator.normal(size=(DECIDED_AFTER, 60, 60)))
    assert np.median(found[:, 2:17]) in (1, 2)
    assert found[:, 24:].max() <= 1
    assert np.exp2(found[:, 2:17]).mean() / np.exp2(found[:, 24:]).mean() > 1.8


def test_what_a_sample_costs_counts(rooms):
    """The same noise where samples cost 16 times as much gets fewer of them."""
    cost = np.ones((64, 64))
    cost[:32, :16] = 16.0
    found = decided(rooms, cost=cost.ravel())
    assert np.exp2(found[2:28, :14]).mean() < 0.7 * np.exp2(found[36:60, :14]).mean()


def test_alike_noise_everywhere_gets_nothing():
    generator = np.random.default_rng(7)
    assert decided(1.0 + 0.3 * generator.normal(size=(DECIDED_AFTER, 48, 48))).mean() < 0.1
    assert decided(np.ones((DECIDED_AFTER, 16, 16))).max() == 0
    assert decided(np.zeros((DECIDED_AFTER, 1, 1))).max() == 0


def test_noise_that_a_filter_spreads_is_still_the_pixels_own():
    """Neighbours share samples as far as the filter reaches: beyond it they do not."""
    from scipy.ndimage import uniform_filter

    generator = np.random.default_rng(11)
    own = np.zeros((DECIDED_AFTER, 64, 64))
    own[:, :, :20] = generator.normal(size=(DECIDED_AFTER, 64, 20))
    spread = 1.0 + uniform_filter(own, (0, 3, 3))
    assert (decided(spread, reach=1)[:, 2:17] > 0).mean() > 0.8
    assert (decided(spread, reach=0)[:, 2:17] > 0).mean() < 0.4


def test_pixels_that_are_not_rendered_on_get_none(rooms):
    refined = np.zeros((64, 64), bool)
    refined[8:40, :40] = True
    found = decided(rooms, refined=refined.ravel())
    assert found[~refined].max() == 0
    assert (found[8:40, :14] > 0).mean() > 0.9


def test_costs_are_those_of_samples_that_meet_something():
    normals = np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, 0.0, 0.0]])
    assert cost_of(np.array([1, 2, 1]), normals) == pytest.approx([0.1, 2.0, 0.55])


def test_marks_hold_how_many_samples():
    edge = EDGED | 1 << DOUBLINGS
    marks = np.array(
        [0, MIRRORED, 1 << DOUBLINGS, MIRRORED | 3 << DOUBLINGS, 1, EDGED, edge, MIRRORED | edge], np.uint8
    )
    assert samples_by_marks(marks, 3, 5).tolist() == [1, 3, 2, 24, 1, 5, 10, 30]


def renderer(pool, adaptive, seed=0, method="gather", **groups):
    render = {"method": method, "adaptive": adaptive, "seed": seed, **groups.pop("render", {})}
    settings = settings_of(render=render, photons={"N": 3000}, gather={"rays": 1}, **groups)
    return Renderer(open_scene(cornell_box(size=SIZE)), settings, pool, StageStore(0))


def stepped(one, passes=PASSES):
    for _ in range(passes):
        one.step()
    return one


@pytest.mark.parametrize("method", ["gather", "progressive"])
def test_the_mean_stays_and_noise_falls(method, pool):
    """Over 12 × 14 passes: the first eight are the same bit for bit, the mean is within its error, and what varies
    from seed to seed is less where samples were doubled."""
    pictures, doubled = {}, np.zeros(SIZE * SIZE)
    for adaptive in ("off", "on"):
        rows = []
        for seed in range(12):
            one = stepped(renderer(pool, adaptive, seed, method), DECIDED_AFTER)
            first = one.film.sums.copy()
            stepped(one, PASSES - DECIDED_AFTER)
            rows.append((first, (one.film.sums - first)[:, :15].reshape(-1, 5, 3).sum(axis=1)))
            if adaptive == "on":
                doubled += one.film.doublings > 0
                assert one.latest.samples(int(one.film.doublings.argmax())) > 1
        pictures[adaptive] = rows
    for before, after in zip(pictures["off"], pictures["on"], strict=True):
        assert np.array_equal(before[0], after[0])
    off, on = (np.array([later for _, later in pictures[adaptive]]) for adaptive in ("off", "on"))
    often = doubled >= 10
    assert 0.02 < often.mean() < 0.7
    error = np.sqrt((off.mean(axis=(1, 2)).var(ddof=1) + on.mean(axis=(1, 2)).var(ddof=1)) / 12)
    assert on.mean() == pytest.approx(off.mean(), abs=4 * error)
    assert 4 * error < 0.1 * off.mean()
    spread = [later.var(axis=0, ddof=1)[often].sum() for later in (off, on)]
    assert spread[1] < 0.75 * spread[0]


def test_threads_and_a_stop_in_between_make_no_difference(pool):
    whole = stepped(renderer(pool, "on", render={"filter": "Mitchell-Netravali"}))
    several = WorkPool(3)
    try:
        other = stepped(renderer(several, "on", render={"filter": "Mitchell-Netravali"}), 11)
        resumed = renderer(pool, "on", render={"filter": "Mitchell-Netravali"})
        resumed.restore(other.state())
        assert np.array_equal(resumed.latest.marks, other.latest.marks)
        stepped(resumed, PASSES - 11)
    finally:
        several.close()
    assert whole.film.doublings.max() > 0
    assert np.array_equal(resumed.film.sums, whole.film.sums)


def test_a_region_alone_is_adapted(pool):
    one = stepped(renderer(pool, "on", region={"on": True, "right": 0.5}), DECIDED_AFTER + 1)
    found = one.film.doublings.reshape(SIZE, SIZE)
    assert found[:, SIZE // 2 :].max() == 0
    assert found.max() > 0


def test_records_have_room_for_samples_wherever_several_may_be(pool):
    """So that no kernel is compiled anew when samples are adapted."""
    for adaptive, method, room in (("on", "gather", True), ("off", "gather", True), ("on", "path", False)):
        one = renderer(pool, adaptive, method=method)
        assert one.plan.adaptive == (adaptive == "on" and room)
        assert ("mirror_rays" in blank_eye(one.settings, one.plan).dtype.names) == room


def test_a_view_shows_how_many_samples(pool):
    """Two in mirrors and glass and at edges, four where both are, doubled as often as it was decided."""
    region = {"on": True, "left": 0.0, "top": 0.0, "right": 1.0, "bottom": 0.5}
    one = stepped(renderer(pool, "on", render={"edge_rays": 2}, region=region), 9)
    (shown,) = one.inspect(Wanted("samples")).planes.values()
    usual = renderer(pool, "off", render={"edge_rays": 2})
    usual.step()
    (before,) = usual.inspect(Wanted("samples")).planes.values()
    assert set(np.unique(before)) == {1.0, 2.0, 4.0}
    top, doublings = SIZE // 2, one.film.doublings.reshape(SIZE, SIZE)
    assert np.array_equal(shown[:top, :, 0], before[:top, :, 0] * np.exp2(doublings[:top]))
    assert (shown[top:] == -1.0).all()
