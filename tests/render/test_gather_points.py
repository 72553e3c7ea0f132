"""The gather rays of a pixel as the viewer draws them: they are those of the eye pass, and end where they should."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from tests.support.scenes import cornell_box, diffuse_box, settings_of

CASES = {
    "plain": {},
    "cones": {"directions": "photon cones"},
    "grid": {"directions": "hemisphere grid", "roulette": 0.4},
    "secondary": {"secondary": 3.0},
    "radiance photons": {"radiance_photons": "1/4"},
}


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=[pytest.mark.extensive] if case == "grid" else []) for case in CASES]
)
def test_points_add_up_to_the_pixel(case):
    """One pass: what the rays of a pixel bring is its indirect light. A grid guides rays as cones do."""
    pool = WorkPool(1)
    scene = open_scene(cornell_box(size=16))
    settings = settings_of(render={"method": "gather"}, photons={"N": 20_000}, gather={"rays": 6, **CASES[case]})
    renderer = Renderer(scene, settings, pool, StageStore(0))
    assert renderer.gather_points(3, 3).shape == (0, 10)
    renderer.step()
    frame = renderer.frame(1)
    image = frame.image("indirect") + frame.image("specular")
    guided = checked = 0
    for y in range(0, 16, 3):
        for x in range(0, 16, 3):
            points = renderer.gather_points(x, y)
            total = points[:, 6:9].sum(axis=0)
            if frame.image("specular")[y, x].max() > 0:  # mirrors show direct light, too
                assert np.all(total <= image[y, x] * 1.0001)
                continue
            assert total == pytest.approx(frame.image("indirect")[y, x], rel=1e-4, abs=1e-7)
            checked += len(points)
            guided += int(points[:, 9].sum())
    pool.close()
    assert checked > 50
    assert (guided > 0) == (case in ("cones", "grid"))
    assert renderer.gather_points(-1, 0).shape == renderer.gather_points(16, 0).shape == (0, 10)


def test_points_lie_on_the_walls():
    pool = WorkPool(1)
    scene = open_scene(diffuse_box(size=16))
    settings = settings_of(render={"method": "gather"}, photons={"N": 20_000}, gather={"rays": 16})
    renderer = Renderer(scene, settings, pool, StageStore(0))
    renderer.step()
    points = renderer.gather_points(8, 8)
    pool.close()
    assert len(points) == 16
    assert np.ptp(points[:, :3], axis=0).max() == 0
    ends = np.abs(points[:, 3:6])
    on_wall = np.isclose(ends.max(axis=1), 1, atol=1e-5) | np.isclose(points[:, 4], 0.9, atol=1e-5)
    assert on_wall.all()


def test_other_methods_have_none():
    pool = WorkPool(1)
    renderer = Renderer(open_scene(diffuse_box(size=16)), settings_of(photons={"N": 1000}), pool, StageStore(0))
    renderer.step()
    pool.close()
    assert renderer.gather_points(8, 8).shape == (0, 10)
