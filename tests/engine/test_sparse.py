"""Where photons lie far apart, gather rays look up wider."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.auto.candidates import GATHER, PROGRESSIVE
from pmviewer.engine.auto.runs import Trier
from pmviewer.engine.auto.sparse import wider_by
from pmviewer.engine.opened import open_scene
from pmviewer.engine.radius import first_radius
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import resolve_camera
from pmviewer.settings.access import SETTINGS, Settings, with_values


@pytest.mark.parametrize(
    ("name", "times"), [("cornell_diffuse", "once"), ("colonnade", "more"), ("rooms_10x10", "twice")]
)
def test_look_ups_of_gather_rays_are_wider_where_photons_lie_far_apart(pool, name, times):
    """In three of four places of another pass they hold four other photons then, unless they are twice as wide; where
    they hold more anyway they stay. Those of caustics stay as wide as they were."""
    scene = open_scene(name)
    base = with_values(Settings(), {"camera.width": 256, "camera.height": 256})
    trier = Trier(scene, base, pool, (40, 40), math.inf)
    trier.begin()
    progressive, gather = trier.spread([PROGRESSIVE, GATHER])
    usual = first_radius(scene.flat, resolve_camera(scene.scene, base.camera), base.estimate, True)
    renderer = Renderer(scene, with_values(base, dict(GATHER.values) | {"render.seed": 77}), pool, StageStore(0))
    renderer.step()
    places = renderer.latest.maps.photons.global_[:, :3].astype(float)

    def share_of_full(radius: float) -> float:
        held = [((places - p) ** 2).sum(axis=1) < radius**2 for p in places[:: len(places) // 200]]
        return float(np.mean([inside.sum() > 4 for inside in held]))

    assert progressive == PROGRESSIVE
    if times == "once":
        assert gather == GATHER
        assert share_of_full(usual) > 0.75
        return
    radius = gather.values["estimate.radius"] * scene.flat.radius
    caustics = gather.values["estimate.caustic_radius"] * radius
    assert caustics == pytest.approx(0.5 * usual, rel=1e-3)
    assert share_of_full(usual) < 0.7
    if times == "twice":
        assert radius == pytest.approx(2 * usual, rel=1e-3)
        assert share_of_full(radius) < 0.7
    else:
        assert 1.1 * usual < radius < 2 * usual
        assert share_of_full(radius) == pytest.approx(0.75, abs=0.08)


def test_wider_look_ups_are_for_little_time():
    """Places on a grid of a unit square, a hundredth apart: the fourth neighbour is that far off, and the fourth root
    of a time makes it less."""
    x, y = np.meshgrid(np.arange(100) / 100, np.arange(100) / 100)
    places = np.stack([x.ravel(), y.ravel(), np.zeros(10_000)], axis=1).astype(np.float32)
    N = SETTINGS["photons.N"].default
    for seconds, expected in ((4.0, 1.6), (10.0, 1.6), (40.0, 1.6 / 4**0.25), (1e4, 1.0)):
        assert wider_by(places, N, 0.01 / 1.6, seconds) == pytest.approx(expected, rel=1e-4)
    assert wider_by(places, N // 4, 0.01 / 1.6) == 1.0
    assert wider_by(places, N, 0.001) == 2.0
    assert wider_by(places[:3], N, 0.001) == 1.0
