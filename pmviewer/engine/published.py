"""What a session shows to the outside: its newest frame, its state, its messages, and who wants to hear of them."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import replace

from pmviewer.engine.frame import Frame, Level, Message, Preview, State, Status
from pmviewer.engine.guarded import unexpected

_NUMBER = re.compile(r"\d[\d.,]*(e[+-]?\d+)?")
"""What may differ between two sentences that say the same."""


class Published:
    """Everything may be read from any thread; frames and statuses are immutable. Changes are made under `changed`,
    which wakes those who wait for them."""

    def __init__(self) -> None:
        self.changed = threading.Condition()
        self.on_update: Callable[[], None] | None = None
        self.frame: Frame | None = None
        self.serial = 0
        self.status = Status()
        self._messages: list[Message] = []
        self._warned: set[str] = set()
        self._warned_before: set[str] = set()

    def take_messages(self) -> list[Message]:
        """Messages since the last call."""
        with self.changed:
            taken, self._messages = self._messages, []
        return taken

    def say(self, level: Level, text: str) -> None:
        """A line for the log."""
        with self.changed:
            self._messages.append(Message(level, text, time.time()))
        self.notify()

    def warn(self, warnings: Iterable[str], anew: bool) -> None:
        """Say those that were not said of the picture yet, nor of the one before; `anew` begins another picture. Other
        numbers in the same sentence are nothing new."""
        if anew:
            self._warned_before, self._warned = self._warned, set()
        for warning in warnings:
            kind = _NUMBER.sub("", warning)
            if kind not in self._warned | self._warned_before:
                self.say("warning", warning)
            self._warned.add(kind)

    def tell(self, state: State, text: str, passes: int = 0, progress: float | None = None) -> None:
        """What goes on now."""
        with self.changed:
            self.status = Status(state, text, passes, progress)
            self.changed.notify_all()
        self.notify()

    def stage(self, stage: str, share: float | None) -> None:
        """Which stage of a pass goes on, and how much of it is through."""
        with self.changed:
            self.status = replace(self.status, stage=stage, stage_progress=share)
        self.notify()

    def show(self, frame: Frame, version: int) -> None:
        """A new frame; one of an older version only where it is a coarse one."""
        _ = frame.beauty  # added up here, so that the window does not wait for it
        with self.changed:
            self.serial = frame.serial
            if frame.version == version or frame.coarse:
                self.frame = frame
            self.changed.notify_all()
        self.notify()

    def preview(self, preview: Preview | None) -> None:
        """The newest frame is shown by that preview."""
        if preview is None:
            return
        with self.changed:
            if self.frame is not None:
                self.frame = replace(self.frame, preview=preview)
            self.changed.notify_all()
        self.notify()

    def bare(self) -> None:
        """The newest frame is shown as it is. For who holds `changed`."""
        if self.frame is not None and self.frame.preview is not None:
            self.frame = replace(self.frame, preview=None)

    def notify(self) -> None:
        """Tell the listener; one that fails is not told again, and rendering goes on."""
        try:
            if self.on_update:
                self.on_update()
        except Exception as error:
            self.on_update = None
            with self.changed:
                self._messages.append(Message("error", unexpected(error)))
