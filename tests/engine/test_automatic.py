"""What automatic settings come to: told once and for all passes, and the picture of the same number."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.radius import FOOTPRINTS, typical_distance
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import resolve_camera
from tests.support.scenes import cornell_box, rendered, settings_of

SMALL = {"photons": {"N": 2000}}


@pytest.fixture(scope="module")
def box():
    return open_scene(cornell_box())


def told(box, passes=1, **groups):
    renderer = rendered(box, settings_of(**{**SMALL, **groups}), passes)
    return renderer, renderer.frame(1).automatic


def test_the_automatic_radius_is_a_few_pixels_and_stays_from_pass_to_pass(box):
    camera = resolve_camera(box.scene, settings_of().camera)
    wanted = FOOTPRINTS * typical_distance(box.flat, camera) * camera.pixel_angle() / box.flat.radius
    once, often = told(box)[1], told(box, 4)[1]
    assert once["estimate.radius"] == often["estimate.radius"]
    assert once["estimate.radius"] == pytest.approx(min(wanted, 0.1), rel=2**0.125 - 1)


def test_with_nearest_look_ups_neither_radius_drifts(box):
    nearest = {"estimate": {"lookup": "nearest", "k": 10}}
    by_radius = told(box)[1]["estimate.radius"]
    values = [told(box, passes, **nearest)[1] for passes in (1, 4)]
    assert [v["estimate.radius"] for v in values] == [by_radius, by_radius]
    assert values[1]["estimate.max_radius"] == pytest.approx(values[0]["estimate.max_radius"], rel=0.3)
    assert all(0 < v["estimate.max_radius"] <= 2 for v in values)


def test_fixing_what_is_told_changes_nothing(box):
    renderer, values = told(box)
    fixed = {"estimate": {"radius": values["estimate.radius"]}, "light": {"rig": values["light.rig"]}}
    fixed["photons"] = {"N": 2000, "projection": values["photons.projection"]}
    fixed["direct"] = {"choice": values["direct.choice"]}
    np.testing.assert_allclose(told(box, **fixed)[0].film.planes(), renderer.film.planes(), rtol=2e-5, atol=1e-6)


def test_a_coarse_picture_tells_the_radius_of_the_film(box):
    settings = settings_of(photons={"N": 200_000})
    renderer = Renderer(box, settings, WorkPool(2), StageStore(0))
    coarse = renderer.coarse_frame(2)
    renderer.step()
    values = renderer.frame(3).automatic
    renderer.pool.close()
    assert coarse.automatic["estimate.radius"] == values["estimate.radius"]
    assert coarse.statistics.radius["global"] > renderer.frame(3).statistics.radius["global"], "fewer photons"
