"""A scene with its settings and its film, for programs in Python: what `pmviewer.open` gives."""

from __future__ import annotations

import threading
import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pmviewer.engine.ahead.beside import beside
from pmviewer.engine.auto.choose import Choice, Goal, choose
from pmviewer.engine.checkpoint.checkpoint import Job, read_checkpoint, write_checkpoint
from pmviewer.engine.effects import facts_of, inactive_reason
from pmviewer.engine.frame import Frame, PhotonCloud
from pmviewer.engine.inspection import Inspection
from pmviewer.engine.opened import arrangement_of, open_scene, rearranged
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.session import NO_MEMORY
from pmviewer.engine.store import StageStore
from pmviewer.engine.wanted import looked_map, wanted_of
from pmviewer.errors import PictureWarning, PmviewerError, SceneError, SettingError
from pmviewer.library.frame import RenderedFrame
from pmviewer.library.interrupt import interrupts_between_passes
from pmviewer.library.live import Live, Scripted
from pmviewer.library.names import changed_by, path_of
from pmviewer.library.photons import Photons, check_map, photons_of
from pmviewer.output.session_file import read_session
from pmviewer.progress import watched
from pmviewer.scene.description import Scene
from pmviewer.settings.access import SETTINGS, Settings, changed_stages, flat, get, with_values
from pmviewer.settings.needs import Facts
from pmviewer.settings.schema.display import MAP_VIEWS

if TYPE_CHECKING:
    from pmviewer.library.attaching.attached import Attached

Progress = Callable[[str, float | None], None]
"""Hears what is being done, and the share of it that is done, None where that is not known."""


