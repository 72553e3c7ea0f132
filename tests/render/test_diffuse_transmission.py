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


@pytest.mark.parametrize(("method", "photons"), [("path", 0), ("progressive", 400_000), ("gather", 20_000)])
def test_a_sheet_lights_the_floor_below_it(method, photons):
    """The floor under a disc sees the sheet's T in the share R²/(R² + h²) of its cosines, and the sky in the rest. What
    looks photons up on the floor itself sees few of them, gather rays all that are on the sheet."""
    floor = Parallelogram((-0.25, 0, 0.25), (0.5, 0, 0), (0, 0, -0.5))
    shapes = (
        Shape("floor", floor, 1),
        Shape("sheet", Disk((0, HEIGHT, 0), (0, 1, 0), RADIUS), 0),
    )
    grey = Material("grey", "diffuse", (REFLECTANCE,) * 3)
    camera = Camera((0, 0.5, 0), (0, 0, 0), (0, 0, 1), 10.0, near=0.0, far=np.inf)
    scene = Scene("sheet", None, shapes, (PAPER, grey), SKY, camera, 24, 24)
    groups = {"photons": {"N": photons}, "estimate": {"radius": 0.15, "alpha": 1.0}} if photons else {}
    settings = settings_of(render={"method": method}, **groups)
    found = rendered(scene, settings, passes=12 if photons else 32).frame(1).image().mean((0, 1))
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
