"""How photons are looked up: within a radius or the nearest, and by which density estimate."""

from __future__ import annotations

from pmviewer.maps.variant import Estimator
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings


def reaches_to_nearest(settings: Settings, traits: SceneTraits) -> bool:
    """Whether look-ups reach to the nearest photons: as asked, or since photons that aim are too unevenly dense for one
    radius (but one that is set by hand)."""
    estimate, importance = settings.estimate, settings.importance
    if estimate.lookup != "auto":
        return estimate.lookup == "nearest"
    guided = importance.map != "off" and importance.emission != "off"
    by_hand = estimate.radius != "auto" or estimate.caustic_radius != "auto" or estimate.radius_rule != "pass"
    return traits.aims and settings.photons.projection != "off" and not guided and not by_hand


def estimator_of(settings: Settings) -> Estimator:
    """The density estimate that maps are looked up with."""
    if settings.estimate.area == "convex hull":
        return "hull"
    return "differential" if settings.estimate.differential else "disc"
