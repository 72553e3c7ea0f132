"""How photons are looked up: within a radius or the nearest, and by which density estimate."""

from __future__ import annotations

from pmviewer.maps.variant import Estimator
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings

NEIGHBOURS, NEIGHBOURS_OF_ONE_MAP = 20, 50
"""Automatic. Passes average out what few neighbours leave of noise, and as much time has more of them: relMSE over that
of 50. Three random stages and a space ship, eight CPU seconds: progressive 0.6, 0.9, 0.6 and 0.9, gather with the cache
0.8, 0.8, 0.5 and 0.8 (of ten 0.9, 1.1, 0.4 and 0.7, of a hundred 1.3 to 2.3); by `estimate.lookup = nearest`
cornell_caustic 0.9, museum 0.9, rooms_10x10 0.9, office 0.85, cornell_diffuse 1.2 after four."""


def reaches_to_nearest(settings: Settings, traits: SceneTraits) -> bool:
    """Whether look-ups reach to the nearest photons: as asked, or since photons that aim are too unevenly dense for one
    radius (but one that is set by hand)."""
    estimate, importance = settings.estimate, settings.importance
    if estimate.lookup != "auto":
        return estimate.lookup == "nearest"
    guided = importance.map != "off" and importance.emission != "off"
    by_hand = estimate.radius != "auto" or estimate.caustic_radius != "auto" or estimate.radius_rule != "pass"
    return traits.aims and settings.photons.projection != "off" and not guided and not by_hand


def first_neighbours(settings: Settings) -> int:
    """Photons in a k-nearest estimate of the first pass."""
    asked = settings.estimate.k
    if asked != "auto":
        return int(asked)
    return NEIGHBOURS if settings.photons.renew == "each pass" else NEIGHBOURS_OF_ONE_MAP


def estimator_of(settings: Settings) -> Estimator:
    """The density estimate that maps are looked up with."""
    if settings.estimate.area == "convex hull":
        return "hull"
    return "differential" if settings.estimate.differential else "disc"