class Rendering:
    """A scene, settings, and what was rendered of it with these. Made by `pmviewer.open`; see there for arguments.

    The same scene, settings and passes give the same picture bit for bit as in the window and on the command line. One
    thread at a time may use it. `close` it, or use it in a `with` statement.
    """

    def __init__(
        self,
        scene: str | Path | Scene,
        settings: Mapping[str, Any] | None = None,
        *,
        parameters: Mapping[str, Any] | None = None,
        search_paths: Sequence[str | Path] = (),
        threads: int | None = None,
    ) -> None:
        if threads is not None and not 1 <= threads <= 1024:
            raise SettingError(f"threads = {threads} is not allowed: expected a whole number from 1 to 1024.")
        self._parameters = {name: str(value) for name, value in (parameters or {}).items()}
        before = Settings()
        if not isinstance(scene, Scene) and str(scene).lower().endswith(".toml"):
            session = read_session(scene)
            before, scene = session.settings, session.scene
            self._parameters = {**session.parameters, **self._parameters}
            if session.passes:
                before = with_values(before, {"render.passes": session.passes})
        self._settings = changed_by(before, settings or {})
        self._search_paths = [Path(folder) for folder in search_paths]
        for folder in self._search_paths:
            if not folder.is_dir():
                raise SceneError("This search path is not a folder.", folder, hint="Name an existing folder.")
        with watched(threads=threads):
            self._opened = open_scene(
                scene,
                self._parameters,
                arrangement_of(self._settings),
                beside(self._settings, threads),
                self._search_paths,
            )
        self._pool = WorkPool(threads)
        self._store = StageStore()
        self._renderer: Renderer | None = None
        self._told: set[str] = set()
        self._busy = threading.Lock()
        self._closed = False
        content = self._opened.scene
        self._warn(*content.warnings, *(f"{count} × {reason} left out" for reason, count in content.dropped.items()))

    def __repr__(self) -> str:
        return f"<rendering of {self.scene.name}: {self.passes} passes{', closed' if self._closed else ''}>"

    # settings ---------------------------------------------------------------------------------------------------

    def set(self, values: Mapping[str, Any] | None = None, /, **more: Any) -> None:
        """Change settings: `s.set(N=200_000, q=0.5)`, `s.set({"gather.roulette": 0.1})`.

        Names are full ("photons.N") or as short as they are unambiguous ("q", "radius", "caustic.show"); `pmviewer
        settings` lists them. Values are numbers, bools, texts, tuples of three. What was rendered is forgotten where
        it depends on them, so that the next `render` begins with the first pass; photons and maps that don't are kept.

        Raises SettingError, naming setting, value and what is allowed, and changes nothing then; SceneError where the
        scene can't be lit as asked.
        """
        with self._alone():
            settings = changed_by(self._settings, {**(values or {}), **more})
            changed = changed_stages(self._settings, settings)
            if "scene" in changed:
                self._opened = rearranged(self._opened, arrangement_of(settings))
                self._store.clear()
            if changed - {"display", "stop"}:
                self._renderer = None
            self._settings = settings

    def edit(self, edits: Mapping[str, Any]) -> None:
        """Change lights, materials and objects, on top of what is edited already: `s.edit({"light.1.power": 2,
        "material.wall.colour": (0.8, 0.2, 0.2)})`. None takes an edit back. Names are the file's or numbers from 1.

        What was rendered is forgotten. Raises SettingError for what can't be an edit, SceneError for what the scene
        does not have; nothing is changed then.
        """
        changes: dict[str, Any] = {**self._settings.edit.changes, **edits}
        self.set({"edit.changes": {name: value for name, value in changes.items() if value is not None}})

    def get(self, name: str) -> Any:
        """The value of a setting, by the same names. Raises SettingError."""
        return get(self._settings, path_of(name))

    @property
    def settings(self) -> Settings:
        """All of them, frozen: `s.settings.photons.N`."""
        return self._settings

    @property
    def changed(self) -> dict[str, Any]:
        """By full name, those that have not their default."""
        return {name: value for name, value in flat(self._settings).items() if value != SETTINGS[name].default}

    # pictures ---------------------------------------------------------------------------------------------------

    @property
    def scene(self) -> Scene:
        """The description of the open scene."""
        return self._opened.scene

    @property
    def passes(self) -> int:
        """Rendered with the settings as they are."""
        return self._renderer.passes if self._renderer is not None else 0

    def choose(
        self, seconds: float | None = None, error: float | None = None, progress: Progress | None = None
    ) -> tuple[str, ...]:
        """Let a short trial choose method, N, radius and the like for so many seconds of rendering, or for a relMSE,
        and set them: `print(*s.choose(seconds=10), sep="\\n")`. Gives the sentences that say what and why.

        What was set of these before is replaced; the picture's error is not a stop rule by that: set `render.error`.
        Raises SettingError.
        """
        for name, value in (("seconds", seconds), ("error", error)):
            if value is not None:
                _check_number(f"choose({name}", value, Real)
        goal = Goal((seconds or 0.0) * self._pool.threads, error or 0.0)
        tell = progress or (lambda text, share: None)
        with self._alone():
            choice: Choice = self._within_memory(lambda: choose(self._opened, self._settings, goal, self._pool, tell))
        self.set(choice.values)
        return choice.sentences

    def render(
        self, passes: int | None = None, seconds: float | None = None, progress: Progress | None = None
    ) -> RenderedFrame:
        """Render further passes and give the picture of all passes so far.

        Parameters
        ----------
        passes: how many more. With `seconds` whichever is reached first.
        seconds: of rendering, by wall clock; the pass in which they end is finished.
        progress: called as progress(text, share of it that is done or None) before and after each pass.

        With neither, rendering stops where the settings say (`render.passes`, `render.time_limit`), for a session file
        after its passes. The first time kernels are compiled, for some seconds.

        KeyboardInterrupt comes between two passes, and the next `render` goes on from there; a second Ctrl+C doesn't
        wait for the end of the pass, and the next `render` begins anew. Raises SettingError for settings that can't be
        rendered. What the picture doesn't show is a PictureWarning, once.
        """
        if passes is not None:
            _check_number("render(passes", passes, Integral)
        if seconds is not None:
            _check_number("render(seconds", seconds, Real)
        tell = progress or (lambda text, share: None)
        with self._alone():
            renderer: Renderer = self._within_memory(lambda: self._ready(tell))
            first, start = renderer.passes, renderer.tally.seconds

            def done() -> float:
                if passes is None and seconds is None:
                    render = self._settings.render
                    shares = [renderer.passes / render.passes]
                    shares += [renderer.tally.seconds / render.time_limit] if render.time_limit > 0 else []
                    return max(shares)
                by_passes = (renderer.passes - first) / passes if passes else 0.0
                return max(by_passes, (renderer.tally.seconds - start) / seconds if seconds else 0.0)

            with interrupts_between_passes() as interrupt:
                while (share := done()) < 1:
                    tell(f"pass {renderer.passes + 1}", share)
                    self._step(renderer)
                    interrupt()
            tell(f"pass {renderer.passes}", 1.0)
            return self._frame(renderer)

    def frame(self) -> RenderedFrame:
        """The picture as it stands, after an interrupt for example. Raises SettingError before the first pass."""
        with self._alone():
            if self._renderer is None or not self._renderer.passes:
                raise SettingError("Nothing has been rendered with these settings yet: call render(passes=…).")
            return self._frame(self._renderer)

    def save(self, path: str | Path) -> None:
        """Write a checkpoint of what is rendered, a file ending in .checkpoint, with which another process goes on:
        `resume`, or `pmviewer render --resume`. Raises SettingError before the first pass, and OutputError; the file
        from before stays whole then."""
        with self._alone():
            if self._renderer is None or not self._renderer.passes:
                raise SettingError("Nothing has been rendered with these settings yet: call render(passes=…).")
            write_checkpoint(Path(path), self._renderer, Job(self._opened.source, self._parameters))

    def resume(self, path: str | Path) -> None:
        """Go on with the passes of a checkpoint, bit for bit, in place of what is rendered.

        The scene's content and the settings must be the checkpoint's, but for those of the display and of when to stop.
        Raises SceneError, which says what differs, and for a damaged file; what is rendered stays then.
        """
        with self._alone():
            found = read_checkpoint(path)
            prepare(self._opened, self._settings, self._pool, lambda text, share: None)
            renderer = Renderer(self._opened, self._settings, self._pool, self._store)
            if said := found.check(renderer):
                self._warn(f"The last bits of the picture may differ from here on: {said}")
            self._within_memory(lambda: found.resume(renderer))
            self._renderer = renderer

    def photons(self, map: str = "global", passes: int = 1) -> Photons:
        """The photons that pass number `passes` has in the "global" or "caustic" map, without rendering a picture.

        Raises SettingError where these settings make no such map in this scene.
        """
        check_map(map)
        _check_number("photons(passes", passes, Integral)
        with self._alone():
            reason = inactive_reason(f"overlays.{map}.show", self._settings, self._opened.traits)
            if reason is not None:
                raise SettingError(f"photons('{map}'): {reason}")

            def traced() -> tuple[bool, Any]:
                renderer = Renderer(self._opened, self._settings, self._pool, self._store)
                return renderer.plan.banded, renderer.photons_alone(passes)

            banded, made = self._within_memory(traced)
            of_caustics = map == "caustic"
            rows, unit = (made.caustic, made.caustic_unit) if of_caustics else (made.global_, made.global_unit)
            cloud = PhotonCloud(rows, unit, banded=banded)
            scene = self._opened.scene
            return photons_of(map, cloud, self._settings, scene.name, passes, tuple(scene.warnings))

    def show(self, script: Callable[[Live], None] | None = None) -> dict[str, Any]:
        """Open the window on the same scene with the same settings, and return when it is closed.

        It is a window of its own: it renders for itself. What is changed in it is not changed here but returned, by
        full name: `s.set(s.show())` takes it over. `script` is called on a thread of its own with the open window
        (`pmviewer.library.live.Live`), which it can change and read while the user does; its error ends the script
        alone and is raised when the window is closed. Raises WindowError without a display or OpenGL, SceneError for a
        scene that was made in Python, which the window can't open.
        """
        with self._alone():
            if self._opened.content is None:
                raise SceneError("The window opens files, and this scene was made in Python.")
            from pmviewer.scene.load import search_also
            from pmviewer.viewer.app import ViewerApp
            from pmviewer.viewer.start import start_viewer

            search_also(self._search_paths)
            scripted, before = Scripted(script), flat(self._settings)

            def make(*arguments: Any, **options: Any) -> ViewerApp:
                return scripted.begin(ViewerApp(*arguments, **options))

            source, threads = self._opened.source, self._pool.threads
            start_viewer(make, source, self._settings, threads, self._parameters)
            after = flat(scripted.end())
            return {path: value for path, value in after.items() if value != before[path]}

    def window(self) -> Attached:
        """Open the window in a process of its own, on the same scene with the same settings, and return at once, with
        it attached (`pmviewer.library.attaching.attached`). Both go their own ways from then on: it renders for itself,
        and `window.show(s.render(passes=1))` shows in it what is rendered here. Raises WindowError without a display or
        OpenGL, SceneError for a scene that was made in Python.
        """
        with self._alone():
            if self._opened.content is None:
                raise SceneError("The window opens files, and this scene was made in Python.")
            from pmviewer.library.attaching.attached import opened
            from pmviewer.output.frame_export import setting_texts

            texts, plain = setting_texts(self._settings), setting_texts(Settings())
            words = [
                word for name in texts if texts[name] != plain[name] for word in ("--set", f"{name}={texts[name]}")
            ]
            words += [word for name, value in self._parameters.items() for word in ("-D", f"{name}={value}")]
            words += [word for folder in self._search_paths for word in ("--search-path", str(folder.absolute()))]
            return opened([self._opened.source, *words, "--threads", str(self._pool.threads)])

    # its end ----------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """End the threads and free maps and film; frames stay. May be called twice."""
        if self._closed:
            return
        with self._alone():
            self._closed, self._renderer = True, None
            self._store.clear()
            self._pool.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    # within -----------------------------------------------------------------------------------------------------

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """Nobody else uses the rendering meanwhile, no other thread and no `progress` either."""
        if not self._busy.acquire(blocking=False):
            raise PmviewerError("This rendering is at work, on another thread or in the call that told progress.")
        try:
            if self._closed:
                raise PmviewerError("This rendering was closed: open the scene again.")
            yield
        finally:
            self._busy.release()

    def _ready(self, tell: Progress) -> Renderer:
        """The renderer of the settings, with its kernels compiled."""
        renderer = self._renderer
        if renderer is None:
            prepare(self._opened, self._settings, self._pool, tell)
            renderer = Renderer(self._opened, self._settings, self._pool, self._store)
        display, camera = self._settings.display, self._settings.camera.name
        if display.exposure == "auto" and self.scene.exposure is None and camera not in self._opened.exposures:
            renderer.coarse_frame(0)  # as in the window it decides the exposure
        self._renderer = renderer
        return renderer

    def _step(self, renderer: Renderer) -> None:
        """A pass. Whatever ends it half-way leaves a film that is no picture, which is dropped."""
        try:
            self._within_memory(renderer.step)
        except BaseException:
            self._renderer = None
            raise

    def _within_memory(self, work: Callable[[], Any]) -> Any:
        """Do what may take more memory than there is."""
        try:
            return work()
        except MemoryError:
            self._store.clear()
            raise SettingError(NO_MEMORY) from None

    def _frame(self, renderer: Renderer) -> RenderedFrame:
        wanted = wanted_of(Facts(self._settings, renderer.plan, self._opened.traits))
        frame = replace(renderer.frame(renderer.passes, wanted), settings=self._settings)
        self._warn(*frame.statistics.warnings)

        alive = weakref.ref(renderer)  # frames that are kept don't keep maps

        def look(of: Frame, view: str, map: str | None) -> Inspection:
            return self._look(alive(), of, view, map)

        return RenderedFrame(self._opened, frame, self._parameters, look)

    def _look(self, renderer: Renderer | None, frame: Frame, view: str, map: str | None) -> Inspection:
        """A diagnostic view of a frame, of the maps that the renderer has still."""
        if map is not None and view not in MAP_VIEWS:
            raise SettingError(f"The view '{view}' is of no map: leave out map={map!r}.")
        asked = {"display.view": view} if map is None else {"display.view": view, "display.map": map}
        settings = with_values(frame.settings, asked)
        traits = self._opened.traits
        with self._alone():
            if renderer is None or renderer is not self._renderer or renderer.passes != frame.statistics.passes:
                raise SettingError(
                    f"The view '{view}' is made of the maps of the latest pass, and the rendering has left this frame "
                    "behind: ask for it before."
                )
            reason = inactive_reason(f"display.view={view}", settings, traits)
            if reason is not None:
                raise SettingError(f"display.view = {view}: {reason}")
            if map is not None and looked_map(settings, facts_of(settings, traits).plan) != map:
                raise SettingError(f"display.view = {view}: there is no {map} map with these settings in this scene.")
            return renderer.inspect(wanted_of(Facts(settings, renderer.plan, traits)))

    def _warn(self, *sentences: str) -> None:
        """Each sentence once."""
        for sentence in sentences:
            if sentence not in self._told:
                self._told.add(sentence)
                warnings.warn(sentence, PictureWarning, stacklevel=4)


def _check_number(what: str, value: Any, kind: type[Integral] | type[Real]) -> None:
    """Raises SettingError for what is no such number above 0."""
    if isinstance(value, bool) or not isinstance(value, kind) or not float(value) > 0:
        expected = "a whole number from 1" if kind is Integral else "a number above 0"
        raise SettingError(f"{what}={value!r}): expected {expected}.")
