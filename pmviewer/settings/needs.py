"""What a setting needs to have an effect, declared beside the setting, and the sentence where it has none.

Needs look at facts that the engine has worked out: the plan, which is the one place where settings and scene decide
what runs. They never work it out again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, eq=False)
class Facts:
    """What needs are judged by: the `settings` (`pmviewer.settings.schema.Settings`), the `plan` that follows from them
    (`pmviewer.engine.plan.Plan`), and the `traits` of the scene (`pmviewer.scene.analysis.SceneTraits`)."""

    settings: Any
    plan: Any
    traits: Any


@dataclass(frozen=True, eq=False)
class Need:
    """Something that must hold for a setting to have an effect, and the sentence for the user where it does not."""

    holds: Callable[[Facts], object]
    otherwise: str | Callable[[Facts], str]


Needs = tuple[Need, ...]


def unmet(needs: Iterable[Need], facts: Facts) -> str | None:
    """The sentence of the first need that does not hold; None if all do."""
    for need in needs:
        if not need.holds(facts):
            return need.otherwise if isinstance(need.otherwise, str) else need.otherwise(facts)
    return None


def never(sentence: str) -> Need:
    """A setting that a group has from another one, and that has no effect in it."""
    return Need(lambda facts: False, sentence)


CAUSTIC_MAP = Need(lambda f: f.plan.caustic_classes, "No caustic map in this scene or with this method.")
GLOBAL_MAP = Need(lambda f: f.plan.global_classes, "The method shows the caustic map alone.")
BOTH_MAPS = Need(lambda f: f.plan.caustic_classes and f.plan.global_classes, "There is one map.")
FOLLOWED = Need(lambda f: f.traits.follows(f.settings.photons.glossy), "No mirror or glass in this scene.")
PHOTONS = Need(
    lambda f: f.plan.photons,
    lambda f: "The path tracer uses no photons." if f.plan.path else "No surface of this scene stores photons.",
)
LENS = Need(lambda f: f.plan.lens, "Everything is sharp: the camera has no lens (camera.aperture).")
IMPORTANCE = Need(lambda f: f.plan.importance, "Only with importance (importance.map).")
SHADOW_PHOTONS = Need(lambda f: f.plan.shadows, "Only with shadow photons (direct.shadow_photons).")
CLEAR = Need(lambda f: not f.plan.media, "It does not know of media, and this scene has some.")
UNLIT_MEDIA = Need(
    lambda f: not f.traits.lit_media, "It does not know of media that scatter or emit light, and this scene has some."
)
MEDIA = Need(lambda f: f.plan.media, "No medium in this scene: no fog, no smoke.")
VOLUME = Need(lambda f: f.plan.volume, "No photons in media: no medium here scatters light, or not with this method.")
