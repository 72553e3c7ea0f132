"""How many light samples a surface takes in a pass."""

from __future__ import annotations

from pmviewer.settings.access import Direct

SAMPLES = 2
"""Automatic, with photon maps and one light: a shadow ray more costs some 3 % of a pass there, and light samples make
most of the error of the first passes; after some ten, photons do, and more samples would only cost."""
SEVERAL = 4
"""With several lights, or light from all around: a sample knows of one of them alone. relMSE times CPU time after four
passes over that of two samples, progressive and gather: cornell_lights 0.38 and 0.42, colonnade 0.69 and 1.01,
three_balls 0.73 and 0.71, glass_egg 0.86 and 0.81, office 0.89 and 0.97, prism 0.91 and 0.93; museum, whose second
light is a spot on a picture, 1.05 and 1.08, rooms_10x10 1.08 and 1.00, car_cabin 1.10 and 1.05."""


def samples_at_surface(settings: Direct, path: bool, media: bool, several: bool) -> int:
    """Light samples per surface and pass. Automatic: `SAMPLES`, `SEVERAL` where lights are `several`; by the path
    tracer, which samples lights at each of its surfaces, and where media are lit along whole rays, 1."""
    if settings.samples == "auto":
        return 1 if path or media else SEVERAL if several else SAMPLES
    return int(settings.samples)
