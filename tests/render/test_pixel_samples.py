"""Several samples a pass where mirrors and glass are seen: the same picture, with less noise there."""

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.pass_data import blank_eye
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import resolve_camera
from pmviewer.render.mirrored import BLOCK, is_mirror, mirrored_pixels
from pmviewer.render.pixel_samples import MIRRORED
from pmviewer.render.planes import PLANES
from pmviewer.scene.description import Material
from tests.support import kinds
from tests.support.scenes import GLASS, MIRROR, cornell_box, diffuse_box, rendered, settings_of

SIZE = 24


def renderer(scene, pool, mirror_rays, **render):
    settings = settings_of(render={"method": "progressive", "mirror_rays": mirror_rays, **render}, photons={"N": 2000})
    return Renderer(scene, settings, pool, StageStore(0))


def test_the_mean_is_that_of_one_sample(pool):
    """Over 8 × 6 passes: alike within its error, less noisy in mirrors and glass, and the same everywhere else."""
    scene = open_scene(cornell_box(size=SIZE))
    pictures = []
    for samples in (1, 3):
        runs = []
        for seed in range(8):
            one = renderer(scene, pool, samples, seed=seed)
            for _ in range(6):
                one.step()
            runs.append(one.film.planes().astype(float))
        pictures.append(np.array(runs))
    marked = one.latest.marks.reshape(SIZE, SIZE) & MIRRORED != 0
    specular = [picture[..., PLANES["specular"]] for picture in pictures]
    one, several = (plane.mean(axis=(1, 2, 3)) for plane in specular)
    spreads = [plane.var(axis=0, ddof=1)[marked].sum() for plane in specular]
    assert 0.02 < marked.mean() < 0.6
    error = np.sqrt((one.var(ddof=1) + several.var(ddof=1)) / len(several))
    assert several.mean() == pytest.approx(one.mean(), abs=4 * error)
    assert 4 * error < 0.15 * several.mean()
    assert spreads[1] < 0.75 * spreads[0]
    assert np.array_equal(pictures[0][:, ~marked], pictures[1][:, ~marked])


def test_what_the_first_hits_are_is_a_mean_over_samples(pool):
    """A mirror fills the picture: its normal and distance, of one pass of four samples."""
    scene = cornell_box(size=SIZE)
    box = open_scene(replace(scene, materials=(MIRROR,) * len(scene.materials)))
    planes = []
    for samples in (1, 4):
        one = renderer(box, pool, samples)
        one.step()
        planes.append(one.film.planes())
    assert (one.latest.marks & MIRRORED != 0).mean() > 0.9
    flat = np.abs(np.linalg.norm(planes[1][..., PLANES["normal"]], axis=-1) - 1) < 1e-3
    assert flat.mean() > 0.5
    depth = [plane[..., PLANES["depth"]][flat] for plane in planes]
    assert depth[1] == pytest.approx(depth[0], rel=0.2)
    assert np.median(depth[1] / depth[0]) == pytest.approx(1.0, abs=0.01)


def test_what_shows_mirrors_is_marked():
    """All pixels of a small picture by their middles, blocks of a large one; against where balls are seen."""
    for size, side in ((48, 1), (256, BLOCK)):
        scene = open_scene(cornell_box(size=size))
        camera = resolve_camera(scene.scene, settings_of().camera)
        marks = mirrored_pixels(scene.flat, camera, 0.2).reshape(size, size)
        assert set(np.unique(marks)) == {0, MIRRORED}
        inner = marks[::side, ::side]
        assert np.array_equal(inner.repeat(side, axis=0).repeat(side, axis=1), marks)
        x, y = (side * (g.ravel() + 0.5) for g in np.meshgrid(*[np.arange(size // side)] * 2))
        o, d = camera.rays(x, y)
        seen = np.zeros(len(x), bool)
        for shape in scene.scene.shapes:
            if "ball" in shape.name:
                to = np.array(shape.geometry.center) - o
                along = (to * d).sum(axis=1)
                seen |= (to**2).sum(axis=1) - along**2 < shape.geometry.radius**2
        assert np.array_equal(inner.ravel() == MIRRORED, seen)
    assert mirrored_pixels(open_scene(diffuse_box()).flat, camera, 0.2).shape == (0,)


def test_mirrors_are_what_stores_no_photons():
    assert is_mirror(MIRROR, 0.2)
    assert is_mirror(GLASS, 0.2)
    assert not is_mirror(Material("wall", "diffuse"), 0.2)
    assert not is_mirror(Material("coat", "plastic", specular=(1.0,) * 3), 0.2)
    rough = Material("metal", "rough conductor", alpha=(0.1, 0.1))
    assert is_mirror(rough, 0.2)
    assert not is_mirror(rough, 0.05)


def test_where_it_does_nothing_it_says_why():
    plain, box = open_scene(diffuse_box()).traits, open_scene(cornell_box()).traits
    assert inactive_reason("render.mirror_rays", settings_of(), plain) == "No mirror or glass in this scene."
    assert inactive_reason("render.mirror_rays", settings_of(), box) is None
    for values in (
        {"gather": {"estimation": "on"}, "render": {"method": "gather"}},
        {"render": {"method": "virtual lights"}},
        {"estimate": {"radius_rule": "pixel"}},
    ):
        assert "One sample" in inactive_reason("render.mirror_rays", settings_of(**values), box)
    view = "display.view=samples a pass"
    assert inactive_reason(view, settings_of(), plain) is None
    assert "one sample a pass" in inactive_reason(view, settings_of(render={"edge_rays": 1}), plain)
    assert inactive_reason(view, settings_of(render={"adaptive": "on", "edge_rays": 1}), plain) is None


def test_kernels_for_mirrors_and_glass_show_a_room_without_them_as_it_is(monkeypatch):
    """Other tests' scenes are opened so, for one variant of kernels (`tests.support.kinds`); rounding is theirs."""
    settings = settings_of(photons={"N": 2000})
    plain = rendered(diffuse_box(size=16), settings, 2)
    kinds.may_always_split(monkeypatch)
    other = rendered(diffuse_box(size=16), settings, 2)
    assert {"mirror_rays", "splits"} <= set(blank_eye(settings, other.plan).dtype.names)
    assert "splits" not in blank_eye(settings, plain.plan).dtype.names
    np.testing.assert_allclose(other.film.sums, plain.film.sums, rtol=1e-4, atol=1e-6)
