"""The kinds of materials: the numbers that kernels tell them apart by, and what the rest of the program must know.

A kind that is a glossy lobe over a diffuse base or over nothing needs a line here, its lobe in a file beside this one
and that lobe's line in `pmviewer.kernels.bsdf.glossy`. Nothing here needs the compiler.
"""

from __future__ import annotations

from typing import NamedTuple

DIFFUSE, CONDUCTOR, DIELECTRIC = 0, 1, 2
ROUGH_CONDUCTOR, ROUGH_DIELECTRIC, THIN_DIELECTRIC, PLASTIC, ROUGH_PLASTIC, SCHLICK, WARD = range(3, 10)
PRINCIPLED, BLEND, NULL, DIFFUSE_TRANSMITTER = 10, 11, 12, 13


class Kind(NamedTuple):
    """`number` for kernels; `glossy` is the field of `Material` that colours the glossy lobe, "" without one; `based`:
    it has a diffuse lobe of the colour `reflectance`."""

    number: int
    glossy: str = ""
    based: bool = False


KINDS = {
    "diffuse": Kind(DIFFUSE, based=True),
    "conductor": Kind(CONDUCTOR),
    "dielectric": Kind(DIELECTRIC),
    "rough conductor": Kind(ROUGH_CONDUCTOR, "reflectance"),
    "rough dielectric": Kind(ROUGH_DIELECTRIC),
    "thin dielectric": Kind(THIN_DIELECTRIC),
    "plastic": Kind(PLASTIC, based=True),
    "rough plastic": Kind(ROUGH_PLASTIC, "specular", based=True),
    "schlick": Kind(SCHLICK, "specular", based=True),
    "ward": Kind(WARD, "specular", based=True),
    "principled": Kind(PRINCIPLED),
    "blend": Kind(BLEND),
    "null": Kind(NULL),
    "diffuse transmitter": Kind(DIFFUSE_TRANSMITTER),
}
"""By `Material.kind`. What principled materials and blends have depends on their numbers; null is the boundary of
a medium that nothing else shows (`pmviewer.kernels.media.medium`)."""
SPECTRUM_NODES, SPECTRUM_COLUMNS = 257, 4
"""Of the table of wavelengths and colours (`pmviewer.kernels.bsdf.dispersion`)."""
BANDS = 63
"""Bands of wavelengths that stored photons tell (`pmviewer.maps.record`)."""
GLOSSY = tuple(kind.number for kind in KINDS.values() if kind.glossy)
