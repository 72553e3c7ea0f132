"""Loading scenes beside the session's worker: on threads of their own, the newest request alone is wanted."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from pmviewer.engine.frame import Level, Status
from pmviewer.engine.guarded import guarded
from pmviewer.engine.opened import Arrangement, OpenScene, rearranged
from pmviewer.engine.published import Published
from pmviewer.errors import SceneError
from pmviewer.progress import stage, watched
from pmviewer.scene.arrays.stored_geometry import same_surfaces
from pmviewer.scene.arrays.tessellate import DrawGeometry, recoloured, tessellate
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings


@dataclass(frozen=True, eq=False)
class Loaded:
    """A scene that is ready to be the open one, with its geometry for the window and the settings that it was asked for
    with, None for those in use; `film` is a checkpoint to go on with."""

    opened: OpenScene
    geometry: DrawGeometry
    settings: Settings | None
    film: Path | None = None


PATIENCE = 0.5
"""Seconds after which a scene that is arranged anew is said to be loading: edits come many a second."""


class Loader:
    """`text` says what is being done ("ball.ply: building the tree …"), "" when nothing is being loaded; `loaded` is
    what waits to be taken. Changes are made under `published.changed`.

    Arranging the open scene anew never waits for an end of the changes: what was arranged is handed over, and the
    newest arrangement follows, for as long as there is a newer one.
    """

    def __init__(
        self,
        published: Published,
        arrangement: Callable[[], Arrangement],
        has_scene: Callable[[], bool],
        on_loaded: Callable[[bool], None],
        on_given_up: Callable[[], None],
    ) -> None:
        """arrangement: what is asked for now; has_scene: whether there is an open scene; on_loaded is called under
        `published.changed`, and told whether it is the open scene, arranged anew; on_given_up is called under it when
        nothing will come of the last request and the open scene may lack what was asked for meanwhile."""
        self.text = ""
        self.loaded: Loaded | None = None
        self.asked = self.done = self._cancelled = 0
        self._closed = self._rearranging = False
        self._began = 0.0
        self._drawn: tuple[Scene, DrawGeometry] | None = None
        self._refused: Arrangement | None = None
        self._published, self._changed = published, published.changed
        self._arrangement, self._has_scene, self._on_loaded = arrangement, has_scene, on_loaded
        self._on_given_up = on_given_up

    @property
    def pending(self) -> bool:
        """Whether a scene that was asked for is still being loaded."""
        return self.done < self.asked

    @property
    def waits(self) -> bool:
        """Whether a scene is being loaded, or has not been taken yet."""
        return self.pending or self.loaded is not None

    def start(
        self, load: Callable[[], OpenScene], name: str, settings: Settings | None, film: Path | None = None
    ) -> None:
        """Load on a thread; what was asked for before is unwanted now."""
        self._start(load, name, settings, film, rearranging=False)

    def rearrange(self, opened: OpenScene, geometry: DrawGeometry | None) -> None:
        """Arrange the open scene, with its geometry, as is asked for now. While a scene is being loaded or arranged
        nothing is to be done: it gets the newest arrangement anyway."""
        if not self.pending:
            self._drawn = (opened.scene, geometry) if geometry is not None else None
            self._start(lambda: opened, opened.source, None, None, rearranging=True)

    def _start(
        self,
        load: Callable[[], OpenScene],
        name: str,
        settings: Settings | None,
        film: Path | None,
        *,
        rearranging: bool,
    ) -> None:
        with self._changed:
            self.asked += 1
            ticket = self.asked
            self._rearranging, self._began = rearranging, time.monotonic()
        threading.Thread(
            target=guarded,
            args=(
                lambda: self._load(ticket, load, name, settings, film),
                lambda text: self._failed(ticket, "error", text),
                lambda: self._dropped(ticket, name),
                f"{name}: not enough memory for this scene.",
                f"{name}: ",
            ),
            name="pmviewer loader",
            daemon=True,
        ).start()

    def cancel(self) -> None:
        """Give up what is being loaded."""
        with self._changed:
            self._cancelled = self.asked

    def close(self) -> None:
        """Nothing is wanted any more."""
        self._closed = True

    def take(self) -> Loaded | None:
        """What was loaded, once."""
        taken, self.loaded = self.loaded, None
        return taken

    def _load(
        self, ticket: int, load: Callable[[], OpenScene], name: str, settings: Settings | None, film: Path | None
    ) -> None:
        self._tell(ticket, name)
        with watched(lambda text: self._tell(ticket, f"{name}: {text}"), lambda: self._is_unwanted(ticket)):
            opened = load()
            if self._rearranging:
                opened = self._newest(opened)
            while True:
                if self._hand_over(ticket, Loaded(opened, self._geometry(opened.scene), settings, film)):
                    return
                opened = self._newest(opened)

    def _geometry(self, scene: Scene) -> DrawGeometry:
        """For the window; that of the scene before, in other colours, where the surfaces are the same."""
        stage("preparing the geometry view")
        drawn = self._drawn if self._rearranging else None
        again = drawn is not None and same_surfaces(drawn[0], scene)
        geometry = recoloured(scene, drawn[1]) if again and drawn is not None else tessellate(scene)
        self._drawn = scene, geometry
        return geometry

    def _newest(self, opened: OpenScene) -> OpenScene:
        """The scene as it is asked for now. What can't be arranged is an error only if it is still asked for."""
        while True:
            arrangement = self._arrangement()
            try:
                return rearranged(opened, arrangement)
            except SceneError:
                if self._arrangement() == arrangement:
                    self._refused = arrangement
                    raise

    def _hand_over(self, ticket: int, loaded: Loaded) -> bool:
        """Offer a loaded scene, if it is still asked for. False if another arrangement is asked for meanwhile; a scene
        that is shown already is offered then too."""
        with self._changed:
            if ticket != self.asked or self._closed:
                return True
            is_newest = loaded.settings is not None or loaded.opened.is_arranged(self._arrangement())
            if is_newest or self._rearranging:
                self.loaded = loaded
                if is_newest:
                    self.done, self.text = ticket, ""
                self._on_loaded(self._rearranging)
            return is_newest

    def _is_unwanted(self, ticket: int) -> bool:
        """Has the load been cancelled, or another scene been asked for?"""
        return self._closed or ticket != self.asked or ticket <= self._cancelled

    def _tell(self, ticket: int, text: str) -> None:
        """What is being done: the session's state, where there is no picture yet, and beside it where there is."""
        with self._changed:
            early = self._rearranging and time.monotonic() - self._began < PATIENCE
            if ticket != self.asked or early:
                return
            self.text = text
        if self._has_scene():
            self._published.notify()
        else:
            self._published.tell("loading", f"loading {text}")

    def _dropped(self, ticket: int, name: str) -> None:
        with self._changed:
            asked_for = ticket == self.asked and not self._closed
            if asked_for and self._rearranging:
                self._refused = self._arrangement()
        if asked_for:
            self._failed(ticket, "info", f"{name}: loading was cancelled.")

    def _failed(self, ticket: int, level: Level, text: str) -> None:
        self._published.say(level, text)
        with self._changed:
            self.done = max(self.done, ticket)
            if ticket == self.asked:
                self.text = ""
                if not self._closed and self._arrangement() != self._refused:
                    self._on_given_up()  # other edits arrived while this was failing
            if not self._has_scene():
                self._published.status = Status("failed", text)
            self._changed.notify_all()
        self._published.notify()
