"""How often a photon is scattered at most."""

from __future__ import annotations

from pmviewer.settings.access import Photons

MOST, MOST_IN_MEDIA = 64, 1000
"""Automatic, without media and with: surfaces absorb, and what is left after 64 of them is next to nothing; light
leaves dense media after hundreds of collisions that absorb nearly nothing."""


def most_bounces(settings: Photons, media: bool) -> int:
    """Scatterings after which a photon is dropped, in a scene with media or without."""
    if settings.max_bounces == "auto":
        return MOST_IN_MEDIA if media else MOST
    return int(settings.max_bounces)
