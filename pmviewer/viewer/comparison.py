"""The window's reference: loading it, measuring frames against it in the background, and the curves of the runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pmviewer.engine.frame import Frame, Level
from pmviewer.render.camera import CameraPose, resolve_camera, size_only
from pmviewer.scene.description import Scene
from pmviewer.settings.access import SETTINGS, flat
from pmviewer.viewer.background import MEASURING, READING, Background
from pmviewer.viewer.format import grouped
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:  # brings OpenEXR and scipy along, which the window doesn't wait for
    from pmviewer.output.compare import Reference
    from pmviewer.output.metric import Metrics

COMPARED_VIEWS = ("reference", "error")
EARLIER_RUNS = 8
NO_REFERENCE = "There is no reference: load one with File > Load reference, or drop an EXR file onto the window."
_SAME_PICTURE = (
    "compare.",
    "display.",
    "overlays.",
    "camera.",
    "free_camera.",
    "render.method",
    "render.passes",
    "render.time_limit",
)
"""Settings that don't tell one run's curve from another's, or are named apart."""


@dataclass(frozen=True)
class Point:
    """The error after some passes; `seconds` of rendering, without pauses, `cpu_seconds` summed over threads."""

    passes: int
    seconds: float
    cpu_seconds: float
    metrics: Metrics


@dataclass
class Run:
    """What one version of the settings has rendered. `points` grow from a thread of its own."""

    version: int
    method: str
    changed: dict[str, Any]
    """Settings that differ from their defaults, by full name."""
    points: list[Point] = field(default_factory=list)
    next_pass: int = 1

    @property
    def label(self) -> str:
        """The method and what else is not as usual."""
        values = [f"{path.split('.')[-1]} {_text(value)}" for path, value in self.changed.items()]
        return ", ".join([self.method, *values[:3], *(["…"] if len(values) > 3 else [])])


def run_of(frame: Frame) -> Run:
    """An empty curve for the frame's version."""
    values = flat(frame.settings).items()
    changed = {p: v for p, v in values if not p.startswith(_SAME_PICTURE) and v != SETTINGS[p].default}
    return Run(frame.version, frame.settings.render.method, changed)


