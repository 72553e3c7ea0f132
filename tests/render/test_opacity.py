"""What rays that pass surfaces do to pictures, where it is known without another renderer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    Group,
    Instance,
    Material,
    Mesh,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.scene.texture import Bitmap, Checkerboard
from tests.support.scenes import diffuse, rendered, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

BLACK = diffuse("black", (0.0, 0.0, 0.0))
FIELDS = Checkerboard((1.0,) * 3, (0.25,) * 3, (2.0, 0, 0, 0, 2.0, 0))
GREY_FIELDS = Checkerboard((2.0, 1.0, 0.5), (0.5, 0.25, 0.125), (2.0, 0, 0, 0, 2.0, 0))
"""What a light of radiance (2, 1, ½) under `FIELDS` shows."""


def lamp_scene(lamp, radiance=(2.0, 1.0, 0.5), emission=None, camera=None, size=16):
    """A white floor below a square lamp of the material `lamp`, in the dark."""
    floor = Parallelogram((-1, 0, -1), (0, 0, 2), (2, 0, 0))
    light = Parallelogram((-0.6, 1.0, -0.6), (1.2, 0, 0), (0, 0, 1.2))
    shapes = (Shape("floor", floor, 0), Shape("lamp", light, 1, radiance, emission))
    camera = camera or Camera((0, 0.6, 3.0), (0, 0.1, 0), (0, 1, 0), 40.0)
    return Scene("lamp", None, shapes, (diffuse(albedo=(0.8,) * 3), lamp), (), camera, size, size)


@pytest.mark.parametrize(
    ("kind", "method"),
    [("constant", "path"), ("constant", "progressive"), ("texture", "path"), ("both textures", "path")],
)
def test_a_lights_opacity_dims_it(method, kind):
    """Seen by itself and by what it shines on, it is a light of its radiance times its opacity."""
    if kind == "constant":
        ours, twin = lamp_scene(replace(BLACK, opacity=0.4)), lamp_scene(BLACK, (0.8, 0.4, 0.2))
    elif kind == "texture":
        ours = lamp_scene(replace(BLACK, textures={"opacity": FIELDS}))
        twin = lamp_scene(BLACK, GREY_FIELDS.mean, GREY_FIELDS)
    else:
        white = Bitmap(np.ones((4, 4, 1), np.float32), scale=(2.0, 1.0, 0.5))
        ours = lamp_scene(replace(BLACK, textures={"opacity": FIELDS}), emission=white)
        twin = lamp_scene(BLACK, GREY_FIELDS.mean, GREY_FIELDS)
    floor, upwards = (
        Camera((0, 0.9, 3.0), (0, 0, 0), (0, 1, 0), 20.0),
        Camera((0.1, 0.1, 0.2), (0, 1, 0), (0, 0, 1), 50.0),
    )
    passes = 64 if method == "path" else 32
    for camera, tolerance in ((floor, 0.015), (upwards, 0.03)):
        settings = settings_of(render={"method": method}, photons={"N": 5000})
        a, b = (rendered(replace(s, camera=camera), settings, passes).frame(0).image() for s in (ours, twin))
        assert a.mean(axis=(0, 1)) == pytest.approx(b.mean(axis=(0, 1)), rel=tolerance)


def test_what_stands_behind_a_light_shines_through():
    """Two lamps behind each other: opacity times the first and the rest of the second."""
    near = lamp_scene(replace(BLACK, opacity=0.3), (5.0, 1.0, 0.0))
    behind = Shape("behind", Parallelogram((-3, 2.0, -3), (6, 0, 0), (0, 0, 6)), 2, (0.0, 1.0, 2.0))
    camera = Camera((0.0, 0.1, 0.0), (0, 1, 0), (0, 0, 1), 20.0)
    scene = replace(near, shapes=(near.shapes[1], behind), materials=(*near.materials, BLACK), camera=camera)
    for method in ("path", "progressive"):
        image = rendered(scene, settings_of(render={"method": method}), 64).frame(0).image()
        assert image.mean(axis=(0, 1)) == pytest.approx([1.5, 1.0, 1.4], rel=0.02)


def test_a_light_that_is_nowhere_opaque_is_none():
    unseen = lamp_scene(replace(BLACK, opacity=0.2, alpha_cutoff=0.5))
    sky = replace(unseen, lights=(ConstantEnvironment("sky", (1.0,) * 3),))
    opened = open_scene(sky)
    assert len(opened.flat.lights) == 1
    assert opened.scene.shapes[1].radiance is None
    assert rendered(opened, settings_of(render={"method": "path"}), 2).frame(0).image().mean() > 0.1


@pytest.mark.parametrize("method", ["path", "progressive", "gather"])
def test_white_furnace(method):
    """White surfaces that let light pass, in a white sky, can't be seen."""
    veil = Material("veil", "diffuse", (1.0,) * 3, two_sided=True, opacity=0.35)
    ball, sheet = Sphere((0, 0, 0), 1.0), Parallelogram((-2, -0.5, -2), (0, 0, 4), (4, 0, 0))
    sky = (ConstantEnvironment("sky", (1.0,) * 3),)
    camera = Camera((0, 1, 4), (0, 0, 0), (0, 1, 0), 50.0)
    scene = Scene("furnace", None, (Shape("ball", ball, 0), Shape("sheet", sheet, 0)), (veil,), sky, camera, 24, 24)
    settings = settings_of(render={"method": method, "max_depth": 200}, photons={"N": 40_000, "max_bounces": 200})
    image = rendered(scene, settings, 24).frame(0).image()
    assert image.mean() == pytest.approx(1.0, abs=0.01)


