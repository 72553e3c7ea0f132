"""What menus, toolbar and keys can trigger, by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from imgui_bundle import hello_imgui

from pmviewer.output.diagnostic_views import DENOISED
from pmviewer.render.camera import CameraPose
from pmviewer.render.free_camera import as_perspective, plan_pose
from pmviewer.settings.access import SETTINGS, get
from pmviewer.viewer import layout
from pmviewer.viewer.comparing_actions import comparing_actions
from pmviewer.viewer.dialogs.cluster_dialog import ClusterDialog
from pmviewer.viewer.dialogs.dialogs import FileDialogs
from pmviewer.viewer.dialogs.exports import Exports, default_path, fresh_path
from pmviewer.viewer.dialogs.still_dialog import StillDialog
from pmviewer.viewer.overlays.registry import SWITCHED
from pmviewer.viewer.panels.film_panel import FILM
from pmviewer.viewer.panels.palette import Palette
from pmviewer.viewer.state import ViewerState
from pmviewer.viewer.view_actions import save_view
from pmviewer.viewer.viewport import controls
from pmviewer.viewer.viewport.target import Fit
from pmviewer.viewer.viewport.viewport import VIEWPORT, Viewport

COMPARISON, SETTINGS_PANEL = "Comparison", "Settings"
"""Labels of panels."""
SCENE_PATTERNS = ["*.xml", "*.toml", "*.glb", "*.gltf", "*.obj", "*.ply", "*.stl"]
EXPOSURE_STEP = 0.5


class Commands:
    """`table` maps each action's name to what it does."""

    def __init__(self, state: ViewerState, viewport: Viewport, dialogs: FileDialogs) -> None:
        self.state = state
        self.viewport = viewport
        self.dialogs = dialogs
        self.exports = Exports(state, viewport)
        self.window_shot: Path | None = None
        """Where the next frame of the whole window goes."""
        self.palette = Palette(state)
        self.still_dialog = StillDialog(state, dialogs)
        self.cluster_dialog = ClusterDialog(state)
        self.modals = self.still_dialog, self.cluster_dialog
        self._hidden: list[str] = []
        self._layout = layout.Layout()
        self.table: dict[str, Callable[[], None]] = {
            **comparing_actions(state, dialogs),
            "add_key": self._add_key,
            "play_film": self._play_film,
            "export_film": self._export_film,
            "open": self._open,
            "open_photons": self._open_photons,
            "load_reference": self._load_reference,
            "save_session": lambda: self._save(".toml", self.exports.session),
            "export_exr": lambda: self._save(".exr", self.exports.exr),
            "export_exr_half": lambda: self._save(".exr", lambda path: self.exports.exr(path, half=True)),
            "export_still": self.still_dialog.open,
            "borrow_cluster": self.cluster_dialog.open,
            "export_png": lambda: self._save(".png", lambda path: self.exports.png(path, overlays=False)),
            "export_png_overlays": lambda: self._save(".png", lambda path: self.exports.png(path, overlays=True)),
            "screenshot": self._screenshot,
            "screenshot_picture": lambda: self.exports.png(self._fresh(".png"), overlays=True),
            "quit": self._quit,
            "undo": self.state.undo,
            "redo": self.state.redo,
            "list_changed": self._list_changed,
            "open_palette": self.palette.open,
            "toggle_pause": self._toggle_pause,
            "restart": self.state.session.restart,
            "exposure_up": lambda: self._expose(EXPOSURE_STEP),
            "exposure_down": lambda: self._expose(-EXPOSURE_STEP),
            "next_tone": self._next_tone,
            "toggle_marks": lambda: self._toggle("display.marks"),
            "toggle_denoised": self._toggle_denoised,
            **{f"toggle_{o.name}": partial(self._toggle, f"overlays.{o.name}.show") for o in SWITCHED},
            "choose_region": self.viewport.region.toggle,
            "toggle_region": lambda: self._toggle("region.on"),
            "fit_picture": self._fit,
            "compare_importance": self._compare_importance,
            "choose_automatically": state.automatic.start,
            "toggle_fly": self._toggle_fly,
            "frame_all": self._frame_all,
            "reset_camera": self._reset_camera,
            "save_view": partial(save_view, state),
            "toggle_free": lambda: self._toggle("free_camera.on"),
            "free_from_above": self._free_from_above,
            "free_to_render": self._free_to_render,
            "free_becomes_render": self._free_becomes_render,
            "toggle_look": self._toggle_look,
            "larger": lambda: self.state.appearance.larger(1),
            "smaller": lambda: self.state.appearance.larger(-1),
            "toggle_panels": self._toggle_panels,
            "toggle_help": self._toggle_help,
            "escape": self._escape,
        }

    def between_frames(self) -> None:
        """Before each window frame."""
        self._layout.restore_now()

    def choose_view(self, number: int) -> None:
        """The view of that number in the schema's order."""
        choices = SETTINGS["display.view"].choices
        if number < len(choices) and self.state.refused_view(choices[number]) is None:
            self.state.change({"display.view": choices[number]})

    # files ------------------------------------------------------------------------------------------------------

    def _open(self) -> None:
        self.dialogs.open("Open a scene or session", "Scenes and sessions", SCENE_PATTERNS, self.state.open)

    def locate_scene(self) -> None:
        """Once per window frame: ask where the scene is that a session file misses."""
        if self.state.lost is None or self.dialogs.is_open:
            return
        (session, scene), self.state.lost = self.state.lost, None
        title = f"Where is {Path(scene).name} now?"
        self.dialogs.open(title, "Scenes", SCENE_PATTERNS, lambda found: self.state.open(session, scene=found))

    def _load_reference(self) -> None:
        self.dialogs.open("Load a reference", "OpenEXR pictures", ["*.exr"], self.load_reference)

    def load_reference(self, path: Path) -> None:
        """Compare with that EXR file from now on."""
        self.state.comparison.load(path, self.state.live_camera())

    def _open_photons(self) -> None:
        self.dialogs.open("Photons of a PLY file", "PLY files", ["*.ply"], self.state.loaded.open)

    def _save(self, suffix: str, write: Callable[[Path], None]) -> None:
        view = "" if suffix == ".toml" else self.state.settings.display.view if suffix == ".png" else "layers"
        self.dialogs.save("Save as", default_path(self.state, suffix, view), write)

    def _fresh(self, suffix: str) -> Path:
        return fresh_path(default_path(self.state, suffix, self.state.settings.display.view))

    def _screenshot(self) -> None:
        self.window_shot = fresh_path(default_path(self.state, ".png", "window"))

    def _quit(self) -> None:
        hello_imgui.get_runner_params().app_shall_exit = True

    # rendering and display --------------------------------------------------------------------------------------

    def _toggle_pause(self) -> None:
        session = self.state.session
        if session.paused:
            session.resume()
        else:
            session.pause()

    def _toggle(self, path: str) -> None:
        self.state.change({path: not get(self.state.settings, path)})

    def _expose(self, step: float) -> None:
        info = SETTINGS["display.exposure"]
        exposure = self.state.settings.display.exposure
        value = (self.state.resolved(info.path) or 0.0 if exposure == "auto" else float(exposure)) + step
        self.state.change({info.path: min(max(value, info.lower or 0.0), info.upper or 0.0)})

    def _next_tone(self) -> None:
        choices = SETTINGS["display.tone"].choices
        now = choices.index(self.state.settings.display.tone)
        self.state.change({"display.tone": choices[(now + 1) % len(choices)]})

    def _toggle_denoised(self) -> None:
        """The picture without its noise, or the picture as it is again."""
        if self.state.settings.display.view == DENOISED:
            self.state.change({"display.view": "beauty"})
        elif (reason := self.state.refused_view(DENOISED)) is None:
            self.state.change({"display.view": DENOISED})
        else:
            self.state.say("warning", reason)

    def _compare_importance(self) -> None:
        """Start the comparison and bring its panel to the front."""
        window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(COMPARISON)
        window.is_visible = window.focus_window_at_next_frame = True
        self.state.compare_importance()

    # film -------------------------------------------------------------------------------------------------------

    def _show_film(self) -> None:
        window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(FILM)
        window.is_visible = window.focus_window_at_next_frame = True

    def _add_key(self) -> None:
        self.state.film.add()
        self._show_film()

    def _play_film(self) -> None:
        film = self.state.film
        if film.playing:
            film.stop()
        else:
            film.play()

    def _export_film(self) -> None:
        film = self.state.film
        why = film.refusal()
        if why is not None:
            self.state.say("warning", f"No film: {why}")
            return
        self.dialogs.save("Export the film", default_path(self.state, film.export_as.format, "film"), film.export)

    # camera -----------------------------------------------------------------------------------------------------

    def _frame_all(self) -> None:
        pose, geometry = self.state.live_camera(), self.state.session.geometry
        if pose is not None and geometry is not None:
            self.state.move_camera(controls.frame_all(pose, geometry.center, float(geometry.radius)))

    def _reset_camera(self) -> None:
        """The scene file's camera; the automatic overview while the free camera is on."""
        group = "free_camera" if self.state.settings.free_camera.on else "camera"
        names = ["origin", "target", "up", "fov"]
        if group == "camera":
            names += ["projection", "view_width", "shift_x", "shift_y", "aperture", "focus"]
        self.state.change({f"{group}.{name}": "auto" for name in names})

    def _free_from_above(self) -> None:
        """The free camera straight above scene and render camera, with what is ahead of the latter on top."""
        self._place_free(lambda render, center, radius: plan_pose(render, center, radius))

    def _free_to_render(self) -> None:
        """The free camera where the render camera is."""
        self._place_free(lambda render, center, radius: as_perspective(controls.with_pivot(render, center, radius)))

    def _place_free(self, place: Callable[[CameraPose, np.ndarray, float], CameraPose]) -> None:
        render, geometry = self.state.render_camera(), self.state.session.geometry
        if render is None or geometry is None:
            self.state.say("error", "There is no camera yet: open a scene first.")
            return
        pose = place(render, geometry.center, float(geometry.radius))
        values: dict[str, Any] = dict(controls.camera_values(pose, "free_camera"))
        self.state.change({**values, "free_camera.fov": pose.fov, "free_camera.on": True})

    def _free_becomes_render(self) -> None:
        """Render what the free camera sees, with importance of its own."""
        pose = self.state.live_camera()
        if pose is None or not self.state.settings.free_camera.on:
            self.state.say("warning", "The free camera is off: the picture is the render camera's already.")
            return
        values: dict[str, Any] = dict(controls.camera_values(pose))
        render = self.state.render_camera()
        if render is not None and (render.orthographic or any(render.shift)):
            values |= {"camera.projection": "perspective", "camera.shift_x": 0.0, "camera.shift_y": 0.0}
        self.state.change({**values, "camera.fov": pose.fov, "free_camera.on": False})

    def _toggle_fly(self) -> None:
        self.state.flying = not self.state.flying

    def _fit(self) -> None:
        self.viewport.fit = Fit()

    # window -----------------------------------------------------------------------------------------------------

    def _toggle_panels(self) -> None:
        """Hide every panel but the picture, or bring back those that were there."""
        windows = hello_imgui.get_runner_params().docking_params.dockable_windows
        if self.state.panels_hidden:
            for window in windows:
                window.is_visible = window.is_visible or window.label in self._hidden
            self._layout.restore_soon()
        else:
            self._layout.remember()
            self._hidden = [w.label for w in windows if w.is_visible and w.label != VIEWPORT]
            for window in windows:
                window.is_visible = window.label == VIEWPORT
        self.state.panels_hidden = not self.state.panels_hidden

    def _list_changed(self) -> None:
        """Only the changed settings in their panel, which comes to the front; or all of them again."""
        self.state.only_changed = not self.state.only_changed
        window = hello_imgui.get_runner_params().docking_params.dockable_window_of_name(SETTINGS_PANEL)
        window.is_visible = window.focus_window_at_next_frame = True

    def _toggle_look(self) -> None:
        appearance = self.state.appearance
        appearance.choose(look="dark" if appearance.look == "light" else "light")

    def _toggle_help(self) -> None:
        self.state.help_open = not self.state.help_open

    def _escape(self) -> None:
        if self.viewport.region.choosing:
            self.viewport.region.toggle()
        elif not (self.state.flying or self.state.help_open):
            self.state.inspector.unpin()
        self.state.flying = self.state.help_open = self.palette.is_open = False
