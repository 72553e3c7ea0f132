"""How many light samples a surface takes in a pass."""

from __future__ import annotations

from pmviewer.settings.access import Direct

SAMPLES = 2
"""Automatic, with photon maps: a shadow ray more costs some 3 % of a pass there, and light samples make most of the
error of the first passes; after some ten, photons do, and more samples would only cost."""


def samples_at_surface(settings: Direct, path: bool, media: bool) -> int:
    """Light samples per surface and pass. Automatic: `SAMPLES`; by the path tracer, which samples lights at each of its
    surfaces, and where media are lit along whole rays, 1."""
    if settings.samples == "auto":
        return 1 if path or media else SAMPLES
    return int(settings.samples)
