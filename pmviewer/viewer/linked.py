"""Snapshots as the live camera sees the scene now: rendered again by their own settings, beside the session.

A snapshot is a picture of one camera. With linked cameras (`compare.linked`) those that are compared are rendered once
more wherever the live picture's camera goes: first coarse, then pass by pass, up to as many passes as the snapshot has.
Where that camera is the snapshot's own, the snapshot itself is shown. The picture is what `pmviewer render` would make
of these settings, bit for bit.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pmviewer.engine.frame import Frame
from pmviewer.errors import PmviewerError
from pmviewer.progress import Cancelled
from pmviewer.settings.access import Settings
from pmviewer.viewer.background import LINKING, Background, Work
from pmviewer.viewer.gl.textures import Same
from pmviewer.viewer.session_link import SessionLike
from pmviewer.viewer.sides import frame_side, same_camera, snapshot_side

if TYPE_CHECKING:  # numba and OpenEXR, which the window doesn't wait for
    from pmviewer.engine.pool import WorkPool
    from pmviewer.engine.store import StageStore
    from pmviewer.output.snapshot import Snapshot

SHOW_EVERY = 0.25
"""Seconds between two pictures of one snapshot."""
UNDER_WAY = "Linked: the snapshot is being rendered as the live camera sees it."


@dataclass(eq=False)
class _Job:
    """Snapshots with the settings by which they are rendered, for one camera of one scene, which `key` tells."""

    key: Hashable
    scene: Any
    opened: Any
    wanted: list[tuple[Snapshot, Settings]]
    pool: WorkPool
    coarse: bool = False
    """Whether the first pictures of all are there: they are shown even where the camera has moved on meanwhile."""
    stale: bool = False
    """Whether another camera waits: the job ends with its coarse pictures."""
    work: Work | None = field(default=None)


class Linked:
    """Lives as long as the window, whose thread calls everything. `version` grows with each new picture."""

    def __init__(self, session: SessionLike, background: Background) -> None:
        self.version = 0
        self.on_update: Callable[[], None] | None = None
        self._session = session
        self._background = background
        self._job: _Job | None = None
        self._done: Hashable = None
        """Key of the last job that came to its end, by an error, too."""
        self._pictures: dict[int, tuple[Same, Frame]] = {}
        """By the snapshot's number: its layers, and the newest picture."""
        self._arrived: list[tuple[_Job, Snapshot, Frame]] = []
        self._own: dict[Hashable, bool] = {}
        self._store: StageStore | None = None
        self._scene: Any = None
        self._arranged: tuple[Any, Any, Any] | None = None

    # what is shown ----------------------------------------------------------------------------------------------

    def frame(self, snapshot: Snapshot, live: Frame | None) -> Frame | None:
        """What to show of that snapshot beside the live picture; None where it is the snapshot itself."""
        kept = self._pictures.get(snapshot.number)
        if live is None or kept is None or kept[0] != Same(snapshot.layers) or self._is_its_own(snapshot, live):
            return None
        return kept[1]

    def note(self, snapshot: Snapshot, live: Frame | None) -> str:
        """What to know of that snapshot: why it stays as it is, or that its picture is on its way. Empty where it is
        seen by the live camera."""
        if live is None or self._is_its_own(snapshot, live):
            return ""
        why = self._refusal(snapshot)
        if why:
            return why
        shown = self.frame(snapshot, live)
        return "" if shown is not None and shown.camera.sees_like(live.camera) and not shown.coarse else UNDER_WAY

    def _refusal(self, snapshot: Snapshot) -> str:
        scene = self._session.scene
        if snapshot.settings is None:
            return f"“{snapshot.name}” can't be linked: its settings aren't known, no file of this program."
        of = str(snapshot.about.get("scene", ""))
        if scene is not None and of != scene.name:
            return f"“{snapshot.name}” can't be linked: it is of the scene {of}, which is not open."
        return ""

    def _is_its_own(self, snapshot: Snapshot, live: Frame) -> bool:
        """Whether the live picture is of the snapshot's own camera and size."""
        key = Same(snapshot.layers), live.camera
        if key not in self._own:
            a, b = snapshot_side(snapshot), frame_side(live, "")
            self._own = {**dict(list(self._own.items())[-3:]), key: a.size == b.size and same_camera(a, b)}
        return self._own[key]

    # rendering --------------------------------------------------------------------------------------------------

    def poll(self, snapshots: Sequence[Snapshot], live: Frame | None) -> None:
        """Once per window frame: take over what was rendered, and have these snapshots rendered for the live picture's
        camera. With none of them everything is forgotten."""
        opened = self._session.opened_scene
        scene = None if opened is None else opened.content or opened.whole  # the same whatever is edited in it
        if scene is not self._scene:
            self._scene = scene
            self._forget()
        if not snapshots or opened is None or live is None:
            self._stop()
            if self._job is None and (self._pictures or self._arrived or self._store is not None):
                self._forget()
            return
        self._take()
        if self._job is not None and self._job.work is not None and not self._job.work.running:
            self._done, self._job = self._job.key, None
        wanted = [one for one in snapshots if not (self._refusal(one) or self._is_its_own(one, live))]
        key = (Same(scene), live.camera, *(Same(one.layers) for one in wanted))
        if not wanted or key == self._done:
            self._stop()
        elif self._job is None:
            self._start(_Job(key, scene, opened, [(one, _settings(one, live)) for one in wanted], self._pool()))
        elif self._job.key != key:
            self._stop()

    def _pool(self) -> WorkPool:
        from pmviewer.engine.pool import WorkPool

        return WorkPool(self._session.threads, behind_window=True)

    def _start(self, job: _Job) -> None:
        self._job = job
        title = "rendering snapshots as the camera sees them"
        job.work = self._background.start(LINKING, title, lambda: self._run(job), stop=job.pool.cancel.set)

    def _stop(self) -> None:
        """End the job; one that has shown nothing yet ends with its coarse pictures."""
        job = self._job
        if job is None or job.work is None:
            return
        job.stale = True
        if not job.work.running:
            self._job = None
        elif job.coarse:
            job.work.cancel()

    def _take(self) -> None:
        while self._arrived:
            job, snapshot, frame = self._arrived.pop(0)
            if job.scene is self._scene:
                self._pictures[snapshot.number] = Same(snapshot.layers), frame
                self.version += 1

    def _forget(self) -> None:
        self._stop()
        self._arrived.clear()
        self._pictures.clear()
        self._store = self._arranged = self._done = None
        self.version += 1

    # on the lane's thread ---------------------------------------------------------------------------------------

    def _run(self, job: _Job) -> str:
        from pmviewer.engine.pool import lower_priority

        lower_priority()
        try:
            self._render(job)
        except Cancelled:
            return ""  # the camera moves: nobody wants to hear of it
        except MemoryError:
            raise PmviewerError("Not enough memory to render the snapshots again: unlink the cameras.") from None
        finally:
            job.pool.close()
        return ""

    def _render(self, job: _Job) -> None:
        from pmviewer.engine.opened import arrangement_of, rearranged
        from pmviewer.engine.prepare import prepare
        from pmviewer.engine.renderer import Renderer
        from pmviewer.engine.store import StageStore

        store = self._store = self._store or StageStore()
        renderers = []
        for snapshot, settings in job.wanted:
            arrangement = arrangement_of(settings)
            if self._arranged is None or self._arranged[0] is not job.scene or self._arranged[1] != arrangement:
                self._arranged = job.scene, arrangement, rearranged(job.opened, arrangement)
            opened = self._arranged[2]
            prepare(opened, settings, job.pool, lambda text, share: None)
            renderer = Renderer(opened, settings, job.pool, store)
            self._publish(job, snapshot, renderer.coarse_frame(0))
            renderers.append((snapshot, renderer))
        job.coarse = True
        shown = 0.0
        while not job.stale and (left := [(one, of) for one, of in renderers if not of.finished]):
            for _, renderer in left:
                renderer.step()
            now = time.monotonic()
            if now - shown > SHOW_EVERY or all(renderer.finished for _, renderer in left):
                shown = now
                for snapshot, renderer in left:
                    self._publish(job, snapshot, renderer.frame(renderer.passes))

    def _publish(self, job: _Job, snapshot: Snapshot, frame: Frame) -> None:
        self._arrived.append((job, snapshot, frame))
        if self.on_update:
            self.on_update()


def _settings(snapshot: Snapshot, live: Frame) -> Settings:
    """The snapshot's own with the live picture's cameras: as many passes as it has, nothing drawn over it."""
    of, now, plain = snapshot.settings, live.settings, Settings()
    assert of is not None
    passes = int(snapshot.figure("passes") or of.render.passes)
    render = of.render.model_copy(update={"passes": max(passes, 1), "time_limit": 0.0, "error": 0.0})
    return of.model_copy(
        update={
            "camera": now.camera,
            "free_camera": now.free_camera,
            "render": render,
            "region": plain.region,
            "overlays": plain.overlays,
            "compare": plain.compare,
            "display": of.display.model_copy(update={"view": "beauty"}),
        }
    )
