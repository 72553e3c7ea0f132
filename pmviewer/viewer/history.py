"""Undo and redo of settings and cameras: what was changed, by which name, in steps that a user would count."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pmviewer.settings.access import SETTINGS, Settings, flat, with_values
from pmviewer.settings.edits import as_text
from pmviewer.settings.film import FilmKey
from pmviewer.viewer.value_text import value_text

Keys = tuple[FilmKey, ...]
MOST_STEPS = 1000
PAUSE = 0.6
"""Seconds after which the wheel, or a key that is held, begins another step."""
_POSE = frozenset({"origin", "target", "up", "view_width"})


@dataclass
class Step:
    """Settings by full name, before and after; `gesture` in which they were changed."""

    before: dict[str, Any]
    after: dict[str, Any]
    gesture: int
    at: float
    film: tuple[Keys, Keys] | None = None
    """Keys of the film before and after, of a step that changed these."""
    label: str = ""

    @property
    def name(self) -> str:
        """What the step did, in a few words."""
        if self.label:
            return self.label
        groups = {path.rpartition(".")[0] for path in self.after}
        names = {path.rpartition(".")[2] for path in self.after}
        if groups <= {"camera", "free_camera"} and names <= _POSE and len(names) > 1:
            return "move the free camera" if groups == {"free_camera"} else "move the camera"
        if groups == {"region"}:
            return "refine a region" if self.after.get("region.on", True) else "refine the whole picture"
        if len(self.after) == 1:
            ((path, value),) = self.after.items()
            info = SETTINGS[path]
            if info.scale == "edits":
                return _edit_name(self.before[path], value)
            return f"{info.group.lower()}, {info.title}: {value_text(info, value)}"
        return f"change {len(self.after)} settings"


class History:
    """Steps of one scene. Every change is told by `changed`; whoever undoes sets the settings that it is given."""

    def __init__(self) -> None:
        self.done: list[Step] = []
        """Oldest first."""
        self.undone: list[Step] = []
        """The last one is redone first."""
        self.gesture = 0
        """Grows with each press of a button or a key: changes within one are one step."""
        self.held = False
        """Whether a mouse button is down."""
        self.on_film: Callable[[Keys], None] = lambda keys: None
        """Hears what keys the film has when a step with such is undone or done again."""

    def changed(self, before: Settings, after: Settings) -> None:
        """Take note of a change that the user has made."""
        old, new = flat(before), flat(after)
        paths = [path for path, value in new.items() if value != old[path]]
        if not paths:
            return
        self.undone.clear()
        step = Step({p: old[p] for p in paths}, {p: new[p] for p in paths}, self.gesture, time.monotonic())
        last = self.done[-1] if self.done else None
        if last is not None and self._goes_on(last, step):
            last.before = step.before | last.before
            last.after |= step.after
            last.at = step.at
            return
        self.done = [*self.done, step][-MOST_STEPS:]

    def film_changed(self, before: Keys, after: Keys, label: str) -> None:
        """Take note of a change of the film's keys."""
        self.undone.clear()
        last = self.done[-1] if self.done else None
        if last is not None and last.film is not None and last.gesture == self.gesture and last.label == label:
            last.film = last.film[0], after
            return
        step = Step({}, {}, self.gesture, time.monotonic(), (before, after), label)
        self.done = [*self.done, step][-MOST_STEPS:]

    def _goes_on(self, last: Step, step: Step) -> bool:
        """Whether the step is part of the last one: of the same drag, or turn of the wheel."""
        if last.film is not None:
            return False
        alike = last.after.keys() == step.after.keys() or (_is_move(last.after) and _is_move(step.after))
        return alike and last.gesture == step.gesture and (self.held or step.at - last.at < PAUSE)

    def undo(self, settings: Settings) -> Settings | None:
        """The settings without the last step, None where there is none."""
        if not self.done:
            return None
        step = self.done.pop()
        self.undone.append(step)
        self.gesture += 1
        if step.film is not None:
            self.on_film(step.film[0])
        return with_values(settings, step.before)

    def redo(self, settings: Settings) -> Settings | None:
        """The settings with the step that was undone last, None where there is none."""
        if not self.undone:
            return None
        step = self.undone.pop()
        self.done.append(step)
        self.gesture += 1
        if step.film is not None:
            self.on_film(step.film[1])
        return with_values(settings, step.after)

    def clear(self) -> None:
        """Another scene: its cameras and choices are others."""
        self.done.clear()
        self.undone.clear()


def _is_move(values: Mapping[str, Any]) -> bool:
    """Whether these are the settings of a camera that is moved."""
    return all(path.startswith(("camera.", "free_camera.")) and path.rpartition(".")[2] in _POSE for path in values)


def _edit_name(before: Mapping[str, Any], after: Mapping[str, Any]) -> str:
    """What was edited of the scene."""
    changed = {name: after.get(name) for name in (*before, *after) if before.get(name) != after.get(name)}
    if len(changed) != 1:
        return f"change {len(changed)} edits"
    ((name, value),) = changed.items()
    return f"{name}: as in the file" if value is None else as_text({name: value})
