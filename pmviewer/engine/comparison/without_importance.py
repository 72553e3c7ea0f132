"""The same picture without importance, and whether that is another one."""

from __future__ import annotations

from dataclasses import replace

from pmviewer.engine.method import plan_of
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Importance, Settings


def plain(settings: Settings) -> Settings:
    """The same picture without importance: all photons stored, plain emission."""
    return settings.model_copy(update={"importance": Importance()})


def refusal(settings: Settings, traits: SceneTraits) -> str | None:
    """Why there is nothing to compare, None if there is."""
    plan, without = plan_of(settings, traits), plan_of(plain(settings), traits)
    if not plan.photons:
        return "This method traces no photons, or no surface stores them."
    if replace(plan, importance=False, skipped=(), warnings=()) == replace(without, skipped=(), warnings=()):
        return "Importance decides nothing now: choose a rule that uses it, such as importance.deposition."
    return None
