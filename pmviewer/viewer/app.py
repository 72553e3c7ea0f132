"""The window: puts the parts together and runs them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

# imgui_bundle comes first: it makes glfw use the library that it brings along.
from imgui_bundle import hello_imgui, imgui, immapp  # isort: skip
import glfw
import moderngl
import numpy as np
from imgui_bundle.glfw_utils import glfw_window_hello_imgui

from pmviewer.errors import PmviewerError
from pmviewer.settings.access import Settings
from pmviewer.viewer import layout
from pmviewer.viewer.actions import Commands
from pmviewer.viewer.background import FILES
from pmviewer.viewer.dialogs.dialogs import FileDialogs
from pmviewer.viewer.dialogs.recent import RecentFiles
from pmviewer.viewer.dialogs.restore_dialog import RestoreDialog
from pmviewer.viewer.gl.framebuffers import Framebuffers
from pmviewer.viewer.gl.freeing import free_collected
from pmviewer.viewer.overlays.panel import OverlayPanel
from pmviewer.viewer.panels.error_panel import ErrorPanel
from pmviewer.viewer.panels.film_panel import FILM, FilmPanel
from pmviewer.viewer.panels.gain_panel import GainPanel
from pmviewer.viewer.panels.help_overlay import draw_help
from pmviewer.viewer.panels.importance_panel import ImportancePanel
from pmviewer.viewer.panels.inspector.panel import InspectorPanel, follow_pin
from pmviewer.viewer.panels.log_panel import LogPanel, draw_toasts
from pmviewer.viewer.panels.menus import Menus
from pmviewer.viewer.panels.scene_panel import ScenePanel, follow_choice
from pmviewer.viewer.panels.settings_panel import SettingsPanel
from pmviewer.viewer.panels.snapshots.panel import SnapshotsPanel
from pmviewer.viewer.panels.statistics_panel import StatisticsPanel
from pmviewer.viewer.panels.status_bar import draw_status_bar
from pmviewer.viewer.panels.toolbar import Toolbar
from pmviewer.viewer.session_link import SessionLike
from pmviewer.viewer.shortcuts import FLIP_KEY, is_held, run_shortcuts
from pmviewer.viewer.shot import Shot
from pmviewer.viewer.snapshots import SUFFIXES
from pmviewer.viewer.state import InactiveReason, ViewerState
from pmviewer.viewer.tour import Rectangle, Tour
from pmviewer.viewer.viewport.picture import Picture
from pmviewer.viewer.viewport.viewport import Viewport


def _always_active(path: str, settings: Settings, traits: Any) -> str | None:
    return None


class ViewerApp:
    """A window on a session.

    Parameters
    ----------
    session: anything with the interface of `pmviewer.engine.session.Session`. The window doesn't close it.
    inactive_reason: why a setting has no effect now, or None.
    recent: the list of recent files; the user's own by default.
    remember: keep the window's layout between runs.
    shot: a picture to take, after which the window closes.
    picture_size: make a window of that size with the picture alone.
    captions: name views in the picture.
    autosaves: the folder in which session and film are kept; None keeps nothing.
    """

    def __init__(
        self,
        session: SessionLike,
        *,
        inactive_reason: InactiveReason = _always_active,
        recent: RecentFiles | None = None,
        remember: bool = True,
        shot: Shot | None = None,
        picture_size: tuple[int, int] | None = None,
        captions: bool = True,
        autosaves: Path | None = None,
        window_size: tuple[int, int] | None = None,
        scale: float | None = None,
    ) -> None:
        self.state = ViewerState(
            session, inactive_reason, recent or RecentFiles(), remember=remember, autosaves=autosaves
        )
        self.restore_dialog = RestoreDialog(self.state.autosave, self.state.restore)
        self.viewport = Viewport(self.state)
        self.dialogs = FileDialogs()
        self.commands = Commands(self.state, self.viewport, self.dialogs)
        self.tour = Tour(self._places, remember=remember and shot is None)
        self.commands.table["begin_tour"] = self.tour.begin
        self.settings_panel = SettingsPanel(self.state)
        self.context: moderngl.Context | None = None
        self._title = ""
        self._running = False
        self._shares = layout.Shares()
        self.viewport.draw_toasts = lambda: draw_toasts(self.state, *self.viewport.origin, self.viewport.size[0])
        self.params = layout.runner_params(self._callbacks(), remember=remember, alone=picture_size)
        if window_size is not None:
            self.params.app_window_params.window_geometry.size = window_size
        self.state.appearance.choose(scale=scale)
        self._shot, self.viewport.alone, self.viewport.captions = shot, picture_size is not None, captions
        self.add_ons = immapp.AddOnsParams(with_implot=True)

    def _callbacks(self) -> layout.Callbacks:
        actions = self.commands.table
        self._toolbar = Toolbar(self.state, actions)
        self._snapshots_panel = SnapshotsPanel(self.state, self.viewport, actions)
        panels = {
            "Settings": self.settings_panel.gui,
            "Scene": ScenePanel(self.state).gui,
            "Overlays": OverlayPanel(self.viewport, self.settings_panel).gui,
            "Inspector": InspectorPanel(self.state).gui,
            "Statistics": StatisticsPanel(self.state).gui,
            "Importance": ImportancePanel(self.state).gui,
            "Error": ErrorPanel(self.state, actions).gui,
            "Snapshots": self._snapshots_panel.gui,
            "Comparison": GainPanel(self.state, actions, self.settings_panel).gui,
            FILM: FilmPanel(self.state, actions).gui,
            "Log": LogPanel(self.state).gui,
        }
        return layout.Callbacks(
            panels=panels,
            viewport=self.viewport.gui,
            menus=Menus(self.state, actions, layout.PANELS).gui,
            toolbar=self._toolbar.gui,
            status=lambda: draw_status_bar(self.state),
            over_everything=self._over_everything,
            post_init=self._post_init,
            add_platform_callbacks=self._add_platform_callbacks,
            pre_new_frame=self._pre_new_frame,
            before_swap=self._before_swap,
            before_exit=self._before_exit,
        )

    def run(self) -> None:
        """Open the window; returns when it was closed and every export is written."""
        immapp.run(self.params, self.add_ons)

    def drop(self, paths: list[str]) -> None:
        """Files dropped onto the window: a scene is opened, an EXR file as the reference; several pictures and PNG
        files become snapshots."""
        pictures = [Path(path) for path in paths if path.lower().endswith(SUFFIXES)]
        if len(pictures) == len(paths) and (len(paths) > 1 or paths[0].lower().endswith(".png")):
            self.state.snapshots.open(pictures)
            return
        if len(paths) > 1:
            self.state.say("warning", f"{len(paths)} files were dropped; only {paths[0]} is opened.")
        if paths and paths[0].lower().endswith(".exr"):
            self.commands.load_reference(Path(paths[0]))
        elif paths:
            self.state.open(paths[0])

    def _places(self) -> dict[str, Rectangle]:
        """What the tour points at, where it is drawn."""
        known = {"pinned": self.settings_panel.pinned, "toolbar": self._toolbar.choices}
        gap = 0.25 * imgui.get_font_size()
        return {name: (p[0] - gap, p[1] - gap, p[2] + gap, p[3] + gap) for name, p in known.items() if p is not None}

    def wake(self) -> None:
        """Draw soon. From any thread."""
        if self._running:
            hello_imgui.request_refresh()

    # callbacks --------------------------------------------------------------------------------------------------

    def _add_platform_callbacks(self) -> None:
        def on_drop(window: Any, paths: list[str]) -> None:
            try:
                self.drop(paths)
            except Exception as error:  # glfw would raise it much later, somewhere else
                self.state.say("error", f"The dropped file could not be opened: {error}")

        register: Any = glfw.set_drop_callback  # its annotation lacks the list that glfw makes of the paths
        register(glfw_window_hello_imgui(), on_drop)

    def _post_init(self) -> None:
        self.context = moderngl.create_context()
        # Python's collector may run on any thread: what it finds is freed on this one, by `free_collected`.
        self.context.gc_mode = "context_gc"
        self.viewport.picture = Picture(self.context)
        self.state.say("info", f"OpenGL {self.context.info['GL_VERSION']} on {self.context.info['GL_RENDERER']}")
        scale = hello_imgui.dpi_window_size_factor()
        width, height = (round(side * scale) for side in layout.SMALLEST_WINDOW)
        if not self.viewport.alone:
            glfw.set_window_size_limits(glfw_window_hello_imgui(), width, height, glfw.DONT_CARE, glfw.DONT_CARE)
        self.state.appearance.load()
        self.tour.begin_if_new()
        self.state.autosave.begin()
        self._running = True
        self.state.session.on_update = self.wake
        self.state.gain.on_update = self.state.film.on_update = self.state.linked.on_update = self.wake
        self.state.background.on_done = self.wake

    def _pre_new_frame(self) -> None:
        assert self.context is not None
        free_collected(self.context)
        self.commands.between_frames()
        self.state.appearance.show()
        self._shares.keep()
        self.state.poll()
        if not self.viewport.alone:
            follow_pin(self.state)
            follow_choice(self.state)
        try:
            self.viewport.render()
        except PmviewerError as error:
            self.state.say("error", str(error))
        self.context.screen.use()  # or the interface would be drawn into the picture
        self._show_title()
        if self.state.flying or self.state.navigating or self.state.film.playing:
            self.wake()

    def _show_title(self) -> None:
        scene = self.state.session.scene
        title = f"{scene.name} · pmviewer" if scene is not None else "pmviewer"
        if title != self._title:
            glfw.set_window_title(glfw_window_hello_imgui(), title)
            self._title = title

    def _over_everything(self) -> None:
        modals = self.commands.modals
        asking = self.restore_dialog.is_open or any(modal.is_open for modal in modals)
        covered = asking or self.dialogs.is_open or self.commands.palette.is_open or self.state.help_open
        if not (asking or self.dialogs.is_open or self.commands.palette.is_open):
            run_shortcuts(self.commands.table, self.commands.choose_view, self.state.flying, self.state.history)
        self.state.flipped = not self.dialogs.is_open and is_held(FLIP_KEY)
        self.commands.locate_scene()
        self.dialogs.poll()
        draw_help(self.state)
        self.commands.palette.gui(self.commands.table)
        for modal in modals:
            modal.gui()
        self.restore_dialog.gui()
        if not (covered or self.restore_dialog.is_open):  # the tour waits for what the user, or a crash, has left open
            self.tour.gui()

    def _before_swap(self) -> None:
        path, self.commands.window_shot = self.commands.window_shot, None
        if path is not None:
            self.commands.exports.pixels(path, self._window_pixels())
        if self._shot is not None:
            self._shot.after_drawing(self.state, self.viewport, self._window_pixels)

    def _window_pixels(self) -> np.ndarray:
        """(height, width, 3) uint8 of the whole window."""
        assert self.context is not None
        width, height = glfw.get_framebuffer_size(glfw_window_hello_imgui())
        copies = Framebuffers(self.context)
        screen = self.context.detect_framebuffer(0)
        self.context.copy_framebuffer(copies.get("window", (width, height)), screen)
        pixels = copies.read("window")
        copies.release()
        screen.use()
        return pixels

    def _before_exit(self) -> None:
        """End what runs beside the window; what the user has asked for is finished first, without the window."""
        self._running = False
        self.state.appearance.keep()
        self.state.remember_opening()
        self.state.session.on_update = self.state.gain.on_update = self.state.film.on_update = None
        self.state.linked.on_update = None
        self._release()
        if self.state.background.running(FILES):
            glfw.hide_window(glfw_window_hello_imgui())
        self.state.background.finish()
        self.state.autosave.end()

    def _release(self) -> None:
        """Free everything that lies on the GPU, as long as it can be reached."""
        if self.context is None:
            return
        self.viewport.release()
        self._snapshots_panel.strip.release()
        free_collected(self.context)
        self.context.release()
        self.context = None


def run_viewer(
    source: str | Path | None,
    settings: Settings | None,
    threads: int | None = None,
    parameters: Mapping[str, str] | None = None,
    snapshots: Sequence[tuple[int, Path]] = (),
    cluster: str | None = None,
    make: Callable[..., ViewerApp] = ViewerApp,
    *,
    chosen: bool = False,
) -> int:
    """Open the window on a scene or session file (None: the Cornell box with a mirror and a glass sphere).

    `parameters` are values for the scene file's `<default>` names, `threads` the session's (None: all cores),
    `snapshots` numbers and files of pictures in the strip, `cluster` whose workers render the passes (None: this
    process), `make` what makes the window, `chosen` whether somebody has chosen how that scene is rendered: it gets no
    trial by itself then.
    Returns 0 when the window was closed, or ends the process, if the engine is busy then: files that the user has asked
    for are written by that time. Raises WindowError when there is no display or no OpenGL.
    """
    from pmviewer.viewer.start import start_viewer

    return start_viewer(
        make, source, settings, threads, parameters, snapshots=snapshots, cluster=cluster, leave=True, chosen=chosen
    )
