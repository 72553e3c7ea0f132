"""Paper: what passes it leaves alike in all directions. Under a sky of radiance 1 all is known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.scene.description import Camera, ConstantEnvironment, Disk, Material, Parallelogram, Scene, Shape
from tests.support.scenes import rendered, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

T = (0.8, 0.5, 0.2)
REFLECTANCE = 0.5
RADIUS, HEIGHT = 1.0, 1.0
PAPER = Material("paper", "diffuse transmitter", (0.0,) * 3, T)
SKY = (ConstantEnvironment("sky", (1.0, 1.0, 1.0)),)


@pytest.mark.parametrize(("method", "passes"), [("path", 32), ("progressive", 20), ("gather", 16)])
def test_a_sheet_lights_the_floor_below_it(method, passes):
    """The floor under a disc sees the sheet's T in the share R²/(R² + h²) of its cosines, and the sky in the rest. Over
    five seeds photons give 0.998 of it in red, with a standard deviation of 0.010."""
    floor = Parallelogram((-0.25, 0, 0.25), (0.5, 0, 0), (0, 0, -0.5))
    shapes = (
        Shape("floor", floor, 1),
        Shape("sheet", Disk((0, HEIGHT, 0), (0, 1, 0), RADIUS), 0),
    )
    grey = Material("grey", "diffuse", (REFLECTANCE,) * 3)
    camera = Camera((0, 0.5, 0), (0, 0, 0), (0, 0, 1), 10.0, near=0.0, far=np.inf)
    scene = Scene("sheet", None, shapes, (PAPER, grey), SKY, camera, 24, 24)
    estimate = {"radius": 0.15, "alpha": 1.0}
    settings = settings_of(render={"method": method}, photons={"N": 400_000}, estimate=estimate)
    found = rendered(scene, settings, passes).frame(1).image().mean((0, 1))
    covered = RADIUS**2 / (RADIUS**2 + HEIGHT**2)
    assert found == pytest.approx(REFLECTANCE * (np.array(T) * covered + 1 - covered), rel=0.02)


@pytest.mark.parametrize("side", [4, -4])
@pytest.mark.parametrize("method", ["path", "progressive"])
def test_a_sheet_before_the_sky(method, side):
    sheet = Shape("sheet", Parallelogram((-1, -1, 0), (2, 0, 0), (0, 2, 0)), 0)
    camera = Camera((0, 0, side), (0, 0, 0), (0, 1, 0), 2.0, near=0.0, far=np.inf)
    scene = Scene("sheet", None, (sheet,), (PAPER,), SKY, camera, 24, 24)
    found = rendered(scene, settings_of(render={"method": method}), passes=16).frame(1).image().mean((0, 1))
    assert found == pytest.approx(np.array(T), rel=0.01)
