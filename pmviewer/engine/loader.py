"""Loading scenes beside the session's worker: on threads of their own, the newest request alone is wanted."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

from pmviewer.engine.frame import Level, Status
from pmviewer.engine.guarded import guarded
from pmviewer.engine.opened import OpenScene, relit
from pmviewer.engine.published import Published
from pmviewer.progress import stage, watched
from pmviewer.scene.arrays.tessellate import DrawGeometry, tessellate
from pmviewer.scene.defaults.light_rigs import Rig
from pmviewer.settings.access import Settings


@dataclass(frozen=True, eq=False)
class Loaded:
    """A scene that is ready to be the open one, with its geometry for the window and the settings that it was asked for
    with, None for those in use."""

    opened: OpenScene
    geometry: DrawGeometry
    settings: Settings | None


class Loader:
    """`text` says what is being done ("ball.ply: building the tree …"), "" when nothing is being loaded; `loaded` is
    what waits to be taken. Changes are made under `published.changed`."""

    def __init__(
        self,
        published: Published,
        rig: Callable[[], Rig],
        has_scene: Callable[[], bool],
        on_loaded: Callable[[], None],
    ) -> None:
        """rig: the lights that are asked for now; has_scene: whether there is an open scene; on_loaded is called under
        `published.changed`."""
        self.text = ""
        self.loaded: Loaded | None = None
        self.asked = self.done = self._cancelled = 0
        self._closed = False
        self._published, self._changed = published, published.changed
        self._rig, self._has_scene, self._on_loaded = rig, has_scene, on_loaded

    @property
    def pending(self) -> bool:
        """Whether a scene that was asked for is still being loaded."""
        return self.done < self.asked

    def start(self, load: Callable[[], OpenScene], name: str, settings: Settings | None) -> None:
        """Load on a thread; what was asked for before is unwanted now."""
        with self._changed:
            self.asked += 1
            ticket = self.asked
        threading.Thread(
            target=guarded,
            args=(
                lambda: self._load(ticket, load, name, settings),
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

    def _load(self, ticket: int, load: Callable[[], OpenScene], name: str, settings: Settings | None) -> None:
        self._tell(ticket, name)
        with watched(lambda text: self._tell(ticket, f"{name}: {text}"), lambda: self._is_unwanted(ticket)):
            opened = load()
            while True:
                stage("preparing the geometry view")
                if self._hand_over(ticket, Loaded(opened, tessellate(opened.scene), settings)):
                    return
                opened = relit(opened, self._rig())

    def _hand_over(self, ticket: int, loaded: Loaded) -> bool:
        """Offer a loaded scene, if it is still asked for. False if other lights are asked for meanwhile."""
        with self._changed:
            if ticket != self.asked or self._closed:
                return True
            opened = loaded.opened
            if loaded.settings is None and opened.content is not None and opened.rig != self._rig():
                return False
            self.loaded = loaded
            self.done, self.text = ticket, ""
            self._on_loaded()
            return True

    def _is_unwanted(self, ticket: int) -> bool:
        """Has the load been cancelled, or another scene been asked for?"""
        return self._closed or ticket != self.asked or ticket <= self._cancelled

    def _tell(self, ticket: int, text: str) -> None:
        """What is being done: the session's state, where there is no picture yet, and beside it where there is."""
        with self._changed:
            if ticket != self.asked:
                return
            self.text = text
        if self._has_scene():
            self._published.notify()
        else:
            self._published.tell("loading", f"loading {text}")

    def _dropped(self, ticket: int, name: str) -> None:
        with self._changed:
            asked_for = ticket == self.asked and not self._closed
        if asked_for:
            self._failed(ticket, "info", f"{name}: loading was cancelled.")

    def _failed(self, ticket: int, level: Level, text: str) -> None:
        self._published.say(level, text)
        with self._changed:
            self.done = max(self.done, ticket)
            if ticket == self.asked:
                self.text = ""
            if not self._has_scene():
                self._published.status = Status("failed", text)
            self._changed.notify_all()
        self._published.notify()
