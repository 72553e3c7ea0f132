"""Whether a trial would begin at once: what it renders with is compiled."""

from __future__ import annotations

from pmviewer.engine.auto.candidates import candidates
from pmviewer.engine.auto.choose import USUAL
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.prepare import steps_of
from pmviewer.settings.access import Settings, with_values
from pmviewer.settings.presets import assignments


def ways(opened: OpenScene, settings: Settings) -> list[Settings]:
    """Settings of every way that a trial of usual length would try."""
    found, _ = candidates(opened.traits, settings, USUAL)
    return [with_values(settings, assignments(candidate.values)) for candidate in found]


def is_ready(opened: OpenScene, settings: Settings) -> bool:
    """Whether the camera passes of all of them are kept compiled, which are most of it."""
    return all(steps_of(opened, way)[-1].is_kept for way in ways(opened, settings))
