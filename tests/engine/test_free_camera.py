"""The free camera shows what was made for the render camera: nothing is traced for it, and it is off by default."""

from __future__ import annotations

import numpy as np
import pytest

import pmviewer.engine.stages.importance as importance_stage
import pmviewer.engine.stages.tracer as tracer
from pmviewer.commands.job import load_job
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import SettingError
from pmviewer.output.session_file import read_session, write_session
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.free_camera import frustum_lines, plan_pose, resolve_view
from pmviewer.settings.access import SETTINGS, FreeCamera, Settings, changed_stages, with_values
from tests.support.scenes import cornell_box, rendered, settings_of

SIZE = 24


def settings(**free):
    return settings_of(
        render={"method": "progressive"},
        photons={"N": 3000},
        importance={"map": "average", "N": 1500, "deposition": "Keller-Wald"},
        free_camera=free,
    )


def test_importance_photons_and_radii_are_the_render_cameras():
    scene = open_scene(cornell_box(size=SIZE))
    own, free = (rendered(scene, settings(on=on), 2) for on in (False, True))
    assert free.render_camera == own.camera
    assert free.camera != own.camera
    assert free.first_radius == own.first_radius
    for name in ("caustic", "global_"):
        mine, theirs = (getattr(r.importance.latest, name) for r in (own, free))
        np.testing.assert_array_equal(mine.gamma, theirs.gamma)
        np.testing.assert_array_equal(getattr(own.light.photons, name), getattr(free.light.photons, name))
    assert not np.array_equal(own.film.sums, free.film.sums)
    assert np.isfinite(free.film.sums).all()


def test_moving_it_traces_nothing(monkeypatch):
    scene, pool, cache = open_scene(cornell_box(size=SIZE)), WorkPool(2), StageStore(1 << 28)
    try:
        for origin in ((0.0, 0.9, 0.9), (0.5, 0.5, 0.5), (0.0, 4.0, 0.1)):
            renderer = Renderer(scene, settings(on=True, origin=origin), pool, cache)
            renderer.coarse_frame(1)
            renderer.step()
            assert renderer.camera.origin == origin

            def refused(*_, **__):
                raise AssertionError("traced again")

            monkeypatch.setattr(importance_stage, "trace", refused)
            monkeypatch.setattr(tracer, "trace_pass", refused)
        moved = settings(on=True).model_copy(update={"camera": settings_of(camera={"origin": (0, 0, 0.5)}).camera})
        with pytest.raises(AssertionError, match="traced again"):
            Renderer(scene, moved, pool, cache).step()
    finally:
        pool.close()


def test_off_its_settings_change_nothing():
    scene = open_scene(cornell_box(size=SIZE))
    renderer = rendered(scene, settings(origin=(0, 0, 0.5), cut_height=-1.0), 1)
    assert renderer.camera is not None
    assert renderer.camera == renderer.render_camera == resolve_camera(scene.scene, Settings().camera)
    paths = [path for path in SETTINGS if path.startswith("free_camera.") and path != "free_camera.on"]
    for path in paths:
        assert inactive_reason(path, settings(), scene.traits) is not None
        assert inactive_reason(path, settings(on=True), scene.traits) is None
    assert inactive_reason("free_camera.cut_height", settings(on=True, cut=False), scene.traits) is not None
    assert changed_stages(settings(on=True), settings(on=True, frustum=False, length=0.5)) == {"display"}


@pytest.mark.parametrize("mirrored", [False, True])
def test_frustum_ends_at_the_corners_of_the_image(mirrored):
    camera = CameraPose((1, 2, 3), (0.5, 2.2, -4), (0.1, 1, 0), 50.0, 80, 60, mirrored=mirrored)
    lines = frustum_lines(camera, 2.5).reshape(-1, 2, 3)
    edges = lines[:4]
    np.testing.assert_allclose(edges[:, 0], [camera.origin] * 4)
    x, y, depth = camera.project(edges[:, 1]).T
    np.testing.assert_allclose(depth, 2.5)
    np.testing.assert_allclose(np.stack([x, y], 1), [(0, 0), (80, 0), (80, 60), (0, 60)], atol=1e-9)
    assert (camera.project(lines[-2:].reshape(-1, 3))[:, 1] < 0).all(), "the mark of up is above the image"


