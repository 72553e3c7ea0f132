"""The session: a worker thread that keeps the picture of the newest scene and settings up to date.

Requests (`open`, `set`, `pause` …) return at once. The worker drops what is out of date between slices of some 30 ms,
shows a coarse frame of the new state first, then refines it pass by pass until a stop rule holds. A coarse frame is
finished and shown even when newer settings have arrived meanwhile: a slider that moves all the time would otherwise
never show one.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from pmviewer.engine.ahead.ahead import Ahead
from pmviewer.engine.ahead.helper import Helper
from pmviewer.engine.checkpoint.autosave import KeptFilm
from pmviewer.engine.frame import Frame, Message, State, Status
from pmviewer.engine.frugal import Frugal
from pmviewer.engine.guarded import guarded
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.inspector.report import Pinned
from pmviewer.engine.loader import Loaded, Loader
from pmviewer.engine.opened import OpenScene, arrangement_of, is_edited, nobody, open_scene
from pmviewer.engine.pass_maker import PassMaker
from pmviewer.engine.pool import WorkPool, lower_priority
from pmviewer.engine.prepare import prepare
from pmviewer.engine.preview.previews import Previews
from pmviewer.engine.published import Published
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.engine.wanted import wanted_of
from pmviewer.engine.welcome import welcome
from pmviewer.scene.analysis import SceneTraits
from pmviewer.scene.arrays.tessellate import DrawGeometry
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings, changed_stages
from pmviewer.settings.needs import Facts

Source = str | Path | Scene
LONG_PASS, TELL_EVERY = 0.7, 0.2
"""Seconds after which a pass says what it is at, and how often."""
NO_MEMORY = "Not enough memory for these settings: lower N or the image size."


class Session:
    """See the module. All public attributes may be read from any thread."""

    def __init__(
        self,
        threads: int | None = None,
        settings: Settings | None = None,
        *,
        compiles_ahead: bool = False,
        clicks: bool = True,
        helper: Helper | None = None,
        cluster: str | None = None,
    ) -> None:
        """compiles_ahead: in a process beside this one, first in `helper` if that waits, the first picture and, with
        `clicks`, what they may need; cluster: whose workers render passes (`pmviewer.engine.pass_maker`)."""
        self.geometry: DrawGeometry | None = None
        self._published = Published()
        self._changed = self._published.changed
        self._opened: OpenScene | None = None
        self._settings = settings or Settings()
        self._loader = Loader(
            self._published,
            lambda: arrangement_of(self._settings),
            lambda: self._opened is not None,
            self._loaded_scene,
            self._rearrange,
        )
        self._version = 0
        self._restart = self._paused = self._closed = self._first_picture = False
        self._pixel: tuple[int, int] | None = None
        self._pinned: Pinned | None = None
        self._attempt = 0
        self._failed_version = -1
        self._pool = WorkPool(threads, behind_window=True)
        self._pool.on_progress = self._within_pass
        self._pass_began = self._told = 0.0
        self._stepping = self._stopped = False
        self._store = StageStore()
        self._frugal = Frugal(self._store)
        self._film = KeptFilm(self._published.say)
        self.workers = PassMaker(self._published, cluster, self._pool.threads)
        self._previews = Previews(self._pool, self._published)
        self._renderer: Renderer | None = None
        how = self._pool.threads, self._published.notify, helper
        self._ahead = Ahead(*how, clicks=clicks) if compiles_ahead else None
        self._worker = threading.Thread(target=self._work, name="pmviewer session", daemon=True)
        self._worker.start()

    # requests ---------------------------------------------------------------------------------------------------

    def open(
        self,
        source: Source,
        settings: Settings | None = None,
        parameters: Mapping[str, str] | None = None,
        film: Path | None = None,
    ) -> None:
        """Open a scene, with other settings if given, and go on with the `film` of a checkpoint. Until it is loaded the
        old one goes on; a failure becomes an error message and changes nothing."""
        with self._changed:
            chosen = settings or self._settings
            arrangement, ahead = arrangement_of(chosen), self._ahead
            on_type = nobody if ahead is None else partial(ahead.opening, settings=chosen)
            name = source.name if isinstance(source, Scene) else str(source)
            self._loader.start(lambda: open_scene(source, parameters or {}, arrangement, on_type), name, settings, film)

    def autosave(self, path: Path | None) -> None:
        """Keep the film in that file now and then (`display.autosave`), from now on; nowhere with None."""
        self._film.path = path

    def cancel_loading(self) -> None:
        """Give up the scene that is being loaded; the old one stays."""
        self._loader.cancel()

    def set(self, settings: Settings) -> int:
        """Use these settings from now on; returns the version that frames made with them will carry."""
        with self._changed:
            before, self._settings = self._settings, settings
            self._stopped = self._stopped and before == settings
            changed = changed_stages(before, settings)
            if not settings.display.compile_ahead:
                self.stop_compiling_ahead()
            if "scene" in changed:
                self._rearrange()
            if changed - {"scene", "display", "stop"}:
                self._outdate()
            else:
                self._settle()
            return self._version

    def _rearrange(self) -> None:
        """Arrange the open scene as the settings ask. A scene that is being loaded is arranged so anyway."""
        waiting = self._loader.loaded
        opened, geometry = (waiting.opened, waiting.geometry) if waiting else (self._opened, self.geometry)
        if opened is not None and not opened.is_arranged(arrangement_of(self._settings)):
            self._loader.rearrange(opened, geometry)

    def _loaded_scene(self, rearranged: bool) -> None:
        """The loader has a scene. A first picture of the scene before it was edited is shown, or dragging a light would
        never show any."""
        if rearranged and self._first_picture:
            self._changed.notify_all()
        else:
            self._interrupt()

    def restart(self) -> None:
        """Forget the film and begin with pass 0."""
        with self._changed:
            self._restart, self._stopped = True, False
            self._outdate()

    def inspect(self, pixel: tuple[int, int] | None) -> None:
        """Frames shall hold the gather rays of this pixel (x, y) of the image, while that overlay is shown."""
        with self._changed:
            self._pixel = pixel
            self._changed.notify_all()

    def pin(self, pinned: Pinned | None) -> None:
        """Frames shall tell what made this pixel, and a photon's life; nothing more with None."""
        with self._changed:
            self._pinned = pinned
            self._changed.notify_all()

    def pause(self) -> None:
        """Stop after the current pass; a changed setting still shows its first pass."""
        with self._changed:
            self._paused = True
            self._settle()

    def stop(self) -> None:
        """Pause at once: what the running pass has done is dropped. Going on begins with the first pass."""
        with self._changed:
            self._paused = True
            self._stopped = self._stepping
            if self._stepping:
                self._interrupt()
            else:
                self._settle()

    def resume(self) -> None:
        """Go on after a pause."""
        with self._changed:
            self._paused = self._stopped = False
            self._settle()

    def close(self) -> None:
        """Stop the worker and its threads; returns when they are gone."""
        with self._changed:
            self._closed = True
            self._loader.close()
            self._interrupt()
        if self._ahead is not None:
            self._ahead.close()
        self._worker.join()
        self.workers.close()
        self._pool.close()

    def _outdate(self) -> None:
        """What was rendered so far is of an older version."""
        self._version += 1
        if self._first_picture:
            self._changed.notify_all()
        else:
            self._interrupt()

    def _settle(self) -> None:
        """Say whether the picture of the newest version is finished, paused or going on."""
        renderer = self._renderer
        if renderer is not None and not self._is_stale():
            state: State = "finished" if self._is_finished() else "paused" if self._paused else "rendering"
            progress = min(1.0, renderer.passes / self._settings.render.passes)
            self._published.status = Status(state, state, renderer.passes, progress)
            if state != "rendering":
                self._published.bare()
        self._changed.notify_all()

    def _interrupt(self) -> None:
        self._pool.cancel.set()
        self._changed.notify_all()

    # state ------------------------------------------------------------------------------------------------------

    @property
    def on_update(self) -> Callable[[], None] | None:
        """Called from any thread when something has changed."""
        return self._published.on_update

    @on_update.setter
    def on_update(self, listener: Callable[[], None] | None) -> None:
        self._published.on_update = listener

    @property
    def frame(self) -> Frame | None:
        """The newest one."""
        return self._published.frame

    @property
    def is_newest(self) -> bool:
        """Whether the newest frame is of the newest scene and settings, as far as these decide what is rendered, and
        holds what the display asks for."""
        with self._changed:
            frame = self.frame
            newest = frame is not None and frame.version == self._version
            return newest and not self._loader.waits and self._unseen() is None

    @property
    def status(self) -> Status:
        """What goes on now."""
        return self._published.status

    @property
    def loading(self) -> str:
        """What the loader is doing ("ball.ply: building the tree …"), "" when nothing is being loaded."""
        return self._loader.text

    @property
    def settings(self) -> Settings:
        """Those that are asked for."""
        return self._settings

    @property
    def paused(self) -> bool:
        """Whether the user has paused."""
        return self._paused

    @property
    def scene(self) -> Scene | None:
        """The open one."""
        return self._opened.scene if self._opened else None

    @property
    def scene_path(self) -> str:
        """What the open scene was opened by: a file or a bundled scene's name."""
        return self._opened.source if self._opened else ""

    @property
    def traits(self) -> SceneTraits | None:
        """Of the open scene."""
        return self._opened.traits if self._opened else None

    @property
    def threads(self) -> int:
        """How many the kernels run on."""
        return self._pool.threads

    @property
    def opened_scene(self) -> OpenScene | None:
        """The open scene with all that was derived from it, for renderers beside the session's."""
        return self._opened

    @property
    def kept_bytes(self) -> int:
        """Of photons and maps that are kept for a return to settings of before."""
        return self._store.bytes

    @property
    def ahead(self) -> str:
        """What is being compiled ahead ("estimate.lookup = nearest (3 of 20)"), "" when nothing is."""
        return self._ahead.text if self._ahead is not None else ""

    def stop_compiling_ahead(self) -> None:
        """Compile nothing ahead until something is changed."""
        if self._ahead is not None:
            self._ahead.stop()

    def take_messages(self) -> list[Message]:
        """Messages since the last call."""
        return self._published.take_messages()

    def wait(self, passes: int | None = None, timeout: float | None = None) -> bool:
        """Wait for that many passes of the newest settings, or for the stop rule. False after `timeout` seconds or when
        the session failed or was closed."""

        def reached() -> bool:
            if self._closed or self._has_failed():
                return True
            frame = self.frame
            if frame is None or not self.is_newest:
                return False
            done = frame.statistics.passes if not frame.coarse else 0
            return self.status.state == "finished" or (passes is not None and done >= passes)

        with self._changed:
            return self._changed.wait_for(reached, timeout) and not self._closed and not self._has_failed()

    def _has_failed(self) -> bool:
        """Whether nothing more will come of the last request."""
        if self._loader.waits:
            return False
        if self._opened is None:
            return self.status.state == "failed"
        return self._failed_version == self._version

    # worker -----------------------------------------------------------------------------------------------------

    def _work(self) -> None:
        lower_priority()
        while True:
            with self._changed:
                self._frugal.wait(self._changed, self._has_work)
                if self._closed:
                    return
                self._pool.cancel.clear()
                loaded, before = self._loader.take(), self._opened
                if loaded is not None:
                    self._adopt(loaded)
            guarded(partial(self._turn, loaded, before), self._fail, self._drop, NO_MEMORY)

    def _turn(self, loaded: Loaded | None, before: OpenScene | None) -> None:
        if loaded is not None:
            note = self.geometry.note if self.geometry is not None else ""
            for level, text in welcome(loaded.opened, before, note):
                self._published.say(level, text)
            return
        try:
            self._advance()
        except MemoryError:
            self._store.clear()
            raise

    def _drop(self) -> None:
        """What was being rendered is out of date, or unwanted."""
        self._renderer = None
        self.workers.drop()
        if self._stopped:
            self._tell("paused", "stopped within a pass; going on begins anew")

    def _has_work(self) -> bool:
        if self._closed or self._loader.loaded is not None:
            return True
        if self._opened is None or self._stopped:
            return False
        if self._is_stale():
            return self._failed_version != self._version
        if self._unseen() is not None:
            return True
        return not self._paused and not self._is_finished()

    def _is_stale(self) -> bool:
        return self._renderer is None or self._renderer.version != self._version or self._restart

    def _wanted(self, renderer: Renderer) -> Wanted:
        """What the display asks for now."""
        return wanted_of(Facts(self._settings, renderer.plan, renderer.scene.traits), self._pixel, self._pinned)

    def _unseen(self) -> Wanted | None:
        """What the display asks for, if the newest frame lacks it. The pass that follows a coarse frame brings it."""
        renderer, frame = self._renderer, self.frame
        if renderer is None or frame is None or frame.coarse or frame.version != renderer.version:
            return None
        wanted = self._wanted(renderer)
        return wanted if wanted.lacks(frame.inspection.wanted) else None

    def _is_finished(self) -> bool:
        return self._renderer is None or self._renderer.stops_by(self._settings)

    def _adopt(self, loaded: Loaded) -> None:
        """Make a loaded scene the open one."""
        if not is_edited(self._opened, loaded.opened):
            self._pixel = self._pinned = None
        self._store.clear()
        self._opened, self.geometry, self._renderer = loaded.opened, loaded.geometry, None
        self._film.go_on_with = loaded.film
        if loaded.settings is not None:
            self._settings = loaded.settings
        self._version, self._stopped = self._version + 1, False

    def _advance(self) -> None:
        """A coarse frame for a new state, one pass for a known one."""
        assert self._opened is not None
        known = self._renderer
        if known is not None and not self._is_stale():
            if (wanted := self._unseen()) is not None:
                self._look(known, wanted)
            else:
                self._step(known)
            return
        if known is not None:
            known.drop()
        with self._changed:
            version, settings, self._restart = self._version, self._settings, False
            self._first_picture, self._attempt = True, version
        try:
            prepare(self._opened, settings, self._pool, lambda text, share: self._tell("preparing", text, share))
            make = partial(Renderer, self._opened, settings, self._pool, self._store, version)
            renderer = self._film.renderer(make)
            self._frugal.begin(settings.photons.N)
            self._tell("rendering", "first picture")
            draw = renderer.frame if renderer.passes else renderer.coarse_frame
            frame = draw(self._published.serial + 1, self._wanted(renderer))
            self._published.show(frame, self._version)
            self._published.warn(frame.statistics.warnings, anew=True)
        finally:
            with self._changed:
                self._first_picture = False
        self._renderer = renderer
        if renderer.passes:
            with self._changed:
                self._settle()
        elif not self._is_stale():
            self._previews.draw_out(renderer, frame, self._settings)
            if self._paused:
                self._step(renderer)

    def _within_pass(self, stage: str, share: float | None) -> None:
        """What the pool is at. Said of passes that somebody may be waiting for."""
        now = time.monotonic()
        if self._stepping and now - self._pass_began > LONG_PASS and now - self._told > TELL_EVERY:
            self._told = now
            self._published.stage(stage, share)

    def _step(self, renderer: Renderer) -> None:
        with self._changed:
            self._pass_began, self._stepping = time.monotonic(), True
        try:
            self.workers.step(renderer, self._settings.render.passes)
            with self._changed:
                self._stopped = False  # too late
            self._frugal.after_pass(renderer.passes)
        finally:
            with self._changed:
                self._stepping = False
        frame = renderer.frame(self._published.serial + 1, self._wanted(renderer))
        self._published.warn(frame.statistics.warnings, anew=False)
        self._previews.show(renderer, frame, self._settings, self._is_finished(), self._version)
        if self._ahead is not None:
            self._ahead.shown(renderer.scene, self._settings)
        self._film.after_pass(renderer, self._settings.display.autosave, self._is_finished())
        with self._changed:
            self._settle()
        self._published.notify()

    def _look(self, renderer: Renderer, wanted: Wanted) -> None:
        """Add to the newest frame what the display asks for. The first time its kernels are compiled."""
        frame = self.frame
        assert frame is not None
        self._tell("rendering", "making what is shown")
        self._published.show(renderer.looked_at(frame, self._published.serial + 1, wanted), self._version)
        with self._changed:
            self._settle()
        self._published.notify()

    def _tell(self, state: State, text: str, progress: float | None = None) -> None:
        self._published.tell(state, text, self._renderer.passes if self._renderer else 0, progress)

    def _fail(self, text: str) -> None:
        """Report that the newest settings can't be rendered; the last frame stays, other settings may follow."""
        self._published.say("error", text)
        with self._changed:
            self._renderer, self._failed_version = None, self._attempt
            self._published.status = Status("failed", text)
            self._changed.notify_all()
        self._published.notify()
