"""The same picture without importance, and whether that is another one."""

from __future__ import annotations

from pmviewer.engine.effects import inactive_reason
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Importance, Settings


def plain(settings: Settings) -> Settings:
    """The same picture without importance: all photons stored, plain emission."""
    return settings.model_copy(update={"importance": Importance()})


def refusal(settings: Settings, traits: SceneTraits) -> str | None:
    """Why there is nothing to compare, None if there is."""
    return inactive_reason("compare.equal", settings, traits)
