"""The importance stage of the renderer: switched by settings, the same whoever asks, and without effect when off."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.record import unpack
from pmviewer.scene.description import Scene
from tests.support.scenes import MIRROR, box_walls, cornell_box, diffuse, panel, rendered, settings_of

SIZE = 16


def settings(method="gather", map="average", **importance):
    return settings_of(render={"method": method}, photons={"N": 2000}, importance={"map": map, "N": 1500, **importance})


def test_off_computes_nothing_and_on_changes_no_pixel():
    off = rendered(cornell_box(size=SIZE), settings(map="off"), 2)
    on = rendered(cornell_box(size=SIZE), settings(), 2)
    assert off.importance.latest is None
    assert "importance" not in off.tally.stage_seconds
    assert "importance" in on.tally.stage_seconds
    assert "importons" not in off.frame(1).clouds
    assert off.frame(1).statistics.importons == 0
    np.testing.assert_array_equal(off.film.sums, on.film.sums)
    path = rendered(cornell_box(size=SIZE), settings("path"), 1)
    assert path.importance.latest is None
    assert not path.plan.importance


def test_passes_depend_on_their_number_alone(pool):
    """Refined up to the fourth pass; the same after a coarse frame, with a cache, and with other threads."""
    scene = open_scene(cornell_box(size=SIZE))
    one = rendered(scene, settings(), 1)
    four, six = rendered(scene, settings(), 4), rendered(scene, settings(), 6, threads=3)
    assert [r.importance.latest.traced for r in (one, four, six)] == [1500, 6000, 6000]
    other = Renderer(scene, settings(), pool, StageStore(1 << 28))
    other.coarse_frame(1)
    assert other.importance.latest is None
    for _ in range(4):
        other.step()
    for renderer in (six, other):
        for name in ("caustic", "global_"):
            mine, theirs = (getattr(r.importance.latest, name) for r in (four, renderer))
            np.testing.assert_array_equal(mine.gamma, theirs.gamma)
            np.testing.assert_array_equal(mine.positions, theirs.positions)


def test_maps_by_method():
    scene = open_scene(cornell_box(size=SIZE))
    gather = rendered(scene, settings("gather"), 1).importance.latest
    shown = rendered(scene, settings("progressive"), 1).importance.latest
    assert gather.caustic is not gather.global_
    assert set(gather.maps) == {"caustic", "global"}
    assert shown.caustic is shown.global_
    assert set(shown.maps) == {"global"}
    np.testing.assert_allclose(np.sort(shown.global_.weights), np.sort(gather.caustic.weights))
    no_caustics = Scene("d", None, (*box_walls(), panel()), (diffuse(),), (), cornell_box().camera, SIZE, SIZE)
    plain = rendered(no_caustics, settings("gather"), 1).importance.latest
    assert plain.caustic is None
    assert plain.record("caustic").dtype.names == ("absent",)


def test_cloud_and_statistics():
    renderer = rendered(cornell_box(size=SIZE), settings(), 1)
    frame, maps = renderer.frame(1), renderer.importance.latest
    cloud = frame.clouds["importons"]
    photons = unpack(cloud.photons, cloud.power_unit)
    assert frame.statistics.stored_in_pass["importons"] == maps.n == len(cloud.photons)
    assert frame.statistics.importons == 1500
    for light, made in enumerate((maps.caustic, maps.global_)):
        chosen = photons["light"] == light
        np.testing.assert_allclose(photons["Phi"][chosen, 0], made.gamma, rtol=1e-3)


@pytest.mark.parametrize("name", ["caustic", "global"])
def test_views(name, pool):
    renderer = Renderer(open_scene(cornell_box(size=SIZE)), settings(M_r=3.0, caustic_M_r=50.0), pool, StageStore(0))
    renderer.step()
    planes = renderer.inspect(Wanted("importance", name)).planes
    gamma, density = planes["importance"], planes["required density"]
    assert gamma.shape == (SIZE, SIZE, 1)
    seen = gamma >= 0
    assert seen.mean() > 0.9
    assert (gamma[seen] > 0).mean() > 0.9
    np.testing.assert_allclose(density[seen], gamma[seen] * (50.0 if name == "caustic" else 3.0), rtol=1e-5)


def test_view_refused_and_settings_greyed_while_off():
    scene = open_scene(cornell_box(size=SIZE))
    off, on = settings(map="off"), settings()
    assert "importance.map" in inactive_reason("display.view=required density", off, scene.traits)
    assert inactive_reason("display.view=required density", on, scene.traits) is None
    for path in ("importance.N", "importance.M_r", "importance.caustic_M_r", "overlays.importons.show"):
        assert inactive_reason(path, off, scene.traits) is not None
        assert inactive_reason(path, on, scene.traits) is None
    assert inactive_reason("importance.map", off, scene.traits) is None
    assert inactive_reason("importance.map", settings("path"), scene.traits) is not None


@pytest.mark.parametrize("method", ["gather", "progressive"])
def test_a_camera_that_sees_mirrors_alone(method):
    """It renders, with a sentence."""
    walls = box_walls(1.0, (1,) * 6)
    outside = replace(cornell_box().camera, origin=(0.0, 0.0, 0.5), target=(0.0, 0.0, 0.0), fov=40.0)
    hidden = box_walls(0.2)  # a box of diffuse walls that the camera is not in, behind the mirror
    moved = tuple(replace(s, geometry=replace(s.geometry, corner=(*s.geometry.corner[:2], -5.0))) for s in hidden)
    scene = Scene("mirrors", None, (*walls, panel(), *moved), (diffuse(albedo=(0.5,) * 3), MIRROR), (), outside, 8, 8)
    shapes = [replace(s, material=2) if s.name == "panel" else s for s in scene.shapes]
    black = diffuse("black", (0.0, 0.0, 0.0))
    scene = replace(scene, shapes=tuple(shapes), materials=(*scene.materials, black))
    renderer = rendered(scene, settings(method), 1)
    assert np.isfinite(renderer.frame(1).image()).all()
    assert renderer.importance.latest.n == 0
    assert any("importons" in warning for warning in renderer.frame(1).statistics.warnings)
