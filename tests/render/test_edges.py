"""Two samples a pass where edges cross pixels: which pixels these are, and the same picture with less noise there."""

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.edges import edged_pixels
from pmviewer.render.pixel_samples import EDGED
from pmviewer.scene.description import Camera, Disk, Parallelogram, PointLight, Scene, Shape, Sphere
from tests.support.scenes import box_camera, box_walls, diffuse, diffuse_box, settings_of

SIZE = 64
LAMP = PointLight("lamp", (0.0, 0.0, 0.9), (1.0,) * 3)


def facing_wall(*shapes, camera=None, materials=2):
    """A wall across the view one unit away, filling it, with more in front of it."""
    camera = camera or Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0, 1, 0), 53.0, near=0.0, far=np.inf)
    wall = Shape("wall", Parallelogram((-9.0, -9.0, 0.0), (18.0, 0.0, 0.0), (0.0, 18.0, 0.0)), 0)
    colours = tuple(diffuse(f"{n}", (0.1 + 0.3 * n,) * 3) for n in range(materials))
    return open_scene(Scene("wall", None, (wall, *shapes), colours, (LAMP,), camera, SIZE, SIZE))


def marked(scene, size=SIZE, **lens):
    camera = replace(resolve_camera(scene.scene, settings_of().camera), width=size, height=size, **lens)
    found = edged_pixels(scene.flat, camera)
    return found.reshape(size, size) == EDGED if len(found) else np.zeros((size, size), bool), camera


def disc(radius, z, material=1):
    return Shape("disc", Disk((0.0, 0.0, z), (0.0, 0.0, 1.0), radius), material)


def covered(camera: CameraPose, radius, z):
    """How many of 256 places in each pixel a disc around the axis covers, as a share, by its circle in the picture."""
    size = camera.width
    x, y = np.meshgrid(*[(np.arange(16 * size) + 0.5) / 16] * 2)
    half = size / 2
    inside = np.hypot(x - half, y - half) < half * radius / ((1.0 - z) * np.tan(np.radians(camera.fov) / 2))
    return inside.reshape(size, 16, size, 16).mean(axis=(1, 3))


@pytest.mark.parametrize("size", [48, 64, 300])
def test_the_rim_of_a_disc_is_marked(size):
    """Pixels that it covers in part, against its circle in the picture; hardly any others, by squares of one pixel and
    of four."""
    found, camera = marked(facing_wall(disc(0.2, 0.3)), size)
    share = covered(camera, 0.2, 0.3)
    partly = (share > 0.1) & (share < 0.9)
    assert partly.sum() > 50
    assert found[partly].mean() > 0.95
    assert found[(share == 0) | (share == 1)].sum() < 0.1 * partly.sum()


def test_nothing_crosses_what_is_smooth():
    """A wall, a disc of its material that hardly stands off it, and a round ball's inside."""
    assert not marked(facing_wall())[0].any()
    assert not marked(facing_wall(disc(0.2, 1e-4, material=0)))[0].any()
    ball = Shape("ball", Sphere((0.0, 0.0, 0.0), 3.0), 0)
    inside = Camera((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0, 1, 0), 53.0, near=0.0, far=np.inf)
    assert not marked(open_scene(Scene("ball", None, (ball,), (diffuse(),), (LAMP,), inside, SIZE, SIZE)))[0].any()


def test_materials_corners_and_depth_are_edges_each():
    """A disc of another material in the wall's plane, one of the same that floats before it; and where walls meet."""
    flat, before = marked(facing_wall(disc(0.2, 1e-4)))[0], marked(facing_wall(disc(0.2, 0.3, material=0)))[0]
    assert flat.sum() > 30
    assert before.sum() > 50
    walls = open_scene(Scene("box", None, box_walls(1.0), (diffuse(),), (LAMP,), box_camera(), SIZE, SIZE))
    corners = marked(walls)[0]
    assert 0.02 < corners.mean() < 0.15
    assert corners[SIZE // 2].sum() in (2, 3, 4), "two corners of the back wall, or pixels that they touch"


def test_beyond_the_near_plane_and_in_focus():
    """What is cut away has no edge; and what a lens blurs over many pixels is none."""
    scene = facing_wall(disc(0.2, 0.3))
    assert marked(scene)[0].any()
    assert not marked(scene, near=0.8)[0].any()
    assert marked(scene, aperture=0.05, focus=0.7)[0].any()
    assert not marked(scene, aperture=0.5, focus=1.0)[0].any()


def test_pixels_that_lie_apart_have_corners_of_their_own():
    """A quarter as wide, they are crossed a quarter as often."""
    scene = facing_wall(disc(0.2, 0.3))
    whole, apart = (marked(scene, pixel_side=side)[0].sum() for side in (1.0, 0.25))
    assert 0.15 * whole < apart < 0.4 * whole


def test_where_most_of_the_picture_is_edges_none_are_marked():
    scene = facing_wall(*[disc(0.02 * n, 0.3 - 0.01 * n, n % 2) for n in range(1, 24)])
    camera = resolve_camera(scene.scene, settings_of().camera)
    share = (edged_pixels(scene.flat, camera) != 0).mean()
    assert 0.2 < share < 0.9
    assert edged_pixels(scene.flat, camera, 0.1).shape == (0,)
    assert (edged_pixels(scene.flat, camera, float(share)) != 0).mean() == share


def test_noise_falls_at_edges_and_the_mean_stays(pool):
    """Direct light of two passes, 16 seeds, without and with: elsewhere the same bit for bit, at edges the mean within
    its error and half of the variance."""
    scene = open_scene(diffuse_box(size=32))
    runs = {}
    for rays in (1, 2):
        pictures = []
        for seed in range(16):
            settings = settings_of(
                render={"method": "gather", "edge_rays": rays, "seed": seed}, photons={"N": 300}, direct={"samples": 8}
            )
            one = Renderer(scene, settings, pool, StageStore(0))
            one.step()
            one.step()
            pictures.append(one.frame(0).image("direct").astype(float))
        runs[rays] = np.array(pictures)
    edged = one.latest.marks.reshape(32, 32) & EDGED != 0
    assert np.array_equal(runs[1][:, ~edged], runs[2][:, ~edged])
    means = [run[:, edged].mean(axis=(1, 2)) for run in runs.values()]
    error = np.hypot(*[mean.std(ddof=1) / 4 for mean in means])
    assert means[1].mean() == pytest.approx(means[0].mean(), abs=4 * error)
    spread = [run[:, edged].var(axis=0, ddof=1).sum() for run in runs.values()]
    print(f"variance at edges {spread[1] / spread[0]:.2f} of that with one sample")
    assert spread[1] < 0.6 * spread[0]