def test_glass_that_absorbs_is_named():
    glass = Material("brandy", "dielectric", opacity=0.5, absorption=(1.0, 0.0, 0.0))
    scene = lamp_scene(BLACK)
    scene = replace(scene, shapes=(*scene.shapes, Shape("ball", Sphere((0, 0.4, 0), 0.2), 2)))
    found = open_scene(replace(scene, materials=(*scene.materials, glass))).scene.warnings
    assert any("'brandy'" in warning and "opacity" in warning for warning in found)


def test_light_inside_glass_is_weakened_by_its_way_though_it_passes_a_veil():
    """A sheet that lets everything pass, in a slab of absorbing glass, changes nothing."""
    glass = Material("glass", "dielectric", eta=1.0001, absorption=(2.0, 0.5, 0.0))
    slab = [
        Shape("top", Parallelogram((-3, 0.5, -3), (0, 0, 6), (6, 0, 0)), 2),
        Shape("bottom", Parallelogram((-3, 0.1, -3), (6, 0, 0), (0, 0, 6)), 2),
    ]
    veil = Shape("veil", Parallelogram((-3, 0.3, -3), (0, 0, 6), (6, 0, 0)), 3)
    lamp = Shape("lamp", Parallelogram((-3, -0.5, -3), (0, 0, 6), (6, 0, 0)), 1, (1.0,) * 3)
    camera = Camera((0, 2.0, 0), (0, 0, 0), (0, 0, 1), 2.0)
    nothing = replace(diffuse("veil", (1.0,) * 3), opacity=0.0)
    scene = Scene("slab", None, (*slab, veil, lamp), (diffuse(), BLACK, glass, nothing), (), camera, 4, 4)
    image = rendered(scene, settings_of(render={"method": "path"}), 8).frame(0).image()
    assert image.mean(axis=(0, 1)) == pytest.approx(np.exp(-0.4 * np.array([2.0, 0.5, 0.0])), rel=2e-3)


@pytest.mark.extensive
def test_colours_at_vertices_multiply_the_reflectance_of_copies_and_textures():
    """A copied sheet under a white sky: its radiance is reflectance · texture · colour, linear between corners."""
    corners = np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]], float)
    colours = np.array([[1, 0, 0.2], [1, 0, 0.6], [0, 1, 0.6], [0, 1, 0.2]], float)
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), uv=corners[:, [0, 2]], colours=colours)
    texture = Bitmap(np.full((2, 2, 1), 0.5, np.float32), scale=(1.0, 1.0, 0.8))
    sky = (ConstantEnvironment("sky", (1.0,) * 3),)
    camera = Camera((0, 4, 0), (0, 0, 0), (0, 0, -1), 0.0, projection="orthographic", width=4.0)
    shift = np.eye(4)
    shift[:3, 3] = [0.5, 1.0, 0.0]
    for materials in (
        (replace(diffuse("d", (0.5, 0.5, 0.4)), vertex_colours=True),),
        (replace(diffuse("d", (0.5, 0.5, 0.4)), vertex_colours=True, textures={"reflectance": texture}),),
    ):
        group = Group("g", (Shape("s", mesh, 0),))
        scene = Scene("c", None, (), materials, sky, camera, 64, 64, instances=(Instance("i", group, shift),))
        image = rendered(scene, settings_of(render={"method": "path"}), 64).frame(0).image()
        x = (np.arange(64) + 0.5) / 16 - 2  # of the pixels' middles; the picture shows x to the right and z down
        inside = np.abs(x - 0.5) < 0.9
        rows = image[np.abs(x) < 0.9]
        across = rows.mean(axis=0)[inside]
        share = (x[inside] - 0.5 + 1) / 2
        np.testing.assert_allclose(across[:, 0], 0.5 * (1 - share), atol=2e-3)
        np.testing.assert_allclose(across[:, 1], 0.5 * share, atol=2e-3)
        down = image[np.abs(x) < 0.9][:, inside].mean(axis=1)
        np.testing.assert_allclose(down[:, 2], 0.4 * (0.4 + 0.2 * x[np.abs(x) < 0.9]), atol=2e-3)
