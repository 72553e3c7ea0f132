"""What the window's parts share: the session, the log, and the one way to change a setting."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pmviewer.engine.focus import focused, surface_at
from pmviewer.engine.frame import Frame, Level, Message
from pmviewer.errors import PmviewerError, SettingError
from pmviewer.output.diagnostic_views import HELD_WHILE_SHOWN
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.render.clip import clipped
from pmviewer.render.free_camera import resolve_view
from pmviewer.render.planes import AOVS, TERMS, VOLUME_TERMS
from pmviewer.scene.description import Scene
from pmviewer.settings.access import (
    CameraSettings,
    Display,
    Edit,
    FreeCamera,
    SettingInfo,
    Settings,
    info_of,
    parse_assignments,
    with_values,
)
from pmviewer.settings.film import FilmKey
from pmviewer.settings.schema.compare import LAST, LIVE, REFERENCE
from pmviewer.viewer.appearance import Appearance
from pmviewer.viewer.automatic import AutomaticRun
from pmviewer.viewer.autosave import Autosave
from pmviewer.viewer.background import Background
from pmviewer.viewer.comparison import COMPARED_VIEWS, Comparison
from pmviewer.viewer.dialogs.recent import RecentFiles
from pmviewer.viewer.editing import Editing
from pmviewer.viewer.film import FilmEditor
from pmviewer.viewer.history import History
from pmviewer.viewer.importance_gain import GainRun
from pmviewer.viewer.inspector import Inspector
from pmviewer.viewer.linked import Linked
from pmviewer.viewer.loaded_photons import LoadedPhotons
from pmviewer.viewer.measured import Measured
from pmviewer.viewer.pair import Pair, ShownPair
from pmviewer.viewer.received import ReceivedByObjects
from pmviewer.viewer.saved_views import FILE, SavedViews
from pmviewer.viewer.session_link import SessionLike
from pmviewer.viewer.snapshots import Snapshots
from pmviewer.viewer.still import StillExport
from pmviewer.viewer.viewport.controls import camera_values

InactiveReason = Callable[[str, Settings, Any], str | None]
LAYERS = ("beauty", *TERMS, *VOLUME_TERMS, *AOVS)
LOG_LINES = 2000
COMPARING_LAYERS = "While two pictures are compared, the image, its terms and what the first surface is can be shown."
TOAST_SECONDS = 12.0
MOST_TOASTS = 2


@dataclass
class Toast:
    """An error that floats over the picture until it is dismissed, or grows old; the log keeps it."""

    message: Message
    born: float = field(default_factory=time.monotonic)

    def is_over(self) -> bool:
        """Whether it has been shown for long enough."""
        return time.monotonic() - self.born > TOAST_SECONDS


def is_gone(scene: str | Path) -> bool:
    """Whether that is a file which isn't there; bundled scenes have names."""
    return Path(scene).is_absolute() and not Path(scene).exists()


