"""The pixel inspector against naive sums over all photons of the maps, and what it costs while nothing is pinned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine import diagnose
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.inspector import pixel as report_of_a_pixel
from pmviewer.engine.inspector.report import PhotonAt, Pinned
from pmviewer.engine.inspector.watched import history_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.record import unpack
from pmviewer.render.diagnostics.pixel_replay import replay_pixel
from pmviewer.scene.description import Shape, Sphere
from tests.support import naive_maps as naive
from tests.support.scenes import cornell_box, settings_of

SIZE = 24
PASS = {"photons": {"N": 20_000}, "render": {"method": "progressive", "outline_rays": 0}}
DIFFUSE = ((12, 20), (3, 12), (20, 12), (12, 2))
"""Pixels that see the floor, the red and the green wall, and the ceiling."""
AT_EDGES = ((6, 0),)
"""Such whose look-ups reach beyond an edge."""


@pytest.fixture
def pool():
    pool = WorkPool(1)
    yield pool
    pool.close()


def renderer_of(pool, **settings):
    return Renderer(open_scene(cornell_box(size=SIZE)), settings_of(**{**PASS, **settings}), pool, StageStore(0))


def report(renderer, x, y, photon=None):
    return renderer.inspect(Wanted(pinned=Pinned(x, y, photon))).pixel


def test_the_list_is_the_naive_estimate_of_the_pixel(pool):
    """What the eye pass put into the film is what the photons of the map within the radius say, found and added up
    here, and the inspector lists these photons."""
    renderer = renderer_of(pool, estimate={"filter": "cone", "cone_k": 1.3})
    renderer.step()
    maps = renderer.latest.maps.photons
    checked, covered = 0, []
    for x, y in (*DIFFUSE, *AT_EDGES):
        told = report(renderer, x, y)
        planes = renderer.film.planes()[y, x]
        assert told.terms == pytest.approx(planes[:15].reshape(5, 3), rel=1e-6)
        for look_up in told.look_ups:
            photons, unit, term, mask = (
                (maps.caustic, maps.caustic_unit, slice(9, 12), 0b1100)
                if look_up.map == "caustic"
                else (maps.global_, maps.global_unit, slice(12, 15), 0b0010)
            )
            radius = renderer.tally.radius[look_up.map]
            E, count = naive.irradiance_radius(photons, unit, look_up.p, look_up.n, radius, 0.2, mask, "cone", 1.3)
            albedo = planes[15:18]
            assert albedo * E / np.pi / look_up.covered == pytest.approx(planes[term], rel=1e-4, abs=1e-7)
            covered.append(look_up.covered)
            assert look_up.value == pytest.approx(planes[term], rel=1e-6)
            assert look_up.sum == pytest.approx(planes[term], rel=1e-4, abs=1e-7)
            assert look_up.found.n == count
            p = unpack(photons, unit)
            d = np.linalg.norm(p["position"].astype(float) - look_up.p, axis=1)
            height = np.abs((p["position"].astype(float) - look_up.p) @ look_up.n)
            inside = (d < radius) & (height <= 0.2 * radius)
            inside &= naive.arriving(photons, look_up.p, look_up.n, 0.2 * radius / 2048)
            inside &= (mask >> p["path_class"]) & 1 == 1
            assert sorted(look_up.found.index) == list(np.flatnonzero(inside))
            assert look_up.found.distance == pytest.approx(np.sort(d[inside]), rel=1e-5)
            np.testing.assert_array_equal(look_up.found.records[:, :3], photons[look_up.found.index, :3])
            checked += count
    assert checked > 100
    assert min(covered) < 0.9
    assert max(covered) == 1.0


def test_the_nearest_photons_of_a_pixel(pool):
    """With the k nearest: so many, that far, and the same value, in the first pass and in a part of the disc later."""
    estimate = {"lookup": "nearest", "k": 30, "filter": "simpson", "rim": "half"}
    renderer = renderer_of(pool, estimate=estimate)
    renderer.step()
    for x, y in DIFFUSE:
        photons = renderer.latest.maps.photons
        (look_up,) = (one for one in report(renderer, x, y).look_ups if one.map == "global")
        largest = float(renderer.latest.given.eye[0]["global_radius"])
        E, count, radius = naive.irradiance_knn(
            photons.global_, photons.global_unit, look_up.p, look_up.n, 30, largest, 0.2, 0b0010, "simpson", 0.0, 1
        )
        planes = renderer.film.planes()[y, x]
        assert planes[15:18] * E / np.pi / look_up.covered == pytest.approx(planes[12:15], rel=1e-4)
        assert (look_up.k, look_up.found.n) == (30, count)
        assert look_up.radius == pytest.approx(radius, rel=1e-5)
        assert look_up.sum == pytest.approx(planes[12:15], rel=1e-4)
    before = renderer.film.sums.copy()
    renderer.step()
    for x, y in DIFFUSE:
        (look_up,) = (one for one in report(renderer, x, y).look_ups if one.map == "global")
        added = (renderer.film.sums - before)[y * SIZE + x, 12:15]
        assert look_up.sum == pytest.approx(added, rel=1e-4)
        assert look_up.value == pytest.approx(added, rel=1e-6)


@pytest.mark.parametrize("combine", ["powers and areas", "irradiances"])
def test_the_nearest_photons_in_several_maps(pool, combine):
    """What the listed photons add is what the eye pass took, in the first pass and in a part of the discs later."""
    estimate = {"lookup": "nearest", "k": 30, "rim": "half", "combine": combine}
    renderer = renderer_of(pool, estimate=estimate, photons={"N": 20_000, "maps": 3})
    for _ in range(2):
        renderer.step()
        for x, y in DIFFUSE:
            for look_up in report(renderer, x, y).look_ups:
                assert look_up.k == 3 * int(renderer.latest.given.eye[0]["k"])
                assert look_up.sum == pytest.approx(look_up.value, rel=1e-4, abs=1e-7)
                assert look_up.found.n <= look_up.k


@pytest.mark.usefixtures("room_for_split_paths")
def test_look_ups_over_mirrors_and_through_glass(pool):
    """They are of the last surface of the way, and what their photons add is seen through what is before it."""
    renderer = renderer_of(pool, render={**PASS["render"], "mirror_rays": 1})
    renderer.step()
    told = report(renderer, 6, 18)
    assert [seen.shape for seen in told.objects] == ["mirror ball", "front"]
    assert told.objects[0].material == "mirror"
    assert [seen.area for seen in told.objects] == pytest.approx([4 * np.pi * 0.38**2, 4.0])
    assert len(told.way) == 1 + len(told.objects) == 3
    assert {look_up.shows for look_up in told.look_ups} == {"specular"}
    for look_up in told.look_ups:
        assert look_up.depth == 1
        assert look_up.p == pytest.approx(told.way[-1], abs=1e-6)
        assert look_up.sum == pytest.approx(look_up.value, rel=1e-4)
    assert sum(look_up.value for look_up in told.look_ups)[0] < told.terms[2, 0]


@pytest.mark.usefixtures("room_for_split_paths")
def test_of_several_samples_all_look_ups_are_told(pool):
    """Of a pixel on a mirror whose light is all of maps: with their shares they add up to what the film has."""
    for samples in (1, 3):
        renderer = renderer_of(pool, render={**PASS["render"], "direct": "approximate", "mirror_rays": samples})
        renderer.step()
        told = report(renderer, 6, 18)
        assert len({tuple(look_up.p) for look_up in told.look_ups}) == samples
        value = sum(look_up.value for look_up in told.look_ups)
        assert value == pytest.approx(told.terms[2], rel=1e-4)
        assert sum(look_up.sum for look_up in told.look_ups) == pytest.approx(value, rel=1e-4)
        assert any(f"{samples} samples" in note for note in told.notes) == (samples > 1)
        assert len(told.way) == 3


def test_the_curve_of_a_kernel_passes_through_the_estimate(pool):
    """At its radius the curve of the kernel in use is the estimate; each is the naive sum at every other radius."""
    renderer = renderer_of(pool, estimate={"filter": "gaussian"})
    renderer.step()
    photons = renderer.latest.maps.photons
    (look_up,) = (one for one in report(renderer, *DIFFUSE[0]).look_ups if one.map == "global")
    here = np.searchsorted(look_up.curves.radii, look_up.radius)
    weights = [0.2126, 0.7152, 0.0722]
    assert look_up.curves.L["gaussian"][here] == pytest.approx(look_up.covered * look_up.value @ weights, rel=1e-4)
    albedo = renderer.film.planes()[DIFFUSE[0][1], DIFFUSE[0][0], 15:18]
    for i in (20, 40, here, 63):
        radius = look_up.curves.radii[i]
        for kernel, L in look_up.curves.L.items():
            E, count = naive.irradiance_radius(
                photons.global_, photons.global_unit, look_up.p, look_up.n, radius, 0.2, 0b0010, kernel, 1.1
            )
            assert L[i] == pytest.approx(albedo * E / np.pi @ weights, rel=1e-4)
            assert look_up.curves.count[i] == count


@pytest.mark.parametrize("rule", ["trajectories", "photons"])
def test_a_photon_is_found_again_with_its_life(pool, rule):
    """From the light over as many surfaces as it has scattered to just where it was stored, in a pass that is over."""
    renderer = renderer_of(pool, photons={"N": 20_000, "q_rule": rule})
    renderer.step()
    told = report(renderer, *DIFFUSE[1])
    photons = [
        (PhotonAt(told.index, told.N, tuple(map(float, look_up.found.records[i, :3]))), look_up.found.bounces[i])
        for look_up in told.look_ups
        for i in (0, look_up.found.n - 1)
    ]
    renderer.step()
    for photon, bounces in photons:
        life = report(renderer, *DIFFUSE[1], photon).life
        assert life.note == ""
        assert life.stored_at == bounces + 1
        at = unpack(life.vertices, life.power_unit)
        assert tuple(map(float, at["position"][life.stored_at])) == photon.position
        assert life.vertices[0, 1] == pytest.approx(0.9, abs=1e-5), "the panel below the ceiling"
        for i in range(1, life.stored_at + 1):
            way = at["position"][i - 1] - at["position"][i]
            assert at["wi"][i] == pytest.approx(way / np.linalg.norm(way), abs=3e-3)


@pytest.mark.parametrize("choice", ["power", "photons"])
def test_light_samples_are_those_of_the_rule(pool, choice):
    """By power each light gets its share; by photons, the photons that are straight from it within the radius decide,
    with a tenth by power."""
    box = cornell_box(size=SIZE)
    lamp = Shape("lamp", Sphere((-0.8, 0.0, 0.8), 0.1), 0, (3.0, 3.0, 3.0))
    box = replace(box, shapes=(*box.shapes, lamp))
    settings = settings_of(**{**PASS, "direct": {"choice": choice, "samples": 4, "choice_radius": 0.2}})
    renderer = Renderer(open_scene(box), settings, pool, StageStore(0))
    renderer.step()
    told = report(renderer, 12, 20)
    assert told.lights == ("panel", "lamp")
    power = renderer.scene.flat.light_power @ [0.2126, 0.7152, 0.0722]
    expected = power / power.sum()
    if choice == "photons":
        grid = renderer.latest.maps.chooser
        p = unpack(grid.photons, 1.0)
        (look_up,) = (one for one in told.look_ups if one.map == "global")
        near = np.linalg.norm(p["position"] - look_up.p, axis=1) < grid.radius
        near &= naive.arriving(grid.photons, look_up.p, look_up.n)
        counts = np.bincount(p["light"][near], minlength=2)
        assert counts.min() > 0
        expected = 0.9 * counts / counts.sum() + 0.1 * expected
    assert told.samples == pytest.approx(4 * expected, rel=1e-3)


def test_the_history_tells_mean_and_standard_error(pool):
    renderer = renderer_of(pool)
    single = []
    before = np.zeros(3)
    for n in range(1, 6):
        renderer.step()
        history = report(renderer, 12, 20).history
        assert list(history.passes) == list(range(1, n + 1))
        total = renderer.film.sums[20 * SIZE + 12, :15].reshape(5, 3).sum(axis=0)
        single.append((total - before) @ [0.2126, 0.7152, 0.0722])
        before = total
        assert history.mean[-1] == pytest.approx(total / n)
    assert np.isnan(history.error[0])
    for n in range(2, 6):
        assert history.error[n - 1] == pytest.approx(np.std(single[:n], ddof=1) / np.sqrt(n))
    other = report(renderer, 3, 12).history
    assert list(other.passes) == [5]
    assert np.isnan(other.error).all()


def test_passes_that_were_not_seen_one_by_one_count_by_their_mean():
    """Independent normal passes, told of at any passes: the error is right in the mean."""
    rng, told = np.random.default_rng(3), []
    passes = np.array([4, 5, 9, 10, 11, 14, 20])
    for _ in range(2000):
        sums = np.cumsum(rng.normal(1.0, 0.3, 20))[passes - 1]
        told.append(history_of(passes, np.tile(sums[:, None], 3)).error[-1] ** 2)
    assert np.mean(told) == pytest.approx(0.3**2 / 20, rel=0.05)
    assert np.isnan(history_of(passes[:2], np.ones((2, 3))).error).all()


def test_without_a_pinned_pixel_nothing_is_computed(pool, monkeypatch):
    """The film with a pixel pinned is that without, bit by bit, and without none of the inspector's code runs."""

    def forbidden(*arguments, **named):
        raise AssertionError("the inspector is closed")

    watched = renderer_of(pool)
    for _ in range(2):
        watched.step()
        assert watched.frame(1, Wanted(pinned=Pinned(12, 20))).inspection.pixel is not None
    compiled = len(replay_pixel.signatures)
    monkeypatch.setattr(diagnose, "pixel_report", forbidden)
    monkeypatch.setattr(report_of_a_pixel, "Replay", forbidden)
    plain = renderer_of(pool, estimate={"radius_rule": "pass"})
    for _ in range(2):
        plain.step()
        assert plain.frame(1).inspection.pixel is None
    np.testing.assert_array_equal(plain.film.sums, watched.film.sums)
    assert len(replay_pixel.signatures) == compiled


def test_nothing_is_told_of_a_pixel_outside_of_the_picture(pool):
    renderer = renderer_of(pool)
    assert renderer.inspect(Wanted(pinned=Pinned(1, 1))).pixel is None
    renderer.step()
    assert report(renderer, SIZE, 0) is None
    assert report(renderer, 0, -1) is None