def next_mark(passes: int) -> int:
    """The next of 1, 2, 3, 4, 6, 8, 12, 16, 24, … above `passes`."""
    power = 1 << max(passes.bit_length() - 1, 0)
    return next(mark for mark in (power, power * 3 // 2, power * 2) if mark > passes)


class Comparison:
    """Lives as long as the window. Every method is for the window's thread.

    A reference shows what the scene's own camera sees: frames of another camera or size are not compared.
    """

    def __init__(self, session: SessionLike, background: Background, say: Callable[[Level, str], None]) -> None:
        self.reference: Reference | None = None
        self.current: Run | None = None
        self.earlier: list[Run] = []
        """Curves of other settings, oldest first."""
        self._session = session
        self._background = background
        self._say = say
        self._scene: Scene | None = None
        self._arrived: tuple[Scene, Reference] | None = None
        self._checked: tuple[Any, str | None] = (None, None)

    # the reference ----------------------------------------------------------------------------------------------

    def load(self, path: Path, camera: CameraPose | None) -> None:
        """Read a reference for pictures of that camera, in the background. One that doesn't fit is one error in the
        log and changes nothing."""
        scene = self._session.scene
        if scene is None or camera is None:
            self._say("error", f"{path}: a reference needs a picture to compare it with. Open a scene first.")
            return

        def work() -> str:
            from pmviewer.output.compare import load_reference

            reference = load_reference(path)
            reference.check_size((camera.width, camera.height))
            self._arrived = scene, reference
            return f"comparing with {path}"

        self._background.start(READING, "loading the reference", work)

    def _load_own(self, scene: Scene) -> None:
        """The reference that lies beside the scene, if there is one. Silent: nobody asked for it."""

        def work() -> str:
            from pmviewer.output.compare import load_reference
            from pmviewer.scene.load import reference_of

            path = reference_of(scene)
            if path is not None:
                self._arrived = scene, load_reference(path)
            return ""

        self._background.start(READING, "loading the reference", work)

    def problem(self, frame: Frame | None) -> str | None:
        """Why the frame can't be compared, and what to do about it; None when it can."""
        reference, scene = self.reference, self._scene
        if reference is None or scene is None:
            return NO_REFERENCE
        if frame is None:
            return "Nothing is rendered yet."
        key = (reference, scene, frame.camera)
        known = self._checked[0]
        if known is None or any(a is not b for a, b in zip(known, key, strict=True)):
            self._checked = key, _mismatch(reference, scene, frame)
        return self._checked[1]

    def is_seen_like_the_reference(self, camera: Mapping[str, Any]) -> bool:
        """Whether a picture of that camera, by the attributes of its file, shows what the reference does; one that
        isn't known does."""
        if self._scene is None or self.reference is None:
            return False
        from pmviewer.output.frame_export import camera_metadata
        from pmviewer.viewer.sides import same_view

        width, height = self.reference.size
        settings = self._session.settings.camera.model_copy(update={"width": width, "height": height})
        return same_view(camera, camera_metadata(resolve_camera(self._scene, size_only(settings))))

    # measuring --------------------------------------------------------------------------------------------------

    def poll(self, frame: Frame | None, with_own: bool = True) -> None:
        """Once per window frame: take over what was loaded, and have the frame measured when it is its turn.

        `with_own`: whether the reference beside a scene that has just been opened is of that scene as it is.
        """
        scene = self._session.scene
        if scene is not self._scene:
            self._scene, self.reference = scene, None
            self._forget_runs()
            if scene is not None and with_own:
                self._load_own(scene)
        if self._arrived is not None:
            (of, reference), self._arrived = self._arrived, None
            if of is scene:
                self.reference = reference
                self._forget_runs()
        if frame is not None and not frame.coarse and self.problem(frame) is None:
            self._measure(frame)

    def _forget_runs(self) -> None:
        self.current = None
        self.earlier.clear()

    def clear_earlier(self) -> None:
        """Drop the curves of former settings; the current one stays."""
        self.earlier.clear()

    def _measure(self, frame: Frame) -> None:
        run = self.current
        if run is None or run.version != frame.version:
            run = self._begin(frame)
        passes = frame.statistics.passes
        done = run.points[-1].passes if run.points else 0
        last = self._session.status.state == "finished" and passes > done
        if self._background.running(MEASURING) or not (passes >= run.next_pass or last):
            return
        run.next_pass = next_mark(passes)
        reference, seconds, cpu = self.reference, frame.statistics.seconds, frame.statistics.cpu_seconds
        assert reference is not None

        def work() -> str:
            from pmviewer.output.metric import metrics

            run.points.append(Point(passes, seconds, cpu, metrics(frame.image(), reference.image)))
            return ""

        self._background.start(MEASURING, "measuring the error", work)

    def _begin(self, frame: Frame) -> Run:
        """A new curve. The one before is kept when it is one (two points), and of other settings."""
        new = run_of(frame)
        kept = [*self.earlier, *([self.current] if self.current else [])]
        same = (new.method, new.changed)
        self.earlier = [r for r in kept if len(r.points) > 1 and (r.method, r.changed) != same][-EARLIER_RUNS:]
        self.current = new
        return new

    def latest(self, frame: Frame | None) -> Point | None:
        """The newest figures of the settings that the frame was made with."""
        run = self.current
        if frame is None or run is None or run.version != frame.version or not run.points:
            return None
        return run.points[-1]


def _mismatch(reference: Reference, scene: Scene, frame: Frame) -> str | None:
    width, height = frame.camera.width, frame.camera.height
    if (width, height) != reference.size:
        wanted = "×".join(str(side) for side in reference.size)
        return f"The reference has {wanted} pixels, the picture {width}×{height}: only the same size can be compared."
    if frame.settings.edit.changes:
        return "The scene is edited: the reference shows it as it is in its file."
    own = resolve_camera(scene, size_only(frame.settings.camera))
    if not frame.camera.sees_like(own):
        if frame.settings.free_camera.on:
            return "The free camera is on: the reference is seen by the scene's own camera."
        if frame.settings.camera.clip != "off":
            return "The picture is clipped: the reference is not. Set camera.clip to off."
        if replace(frame.camera, aperture=own.aperture, focus=own.focus).sees_like(own):
            return (
                "The lens was changed: the reference is seen through the scene's own. Press Backspace to return to it."
            )
        return "The camera was moved: the reference is seen by the scene's own. Press Backspace to return to it."
    from pmviewer.render.camera import are_hidden
    from pmviewer.render.filter import is_own  # numba, which the window doesn't wait for

    if not is_own(own.filter, frame.settings.render):
        return "The reconstruction filter was changed: the reference has the scene's own (render.filter = auto)."
    if are_hidden(own.hides_lights, frame.settings.render) != own.hides_lights:
        return "The reference shows lights as the scene's file says (render.lights = auto)."
    return None


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, int):
        return grouped(value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
