"""Taking hold of objects in the real window: Shift+click, handles, the tab "Scene", undo."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest
from imgui_bundle import ImVec2, imgui
from imgui_bundle import icons_fontawesome_6 as fa

from pmviewer.viewer.panels.received_rows import rows_of
from pmviewer.viewer.panels.scene_panel import SCENE
from tests.viewer.driver import app_on_engine, drag, drive, finished, wait_until

SMALL = {"camera.width": 96, "camera.height": 96, "render.passes": 2, "photons.N": 2000}


def on_screen(app, point):
    """Where in the window a point of the scene is seen."""
    camera = app.viewport.shown_camera()
    left, top, width, height = app.viewport.rectangle()
    x, y, _ = camera.project(np.asarray(point, float)[None])[0]
    return ImVec2(
        app.viewport.origin[0] + left + x * width / camera.width,
        app.viewport.origin[1] + top + y * height / camera.height,
    )


def shift_click(context, at):
    context.mouse_move_to_pos(at)
    context.key_down(imgui.Key.mod_shift)
    context.yield_(2)
    context.mouse_click(0)
    context.key_up(imgui.Key.mod_shift)
    context.yield_(6)


def test_an_object_is_taken_hold_of_moved_and_put_back(tmp_path):
    """The glass ball of the Cornell box: its middle is (0.3, 0.18, 0.33) in the file."""
    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state, editing = app.state, app.state.editing
            wait_until(c, lambda: finished(app))
            plain, pose = state.frame.image(), state.live_camera()
            shift_click(c, on_screen(app, (0.3, 0.18, 0.33)))
            assert editing.chosen is not None
            assert editing.chosen.key == "sphere (line 24)"
            assert np.allclose(editing.middle(editing.chosen), (0.3, 0.18, 0.33))
            assert c.item_info(f"//{SCENE}/**/handles").id_ != 0, "the tab came to the front"
            start = on_screen(app, (0.3, 0.18, 0.33))
            c.mouse_move_to_pos(start)
            c.yield_(3)
            assert app.viewport.gizmo.wants_mouse
            c.mouse_down(0)
            for step in range(1, 9):
                c.mouse_move_to_pos(ImVec2(start.x - 5 * step, start.y - 4 * step))
                c.yield_(2)
            c.mouse_up(0)
            c.yield_(3)
            (name,) = state.settings.edit.changes
            assert name == "object.sphere (line 24).move"
            x, y, z = state.settings.edit.changes[name]
            camera = state.live_camera()
            assert camera == pose, "the handles move the ball, not the camera"
            seen = on_screen(app, (0.3 + x, 0.18 + y, 0.33 + z))
            assert abs(seen.x - start.x + 40) < 3
            assert abs(seen.y - start.y + 32) < 3, "the ball follows the mouse"
            assert [step.name.partition("=")[0] for step in state.history.done] == [name], "a drag is one step"
            wait_until(c, lambda: finished(app) and state.frame.settings.edit.changes)
            assert not np.array_equal(state.frame.image(), plain)
            assert state.comparison.problem(state.frame) is not None, "its reference is of the scene as it was"
            state.undo()
            wait_until(c, lambda: finished(app) and not state.frame.settings.edit.changes)
            assert np.array_equal(state.frame.image(), plain)
            shift_click(c, ImVec2(on_screen(app, (0.3, 0.18, 0.33)).x + 22, start.y + 22))
            assert editing.chosen is None, "another Shift+click lets go"

        drive(app, script)


def test_the_tab_edits_and_resets(tmp_path):
    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state, editing = app.state, app.state.editing
            wait_until(c, lambda: finished(app))
            lamp = editing.catalogue.targets["light"][0]
            editing.choose(lamp)
            c.yield_(8)
            drag(c, f"//{SCENE}/**/##light.1.power", 0.5, 0.7)
            power = state.settings.edit.changes["light.rectangle (line 25).power"][0]
            assert power > 1.2
            wait_until(c, lambda: finished(app) and state.frame.settings.edit.changes)
            assert editing.is_edited(lamp, "power")
            assert not editing.is_edited(lamp, "colour")
            c.item_click(f"//{SCENE}/{fa.ICON_FA_ARROW_ROTATE_LEFT}##reset.edits")
            assert not state.settings.edit.changes
            editing.set(lamp, {"power": (1.0,)})
            assert not state.settings.edit.changes, "what the file says is no edit"

        drive(app, script)


def test_an_object_tells_its_area_and_the_photons_on_it(tmp_path):
    """The green and the red wall of the Cornell box are at its sides."""
    seen = {}

    with app_on_engine(tmp_path, "cornell_caustic", {**SMALL, "photons.N": 20_000}) as app:

        def script(c):
            state, editing = app.state, app.state.editing
            wait_until(c, lambda: finished(app))
            assert not state.background.running(), "nobody looks: nothing is counted"
            seen["targets"] = editing.catalogue.targets["object"]
            editing.choose(seen["targets"][1])
            wait_until(c, lambda: state.received.counted() is not None)
            c.yield_(4)
            seen["counted"], seen["cloud"] = state.received.counted(), state.frame.clouds["global"]
            seen["rows"] = [rows_of(state, n) for n in range(len(seen["targets"]))]
            before = weakref.ref(state.session.opened_scene)
            editing.set(seen["targets"][1], {"move": (0.0, 0.1, 0.0)})
            editing.choose(None)
            wait_until(c, lambda: finished(app) and state.frame.settings.edit.changes)
            c.yield_(3)
            gc.collect()
            seen["before"] = before()

        drive(app, script)
    assert seen["before"] is None, "the scene as it was arranged before is gone, though photons on it were counted"
    photons, counts = seen["cloud"].photons, seen["counted"].maps["global"]
    x = photons[:, 0]
    middle = (x.min() + x.max()) / 2
    for number in (1, 2):
        at = x[np.abs(x - middle) > 0.49 * np.ptp(x)]
        sides = [int((at < middle).sum()), int((at > middle).sum())]
        assert min(abs(int(counts.photons[number]) - side) for side in sides) <= 0.03 * max(sides)
        rows = {name: text for name, text, _ in seen["rows"][number]}
        assert float(rows["area"].removesuffix(" m²")) > 0.9
        assert rows["global"].startswith(f"{counts.photons[number]:,} (")
        assert rows["global"].endswith("W/m²")
    assert {name: text for name, text, _ in seen["rows"][4]}["global"] == "0", "glass stores none"
    assert int(counts.photons.sum()) + counts.unknown == len(photons)


@pytest.mark.usefixtures("every_surface")
def test_another_light_rig_takes_the_edits_of_lights_with_it(tmp_path):
    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state = app.state
            wait_until(c, lambda: finished(app))
            state.change({"edit.changes": {"light.1.power": (2.0,), "material.white.colour": (0.5, 0.5, 0.5)}})
            wait_until(c, lambda: finished(app) and state.frame.settings == state.settings)
            edited = state.frame.image().copy()
            state.history.gesture += 1
            state.change({"light.rig": "sun"})
            assert list(state.settings.edit.changes) == ["material.white.colour"]
            wait_until(c, lambda: finished(app) and state.frame.settings == state.settings)
            assert "sun" in {light.name for light in state.session.scene.lights}
            state.undo()
            wait_until(c, lambda: finished(app) and state.frame.settings == state.settings)
            assert len(state.settings.edit.changes) == 2
            assert np.array_equal(state.frame.image(), edited)
            assert not [line for line in state.log if line.level == "error"]

        drive(app, script)


def test_another_scene_is_opened_without_the_edits(tmp_path):
    with app_on_engine(tmp_path, "cornell_caustic", SMALL) as app:

        def script(c):
            state = app.state
            wait_until(c, lambda: finished(app))
            state.change({"edit.changes": {"material.white.colour": (0.2, 0.2, 0.2)}})
            wait_until(c, lambda: finished(app) and state.frame.settings.edit.changes)
            state.open("cornell_diffuse")
            wait_until(c, lambda: state.session.scene.name != "cornell_caustic")
            assert not state.settings.edit.changes
            assert state.editing.chosen is None

        drive(app, script)
