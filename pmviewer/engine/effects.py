"""Why a setting has no effect just now: the interface greys it and says so, and what it would show is not made."""

from __future__ import annotations

from pmviewer.engine.method import plan_of
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings, needs_of
from pmviewer.settings.needs import Facts, unmet


def facts_of(settings: Settings, traits: SceneTraits) -> Facts:
    """What the needs of settings are judged by."""
    return Facts(settings, plan_of(settings, traits), traits)


_latest: Facts | None = None
"""The window asks for all of its settings one after the other."""


def inactive_reason(path: str, settings: Settings, traits: SceneTraits | None) -> str | None:
    """A sentence for a setting that changes nothing with these settings in this scene, None for one that does. Without
    a scene all do.

    `path` may also name one choice of a setting, "display.view=photon count". Raises SettingError for an unknown one.
    """
    global _latest
    if traits is None:
        return None
    facts = _latest  # once: another thread may ask meanwhile
    if facts is None or facts.settings is not settings or facts.traits is not traits:
        facts = _latest = facts_of(settings, traits)
    return unmet(needs_of(path), facts)
