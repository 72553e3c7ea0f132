"""The comparison with and without importance in the window: it runs beside the session, which goes on undisturbed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pmviewer.engine.frame import Frame, Level
from pmviewer.errors import PmviewerError
from pmviewer.render.camera import CameraPose
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings
from pmviewer.viewer.background import COMPARING, Background, Work
from pmviewer.viewer.session_link import SessionLike

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.engine.comparison.importance_gain import Gain, Truth
    from pmviewer.engine.pool import WorkPool

NOT_COMPARED = ("compare.", "display.", "overlays.", "free_camera.", "render.passes", "render.time_limit")
"""Settings that don't make a result another one's; the camera of its picture is compared as a pose."""


class GainRun:
    """At most one comparison at a time, with a pool of its own; `gain` is the latest result, `shown` whether
    the viewport shows it. Methods are for the window's thread."""

    def __init__(self, session: SessionLike, background: Background, say: Callable[[Level, str], None]) -> None:
        self._session = session
        self._background = background
        self._say = say
        self.gain: Gain | None = None
        self.settings: Settings | None = None
        """What `gain` was made with."""
        self.shown = False
        self.progress: tuple[str, float | None] = ("", None)
        self.on_update: Callable[[], None] | None = None
        self._scene: Scene | None = None
        self._ticket = 0
        self._work: Work | None = None
        self._arrived: tuple[int, Scene | None, Settings, Gain] | None = None

    @property
    def running(self) -> bool:
        """Whether a comparison is being made now."""
        return self._work is not None and self._work.running

    def refusal(self) -> str | None:
        """Why there is nothing to compare now, None if there is."""
        traits = self._session.traits
        if traits is None or self._session.opened_scene is None:
            return "Open a scene first."
        from pmviewer.engine.comparison.without_importance import refusal

        return refusal(self._session.settings, traits)

    def start(self, truth: Truth | None) -> None:
        """Compare by the present settings; errors are against `truth`, or a longer run."""
        why = self.refusal()
        if self.running or why is not None:
            if why is not None:
                self._say("warning", f"No comparison: {why}")
            return
        from pmviewer.engine.pool import WorkPool

        self._ticket += 1
        self.progress = "starting", None
        ticket, pool = self._ticket, WorkPool(self._session.threads, behind_window=True)
        opened, settings = self._session.opened_scene, self._session.settings
        self._work = self._background.start(
            COMPARING,
            "comparing with and without importance",
            lambda: self._run(ticket, opened, settings, pool, truth),
            stop=pool.cancel.set,
        )

    def _run(self, ticket: int, opened: Any, settings: Settings, pool: WorkPool, truth: Truth | None) -> str:
        from pmviewer.engine.comparison.importance_gain import compare
        from pmviewer.engine.pool import lower_priority

        lower_priority()
        try:
            gain = compare(opened, settings, pool, self._tell, truth)
        except MemoryError:
            raise PmviewerError("Not enough memory for the comparison: lower N or the image size.") from None
        finally:
            pool.close()
        self._arrived = ticket, opened.scene, settings, gain
        return "The comparison with and without importance is finished."

    def _tell(self, text: str, share: float | None) -> None:
        self.progress = text, share
        self._notify()

    def _notify(self) -> None:
        if self.on_update:
            self.on_update()

    def cancel(self) -> None:
        """Stop the one that is running; the result before stays."""
        if self._work is not None:
            self._work.cancel()

    def poll(self, camera: CameraPose | None) -> None:
        """Once per window frame: take over a result; forget it with its scene, hide it when the camera moves."""
        scene = self._session.scene
        if scene is not self._scene:
            self._scene, self.gain, self.settings, self.shown = scene, None, None, False
            self.cancel()
        if self._arrived is not None:
            (ticket, of, settings, gain), self._arrived = self._arrived, None
            if ticket == self._ticket and of is scene:
                self.gain, self.settings, self.shown = gain, settings, True
        if self.shown and not self.fits(camera):
            self.shown = False

    def fits(self, camera: CameraPose | None) -> bool:
        """Whether the result is what that camera sees."""
        return self.gain is not None and camera is not None and self.gain.with_.frame.camera == camera

    def frames(self) -> tuple[Frame, Frame] | None:
        """What the viewport shows instead of the session's frame: with importance, and without."""
        return self.gain.frames() if self.shown and self.gain is not None else None

    def changed_since(self) -> list[str]:
        """Settings that are no longer those of the result."""
        if self.settings is None:
            return []
        from pmviewer.settings.access import flat

        now, then = flat(self._session.settings), flat(self.settings)
        return [path for path, value in now.items() if value != then[path] and not path.startswith(NOT_COMPARED)]