def test_cut_open_from_above():
    """Nothing is seen above the cut, by rays and in the window's matrices alike; from below it everything is."""
    scene = open_scene(cornell_box(size=SIZE))
    height = 0.2
    cut = settings(on=True, cut_height=height / scene.flat.radius)
    renderer = rendered(scene, cut, 1)
    pose = renderer.camera
    depth = renderer.frame(1).image("depth")[..., 0]
    frame = pose.ray_frame()
    y, x = np.mgrid[0:SIZE, 0:SIZE] + 0.5
    heights = (frame[0] + depth[..., None] * (frame[1] + x[..., None] * frame[2] + y[..., None] * frame[3]))[..., 1]
    assert (depth > 0).mean() > 0.1
    assert heights[depth > 0].max() < height + 0.2, "a pixel's rays differ by less than a pixel"
    assert heights[depth > 0].min() < -0.9, "one looks down to the floor"

    points = np.random.default_rng(1).uniform(-1, 1, (500, 3))
    matrix = pose.cut_projection(0.1, 20.0) @ pose.view_matrix()
    clip = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    inside = (np.abs(clip[:, :2]) < clip[:, 3:]).all(axis=1)
    assert inside.sum() > 100
    np.testing.assert_array_equal(clip[inside, 2] > -clip[inside, 3], points[inside, 1] < height)
    assert (clip[inside, 2] < clip[inside, 3]).all(), "nothing falls out at the far end"

    assert resolve_view(scene.scene, with_values(cut, {"free_camera.cut": False}), np.zeros(3), 1.7).near == 0
    below = with_values(cut, {"free_camera.origin": (0.5, 0.1, 0.9)})
    assert resolve_view(scene.scene, below, np.zeros(3), 1.7).near_normal is None


@pytest.mark.parametrize("target", [(0, -5, 0), (0, 5, 0), (1e-9, -5, 1e-9), (3, 4, 5), (0, 0, -1e9)])
@pytest.mark.parametrize("up", [(0, 1, 0), (0, 0, 1), (1, 1, 1), (0, 0, 0)])
def test_automatic_views_are_well_formed(target, up):
    render = CameraPose((0, 0, 0), target, up, 170.0, 7, 3000)
    scene = cornell_box(size=SIZE)
    for pose in (plan_pose(render, np.array([100.0, 0, 0]), 1.0), plan_pose(render, np.zeros(3), 1e6)):
        assert np.isfinite(pose.ray_frame()).all()
        assert np.isfinite(pose.project(np.array([render.origin]))).all()
    camera = {"camera.origin": render.origin, "camera.target": target, "camera.up": up}
    asked = with_values(settings(on=True), camera)
    assert np.isfinite(resolve_view(scene, asked, np.zeros(3), 1.7).ray_frame()).all()


def test_origin_in_its_target_is_refused():
    same = settings(on=True, origin=(1, 2, 3), target=(1, 2, 3))
    with pytest.raises(SettingError, match="coincide"):
        rendered(open_scene(cornell_box(size=SIZE)), same, 1)
    assert resolve_view(cornell_box(size=SIZE), settings(on=True, origin=(0, 0, 0)), np.zeros(3), 1.7).axes()


def test_session_file_and_command_line(tmp_path):
    assignments = ["free_camera.on=true", "free_camera.origin=0 3.5 1e-3", "free_camera.cut_height=0.5"]
    job = load_job("cornell_caustic", [*assignments, "free_camera.frustum=false", "free_camera.fov=60"], [])
    expected = FreeCamera(on=True, origin=(0, 3.5, 1e-3), cut_height=0.5, frustum=False, fov=60)
    assert job.settings.free_camera == expected
    write_session(tmp_path / "a.toml", job.settings, "cornell_caustic", 3)
    assert read_session(tmp_path / "a.toml").settings.free_camera == expected
