"""How many light samples a surface takes in a pass."""

from __future__ import annotations

from pmviewer.settings.access import Direct

SAMPLES = 2
"""Automatic, with photon maps and one light: a shadow ray more costs some 3 % of a pass there, and light samples make
most of the error of the first passes; after some ten, photons do, and more samples would only cost."""
SEVERAL = 4
"""With several lights, or light from all around: a sample knows of one of them alone. relMSE times CPU time after four
passes over that of two samples, progressive and gather, means of three seeds: cornell_lights 0.59 and 0.59, colonnade
1.07 and 0.99, glass_egg 1.09 and 1.09, museum 1.17 and 1.08, all by distance; office 1.10 and 0.99, rooms_10x10 1.07
and 1.00, by photons; skylight_room, under one sky, 1.19 and 1.07. Four cost little where two would do."""


def samples_at_surface(settings: Direct, path: bool, lit_media: bool, several: bool) -> int:
    """Light samples per surface and pass. Automatic: `SAMPLES`, `SEVERAL` where lights are `several`; by the path
    tracer, which samples lights at each of its surfaces, and where media are lit along whole rays, 1."""
    if settings.samples == "auto":
        return 1 if path or lit_media else SEVERAL if several else SAMPLES
    return int(settings.samples)
