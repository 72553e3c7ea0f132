"""Look-ups of maps that are shown are wide enough to hold photons, and no wider than walls are apart."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.bench.measures.error import reference
from pmviewer.engine.opened import open_scene
from pmviewer.engine.radius import seen_from
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages import spread
from pmviewer.engine.stages.spread import FEW_TRACED, MOST, TRACED, _nearest
from pmviewer.engine.stages.tracer import Tracer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import relmse
from pmviewer.scene.description import Camera, Parallelogram, PointLight, Scene, Shape
from pmviewer.settings.access import Settings, with_values
from tests.support.scenes import diffuse

PROGRESSIVE = {"render.method": "progressive"}


def made(scene, pool, **values):
    """A renderer by `group.name` = values, written group__name."""
    given = {name.replace("__", "."): value for name, value in values.items()}
    return Renderer(scene, with_values(Settings(), PROGRESSIVE | given), pool, StageStore(0))


@pytest.mark.parametrize("name", ["cornell_diffuse", "glass_egg", "corner_room"])
def test_where_photons_lie_close_look_ups_go_with_the_pixels(pool, name):
    radii = made(open_scene(name), pool).settled_radii
    assert radii.global_ == radii.usual
    assert radii.caustic == 0.5 * radii.usual


@pytest.mark.parametrize("name", ["skylight_room", "office", "colonnade"])
def test_half_of_what_is_seen_finds_photons_of_a_pass(pool, name):
    """Counted among those of another seed, all of a pass. Walls make radii somewhat narrower."""
    scene = open_scene(name)
    renderer = made(scene, pool, render__seed=11)
    radii = renderer.settled_radii
    renderer.step()
    assert 1.4 * radii.usual < radii.global_ < MOST * radii.usual
    places = renderer.light.stored("global")[:, :3].astype(float)
    origins, directions, t, _ = seen_from(scene.flat, renderer.render_camera, 10)
    seen = origins + directions * t[:, None]

    def held(radius: float) -> float:
        return float(np.median([(((places - p) ** 2).sum(axis=1) < radius**2).sum() for p in seen]))

    assert 3 <= held(radii.global_) <= 14
    assert held(radii.usual) < 3


@pytest.fixture(scope="module")
def walled():
    """A floor and a ceiling and a wall between: the half that is seen has a lamp a thousand times as weak."""
    sides = {
        "floor": Parallelogram((-4, 0, -4), (0, 0, 8), (8, 0, 0)),
        "ceiling": Parallelogram((-4, 4, -4), (8, 0, 0), (0, 0, 8)),
        "wall": Parallelogram((0, 0, -4), (0, 4, 0), (0, 0, 8)),
    }
    shapes = tuple(Shape(name, side, 0) for name, side in sides.items())
    lamps = PointLight("bright", (2, 2, 0), (50.0,) * 3), PointLight("weak", (-2, 2, 0), (0.05,) * 3)
    camera = Camera((-2, 2.5, -3.5), (-0.6, 0, 0), (0, 1, 0), 50.0, near=0.0, far=np.inf)
    return open_scene(Scene("walled", None, shapes, (diffuse(),), lamps, camera, 320, 320))


def test_look_ups_do_not_reach_behind_walls(pool, walled):
    """In half of the places that are seen they find no photon of the bright half, where nearly all of them lie."""
    renderer = made(walled, pool)
    radii = renderer.settled_radii
    renderer.step()
    photons = renderer.light.stored("global")[:, :3].astype(float)
    bright = photons[:, 0] > -1e-3  # and what lies on the wall
    assert bright.mean() > 0.99
    origins, directions, t, _ = seen_from(walled.flat, renderer.render_camera, 12)
    places = origins + directions * t[:, None]
    nearest = [np.sqrt(((photons[bright] - p) ** 2).sum(axis=1).min()) for p in places]
    needed = [np.sqrt(np.partition(((photons - p) ** 2).sum(axis=1), 7)[7]) for p in places]
    assert np.median(nearest) > 3 * radii.usual
    assert radii.global_ < 1.2 * np.median(nearest) < 1.2 * np.median(needed)


def test_n_q_and_seed_decide_nothing(pool):
    scene = open_scene("car_cabin")
    radii = made(scene, pool).settled_radii
    for values in ({"photons__N": 700}, {"photons__q": 0.1}, {"render__seed": 5}):
        assert made(scene, pool, **values).settled_radii == radii


def test_few_photons_of_caustics_have_wider_look_ups_and_many_have_not(pool):
    sparse, close = (made(open_scene(name), pool).settled_radii for name in ("car_cabin", "three_balls"))
    assert sparse.caustic > 4 * 0.5 * sparse.usual
    assert close.caustic == 0.5 * close.usual
    gathered = made(open_scene("car_cabin"), pool, render__method="gather").settled_radii
    assert gathered.global_ == gathered.usual
    assert gathered.caustic > 4 * 0.5 * gathered.usual


def test_numbers_stay_as_they_are_given(pool):
    scene = open_scene("car_cabin")
    size = scene.flat.radius
    radii = made(scene, pool, estimate__radius=0.01).settled_radii.scaled(1 / size)
    assert (radii.usual, radii.global_, radii.caustic) == pytest.approx((0.01, 0.01, 0.005))
    automatic = made(scene, pool).settled_radii
    share = made(scene, pool, estimate__caustic_radius=0.3).settled_radii
    assert share.global_ == automatic.global_
    assert share.caustic == pytest.approx(0.3 * automatic.usual)
    nearest = made(scene, pool, estimate__lookup="nearest").settled_radii
    assert nearest.global_ == nearest.usual == automatic.usual


def test_radii_as_numbers_make_the_same_picture(pool):
    scene = open_scene("car_cabin")
    size = {"camera__width": 80, "camera__height": 60, "photons__N": 20_000}
    automatic = made(scene, pool, **size)
    values = automatic.settled_radii.scaled(1 / scene.flat.radius).values(automatic.settings.estimate)
    fixed = made(scene, pool, **size, **{name.replace(".", "__"): value for name, value in values.items()})
    for renderer in (automatic, fixed):
        renderer.step()
        renderer.step()
    np.testing.assert_allclose(fixed.film.planes(), automatic.film.planes(), rtol=1e-4, atol=1e-5)


def test_a_cabin_is_no_longer_dots_on_black(pool):
    """After four passes, against the converged picture."""
    scene, target = open_scene("car_cabin"), reference("car_cabin")
    size = {"camera__width": target.shape[1], "camera__height": target.shape[0]}
    automatic = made(scene, pool, **size)
    usual = automatic.settled_radii.usual / scene.flat.radius
    errors = []
    for renderer in (automatic, made(scene, pool, **size, estimate__radius=usual)):
        for _ in range(4):
            renderer.step()
        errors.append(relmse(renderer.frame(0).image(), target))
    assert errors[0] < 0.2 * errors[1]


@pytest.mark.parametrize(("name", "few"), [("cornell_diffuse", True), ("cornell_caustic", True), ("door_slit", False)])
def test_few_trajectories_are_enough_where_photons_lie_close(pool, monkeypatch, name, few):
    """And tell the same radii, or the next step's; behind walls and where there are hardly any, more are traced."""
    scene, traced = open_scene(name), []
    trace = Tracer.trace
    monkeypatch.setattr(Tracer, "trace", lambda self, index, N: traced.append(N) or trace(self, index, N))
    radii = made(scene, pool).settled_radii
    assert traced == ([FEW_TRACED] if few else [FEW_TRACED, TRACED])
    monkeypatch.setattr(spread, "FEW_TRACED", TRACED)
    by_all = made(scene, pool).settled_radii
    assert (radii.usual, radii.global_) == (by_all.usual, by_all.global_)
    assert abs(math.log2(radii.caustic / by_all.caustic)) < 0.26


def test_radii_stay_when_one_of_three_glasses_moves(pool):
    """Photons around the others are the same, and so are the look-ups that find them (T2)."""
    moved = [made(open_scene("three_glasses", {"x": x}), pool).settled_radii for x in ("0", "0.0025", "0.01")]
    assert moved[1:] == moved[:1] * 2


@pytest.mark.parametrize("away", [0.0, 1e4])
def test_the_nearest_are_found_far_from_the_middle_too(away):
    """Against all distances, sorted; a stage may lie at the rim of a wide floor."""
    rng = np.random.default_rng(5)
    photons = (rng.normal(size=(3000, 3)) + [away, 0, 0]).astype(np.float32)
    places = rng.normal(size=(150, 3)) + [away, 0, 0]
    near, distances = _nearest(places, photons, 4)
    apart = np.sqrt(((places[:, None] - photons.astype(np.float64)) ** 2).sum(axis=2))
    assert np.array_equal(near, np.argsort(apart, axis=1)[:, :4])
    assert distances == pytest.approx(np.sort(apart, axis=1)[:, :4], rel=1e-6)