class ViewerState:
    """Lives as long as the window."""

    def __init__(
        self,
        session: SessionLike,
        inactive_reason: InactiveReason,
        recent: RecentFiles,
        *,
        remember: bool = False,
        autosaves: Path | None = None,
    ) -> None:
        self.session = session
        self.appearance = Appearance(remember=remember)
        self.inactive_reason = inactive_reason
        self.recent = recent
        self.views = SavedViews(recent.folder / FILE)
        self.background = Background(self.say)
        self.autosave = Autosave(autosaves, session, self.background)
        self.comparison = Comparison(session, self.background, self.say)
        self.gain = GainRun(session, self.background, self.say)
        self.automatic = AutomaticRun(session, self.background, self.say, self._change_by_itself)
        self.snapshots = Snapshots(self.background, self.say)
        self.linked = Linked(session, self.background)
        self.pair = Pair(self.background, self.comparison, self.gain, self.snapshots, self.linked)
        self.measured = Measured(self.background, self.comparison, lambda: self.frame)
        self.inspector = Inspector(session, lambda: self.frame)
        self._paired: tuple[tuple[Any, ...], ShownPair | None] | None = None
        self.history = History()
        self.editing = Editing(session, self.change)
        self.received = ReceivedByObjects(session, self.background, lambda: self.frame)
        self.loaded = LoadedPhotons(self.background, lambda: self.change({"overlays.file.show": True}))
        self.still = StillExport(session, self.background)
        self.film = FilmEditor(session, self.history, self.change, self.background, self.say)
        self.log: deque[Message] = deque(maxlen=LOG_LINES)
        self.toasts: list[Toast] = []
        self._toasts_of = session.scene
        self._said: deque[Message] = deque()
        """What any thread said since the last frame."""
        self._calls: deque[Callable[[], None]] = deque()
        self.is_attachable: Callable[[], bool] | None = None
        """Whether programs can attach to the window; None where that is not offered."""
        self.flying = False
        self.panels_hidden = False
        self.help_open = False
        self.only_changed = False
        """Whether the settings panel lists changed settings alone."""
        self.flipped = False
        """While the key that shows the reference is held."""
        self.last_camera_move = -1e9
        self._scene: Any = None
        self._stale_serial = -1
        self.parameters: dict[str, str] = {}
        """Values for the open scene file's `<default>` names."""
        self._opening: tuple[str, dict[str, str]] | None = None
        self._film: tuple[FilmKey, ...] = ()
        """Keys of the film of what is being opened."""
        self.lost: tuple[str, str] | None = None
        """A session file that was to be opened and the scene that it misses, until somebody asks where that is."""

    # settings ---------------------------------------------------------------------------------------------------

    @property
    def settings(self) -> Settings:
        """The session's own: what the user asked for last, whatever the frame shows."""
        return self.session.settings

    def change(self, values: dict[str, Any]) -> None:
        """Change settings; text is parsed as on the command line. What the schema refuses goes to the log."""
        try:
            parsed: dict[str, Any] = {}
            for path, value in values.items():
                if isinstance(value, str) and info_of(path).kind is not str:
                    parsed |= parse_assignments([f"{path}={value.replace(',', '')}"])
                else:
                    parsed[path] = value
            if list(parsed) == ["camera.name"]:  # another camera as it is, not where this one was moved to
                parsed |= dict.fromkeys(("camera.origin", "camera.target", "camera.up", "camera.fov"), "auto")
            if list(parsed) == ["render.method"] and parsed["render.method"] != self.settings.render.method:
                parsed = self._without_automatic(parsed)
            if parsed.get("light.rig", self.settings.light.rig) != self.settings.light.rig:
                parsed = self._without_light_edits(parsed)
            settings = with_values(self.settings, parsed)
        except PmviewerError as error:
            self.say("error", str(error))
            return
        if settings != self.settings:
            self.history.changed(self.settings, settings)
            self.session.set(settings)

    def _without_automatic(self, values: dict[str, Any]) -> dict[str, Any]:
        """Another method by hand, and nothing else: the numbers that automatic mode picked for the one before, radii
        first of all, would make it look worse than it is."""
        own = {path: value for path, value in self.automatic.undone(self.settings).items() if path not in values}
        if own:
            names = ", ".join(own)
            self.say("info", f"What automatic mode chose for {self.settings.render.method} went with it: {names}.")
        return own | values

    def _without_light_edits(self, values: dict[str, Any]) -> dict[str, Any]:
        """Another rig has other lights: edits of those before would name what is not there, and the scene could not be
        lit anew. Undoing brings them back with their lights."""
        edits = values.get("edit.changes", self.settings.edit.changes)
        kept = {name: numbers for name, numbers in edits.items() if not name.startswith("light.")}
        if len(kept) < len(edits):
            self.say("info", "The edits of lights went with the lights: undo brings them back.")
        return {**values, "edit.changes": kept}

    def _change_by_itself(self, values: dict[str, Any]) -> None:
        """Change settings as a step of its own to undo, when the mouse does something else."""
        self.history.gesture += 1
        self.change(values)
        self.history.gesture += 1

    def undo(self) -> None:
        """Take the last step of the user's back; playing a film is one."""
        self.film.stop()
        self._step(self.history.undo(self.settings))

    def redo(self) -> None:
        """Take it again."""
        self.film.stop()
        self._step(self.history.redo(self.settings))

    def _step(self, settings: Settings | None) -> None:
        if settings is not None and settings != self.settings:
            self.session.set(settings)

    def resolved(self, path: str) -> Any:
        """What "auto" means now for that setting, or None when it isn't known yet."""
        group, _, name = path.partition(".")
        if path == "display.exposure":
            return self.frame.exposure if self.frame is not None else None
        if path == "camera.name":
            return None
        if group in ("camera", "free_camera"):
            free = self.live_camera() if self.settings.free_camera.on else None
            pose = self.render_camera() if group == "camera" else free
            return getattr(pose, name) if pose else None
        frame = self.frame
        return frame.automatic.get(path) if frame is not None else None

    # what is shown ----------------------------------------------------------------------------------------------

    @property
    def frame(self) -> Frame | None:
        """The newest frame of the scene that is open now."""
        frame = self.session.frame
        return frame if frame is not None and frame.serial > self._stale_serial else None

    @property
    def shown_display(self) -> Display:
        """The display settings with the view that can be shown now: the reference while its key is held, the image when
        there is nothing to compare."""
        display = self._exposed(self.settings.display, self.frame)
        if self.flipped and self.refused_view("reference") is None:
            return display.model_copy(update={"view": "reference"})
        missing = display.view in HELD_WHILE_SHOWN and (
            self.frame is None or display.view not in self.frame.diagnostics
        )
        if missing or self.refused_view(display.view) is not None:
            return display.model_copy(update={"view": "beauty"})
        return display

    @staticmethod
    def _exposed(display: Display, frame: Frame | None) -> Display:
        """The display settings with a number as exposure."""
        if display.exposure != "auto":
            return display
        return display.model_copy(update={"exposure": frame.exposure if frame is not None else 0.0})

    def choices(self, info: SettingInfo) -> tuple[str, ...]:
        """What can be chosen; the cameras are those of the scene's file, pictures those that there are."""
        if info.path in ("compare.a", "compare.b"):
            return (LIVE, REFERENCE, LAST, *(str(one.number) for one in self.snapshots.all))
        if info.path != "camera.name":
            return info.choices
        names = [camera.name for camera in self.session.scene.cameras] if self.session.scene is not None else []
        return ("auto", *(name if names.count(name) == 1 else str(i + 1) for i, name in enumerate(names)))

    @property
    def named_view(self) -> str:
        """The view that menus and toolbar name: the one asked for; while two pictures are compared, the one shown."""
        pair = self.shown_pair()
        return self.settings.display.view if pair is None else pair.display.view

    def refused_view(self, view: str) -> str | None:
        """Why that view can't be shown now, or None."""
        if view not in LAYERS and self.shown_pair() is not None:
            return COMPARING_LAYERS
        if view in HELD_WHILE_SHOWN:
            return self.inactive_reason(f"display.view={view}", self.settings, self.session.traits)
        return self.comparison.problem(self.frame) if view in COMPARED_VIEWS else None

    def live_camera(self) -> CameraPose | None:
        """The camera that the newest settings look through, ahead of the frame's while the user moves it; the free
        camera while it is on."""
        scene, geometry = self.session.scene, self.session.geometry
        if scene is None:
            return None
        if not self.settings.free_camera.on or geometry is None:
            return self._resolved(scene)
        try:
            return resolve_view(scene, self.settings, geometry.center, float(geometry.radius))
        except SettingError:
            return self._resolved(scene)

    def render_camera(self) -> CameraPose | None:
        """The camera that importance belongs to, by the newest settings."""
        scene = self.session.scene
        return self._resolved(scene) if scene is not None else None

    def _resolved(self, scene: Scene) -> CameraPose:
        """The chosen camera; the scene's own if there is no such one, which the session says. A lens is focused."""
        try:
            pose = resolve_camera(scene, self.settings.camera)
        except SettingError:
            pose = resolve_camera(scene, self.settings.camera.model_copy(update={"name": "auto"}))
        opened = self.session.opened_scene
        if opened is None or opened.scene is not scene:
            return pose
        return focused(opened.flat, clipped(pose, self.settings.camera, opened.flat.center, opened.flat.radius))

    def focus_at(self, shown: CameraPose, x: float, y: float) -> None:
        """Focus the render camera's lens on the surface at a place of the picture of the camera `shown`, in pixels."""
        opened, render = self.session.opened_scene, self.render_camera()
        if opened is None or render is None:
            return
        if render.aperture == 0:
            self.say("warning", "Everything is sharp: the camera has no lens to focus. Give camera.aperture a radius.")
            return
        point = surface_at(opened.flat, shown, x, y)
        if point is None:
            self.say("warning", "There is no surface to focus on there.")
            return
        distance = float(render.project(point[None])[0, 2])
        if distance <= 0:
            self.say("warning", "That lies behind the render camera: its lens can't be focused there.")
            return
        self.change({"camera.focus": distance})

    def shown_pair(self) -> ShownPair | None:
        """The pictures that the viewport compares now, by a view that is one of their layers; None when it compares
        none."""
        reference = self.comparison.reference
        shown = self.gain.gain if self.gain.shown else None
        now = (
            self.settings, self.frame, shown, self.snapshots.version, reference, self.pair.second, self.linked.version
        )  # fmt: skip
        if self._paired is None or any(a is not b for a, b in zip(self._paired[0], now, strict=True)):
            display = self._exposed(self.settings.display, self.frame)
            view = display.view if display.view in LAYERS else "beauty"
            layer = display.model_copy(update={"view": view})
            self._paired = now, self.pair.shown(self.settings, layer, self.frame)
        return self._paired[1]

    def take_snapshot(self) -> None:
        """Keep the picture as it is, with all that made it."""
        reference = self.comparison.reference
        truth = str(reference.path) if reference is not None else ""
        taken = self.snapshots.take(self.frame, self.comparison.current, truth)
        if taken is not None:
            self.say("info", f"snapshot {taken.name}")

    def compare_importance(self) -> None:
        """Start the comparison with and without importance, against the reference where that can be compared."""
        comparison, truth = self.comparison, None
        if comparison.reference is not None and comparison.problem(self.frame) is None:
            path = comparison.reference.path
            truth = comparison.reference.image, f"the reference {path.parent.name}/{path.name}"
        self.gain.start(truth)

    def scene_changed(self) -> bool:
        """True once after another scene was opened; frames of the one before are not shown any more. A scene that is
        lit or edited otherwise is no other scene."""
        opened = self.session.opened_scene
        scene = self.session.scene if opened is None else opened.content or opened.whole
        if scene is self._scene:
            return False
        before, self._scene = self._scene, scene
        if self._opening is not None:
            path, self.parameters = self._opening
            self.recent.add(path)
            self.history.clear()
            self.film.take(self._film)
            if before is not None and self.session.paused:
                self.session.resume()  # it was the scene before that was to stand still
            self._opening = None
        frame = self.session.frame
        if frame is not None and scene is not None and frame.scene_name != scene.name:
            self._stale_serial = frame.serial
        return True

    def remember_opening(self) -> None:
        """Before the window goes: what was opened since its last picture, or is being loaded, is a recent file too."""
        self.scene_changed()
        if self._opening is not None and self.session.loading:
            self.recent.add(self._opening[0])

    def move_camera(self, pose: CameraPose) -> None:
        """Set the pose of the camera that is looked through, the free one while it is on."""
        self.last_camera_move = time.monotonic()
        group = "free_camera" if self.settings.free_camera.on else "camera"
        self.change(dict(camera_values(pose, group)))

    @property
    def navigating(self) -> bool:
        """Whether the camera moved within the last 0.3 s: a drag or flight counts as one motion."""
        return time.monotonic() - self.last_camera_move < 0.3

    # files and messages -----------------------------------------------------------------------------------------

    def open(
        self,
        path: str | Path,
        *,
        keep_camera: bool = False,
        parameters: Mapping[str, str] | None = None,
        scene: Path | None = None,
        kept: Path | None = None,
        remember: bool = True,
        chosen: bool = False,
    ) -> None:
        """Open a scene or a session file, whose scene may lie elsewhere now (`scene`), and go on with the film that is
        `kept` in a checkpoint. Without `remember` it is the scene that is a recent file, not the session.

        Settings stay when it is a scene, but for the camera's: that was another scene's unless `keep_camera` says
        otherwise; and for what automatic mode picked, for another scene too. `parameters` are values for the scene
        file's `<default>` names. What is in a session file, kept or `chosen` gets no trial by itself.
        """
        settings = (
            self.settings
            if keep_camera
            else self.settings.model_copy(
                update={"camera": CameraSettings(), "free_camera": FreeCamera(), "edit": Edit()}
            )
        )
        settings = with_values(settings, self.automatic.undone(settings))
        source: str | Path = path
        snapshots: tuple[tuple[int, Path], ...] = ()
        film: tuple[FilmKey, ...] = ()
        if str(path).lower().endswith(".toml"):
            from pmviewer.output.session_file import read_session

            try:
                saved = read_session(Path(path))
            except (PmviewerError, OSError) as error:
                self.say("error", str(error))
                return
            source, settings, parameters = scene or saved.scene, saved.settings, saved.parameters
            snapshots, film = saved.snapshots, saved.film
            if is_gone(source):
                self.say("error", f"{path}: its scene {source} is not there. Choose where it is now.")
                self.lost = str(path), str(source)
                return
        if snapshots:
            if self.snapshots.all:
                self.say(
                    "warning", f"{path}: its snapshots take the place of the {len(self.snapshots.all)} in the strip."
                )
            self.snapshots.open([file for _, file in snapshots], [number for number, _ in snapshots])
        self._opening, self._film = (str(path if remember else source), dict(parameters or {})), film
        self.automatic.opening(chosen=chosen or kept is not None or str(path).lower().endswith(".toml"))
        self.session.open(source, settings, parameters, kept)

    def restore(self) -> None:
        """Open what a crash has left."""
        session, film = self.autosave.restore()
        self.open(session, kept=film, remember=False)

    def say(self, level: Level, text: str) -> None:
        """A line for the log, from any thread."""
        self._said.append(Message(level, text))

    def call(self, what: Callable[[], None]) -> None:
        """Have the window's thread do that with its next frame. From any thread."""
        self._calls.append(what)

    def _take(self, message: Message) -> None:
        self.log.append(message)
        if message.level == "error":
            others = [toast for toast in self.toasts if toast.message.text != message.text]
            self.toasts = [*others, Toast(message)][-MOST_TOASTS:]

    def unread_errors(self) -> list[str]:
        """What went wrong after the last window frame."""
        messages = [*self.session.take_messages(), *self._said]
        self._said.clear()
        return [message.text for message in messages if message.level == "error"]

    def poll(self) -> None:
        """Once per window frame: collect the messages. Errors of a scene that is gone float no longer."""
        while self._calls:
            self._calls.popleft()()
        if self.session.scene is not self._toasts_of:
            self._toasts_of = self.session.scene
            self.toasts.clear()
        for message in self.session.take_messages():
            self._take(message)
        while self._said:
            self._take(self._said.popleft())
        parameters = self._opening[1] if self._opening is not None else self.parameters
        self.comparison.poll(self.frame, with_own=not parameters)
        self.gain.poll(self.live_camera())
        self.automatic.poll()
        self.snapshots.poll()
        self.film.poll()
        self.loaded.poll()
        passes = self.frame.statistics.passes if self.frame is not None else 0
        self.autosave.poll(self.parameters, self.snapshots, self.film.keys, passes)
        self.pair.link(self.settings, self.frame)
        self.pair.poll(self.shown_pair())
        self.toasts = [toast for toast in self.toasts if not toast.is_over()]
