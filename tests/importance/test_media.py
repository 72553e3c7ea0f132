"""Importance and what goes by it in scenes with media."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.kernels.compile.jit import loaded
from pmviewer.scene.description import Camera, Medium, Parallelogram, PointLight, Shape
from tests.render.test_media import CAMERA, cube_of, picture
from tests.support.importon_paths import GATHER, SHOWN, traced
from tests.support.scenes import GREY, diffuse, rendered, settings_of

pytestmark = pytest.mark.usefixtures("any_light_in_media", "every_path_may_split")

WALL = Shape("wall", Parallelogram((-9, -9, -2), (18, 0, 0), (0, 18, 0)), 1)
LAMP = (PointLight("lamp", (0.5, 1.5, 3.0), (30.0, 30.0, 30.0)),)


def fog(sigma, albedo, camera=CAMERA, size=16):
    """A cube of it before a wall."""
    return cube_of(Medium("fog", sigma, albedo), LAMP, (WALL,), (diffuse(),), camera=camera, size=size)


@pytest.mark.parametrize(("z", "inside", "way"), [(4.0, -1, 2.0), (0.5, 0, 1.5)])
def test_media_weaken_importance(z, inside, way):
    """Head on through the cube, from outside and from within: exp(−σ s) of what reaches the wall without it."""
    camera = replace(CAMERA, origin=(0.0, 0.0, z), target=(0.0, 0.0, z - 1), fov=1.0, medium=inside)
    sigma = (0.4, 0.4, 0.4)
    found, _, _ = traced(fog(sigma, (0.5, 0.5, 0.5), camera), SHOWN, 2000)
    assert len(found.global_.weights) == 2000
    np.testing.assert_allclose(found.global_.positions[:, 2], -2, atol=1e-4)
    np.testing.assert_allclose(found.global_.weights, np.exp(-sigma[0] * way), rtol=1e-3)


def test_gather_rays_are_weakened_on_their_way_too():
    """Fog between walls: as many importons arrive as rays of a cosine lobe do, each with exp(−σ s) of it, by numpy's
    own rays."""
    sigma = 0.7
    walls = [
        Shape("floor", Parallelogram((-99, -99, -0.99), (198, 0, 0), (0, 198, 0)), 1),
        Shape("ceiling", Parallelogram((-99, -99, 0.99), (0, 198, 0), (198, 0, 0)), 1),
    ]
    camera = Camera((0, 0, 0), (0, 0, -1), (0, 1, 0), 1.0, medium=0)
    scene = cube_of(Medium("fog", (sigma,) * 3, (0.5,) * 3), LAMP, walls, (diffuse(),), half=100.0, camera=camera)
    found, _, _ = traced(scene, GATHER, 100_000)
    rng = np.random.default_rng(3)
    way = 1.98 / np.sqrt(rng.random(400_000))
    on_ceiling = found.global_.positions[:, 2] > 0.9
    expected = GREY * np.exp(-sigma * (0.99 + way)).mean()
    assert found.global_.weights[on_ceiling].sum() / found.N == pytest.approx(expected, rel=0.02)


def test_all_of_it_is_compiled_ahead(pool):
    """With the very records that passes have: another one would be an error, or a second compilation."""
    opened = open_scene(fog((0.8,) * 3, (0.9,) * 3))
    importance = {"map": "average", "N": 200, "deposition": "density control"}
    for method in ("progressive", "gather", "virtual lights"):
        settings = settings_of(render={"method": method}, photons={"N": 500}, importance=importance)
        prepare(opened, settings, pool, lambda text, share: None)
        before = loaded()
        Renderer(opened, settings, pool, StageStore(0)).step()
        assert loaded() == before


@pytest.mark.parametrize("rule", ["density control", "Keller-Wald"])
def test_rules_store_fewer_photons_and_show_the_same_fog(rule):
    """Surfaces go by the rule, media store all of their photons: the means of picture and of its light from media."""
    scene = fog((0.8,) * 3, (0.9,) * 3, size=12)
    asked = {"photons": {"N": 30_000}, "estimate": {"radius": 0.05}}
    plain = picture(scene, "progressive", 12, **asked)
    ruled = {**asked, "importance": {"map": "screen", "N": 20_000, "deposition": rule}}
    found = rendered(scene, settings_of(render={"method": "progressive", "max_depth": 1000}, **ruled), 12)
    frame = found.frame(0)
    assert not any("know of media" in warning for warning in frame.statistics.warnings)
    assert found.plan.judges
    assert frame.image().mean() == pytest.approx(plain.mean(), rel=0.02)
    in_media = picture(scene, "progressive", 12, view="volume indirect", **asked)
    assert frame.image("volume indirect").mean() == pytest.approx(in_media.mean(), rel=1e-5)
