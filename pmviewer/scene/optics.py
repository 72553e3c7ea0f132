"""Refractive indices and mirror colours by name (measured at room temperature; indices at 589 nm)."""

from __future__ import annotations

from pmviewer.scene.description import RGB

IOR: dict[str, float] = {
    "vacuum": 1.0,
    "helium": 1.000036,
    "hydrogen": 1.000132,
    "air": 1.000277,
    "carbon dioxide": 1.00045,
    "water": 1.333,
    "acetone": 1.36,
    "ethanol": 1.361,
    "carbon tetrachloride": 1.461,
    "glycerol": 1.4729,
    "benzene": 1.501,
    "silicone oil": 1.52045,
    "bromine": 1.661,
    "water ice": 1.31,
    "fused quartz": 1.458,
    "pyrex": 1.47,
    "acrylic glass": 1.49,
    "polypropylene": 1.49,
    "bk7": 1.5046,
    "sodium chloride": 1.544,
    "amber": 1.55,
    "pet": 1.575,
    "diamond": 2.419,
}

# Linear sRGB reflectance at normal incidence.
METALS: dict[str, RGB] = {
    "Ag": (0.972, 0.960, 0.915),
    "Al": (0.913, 0.922, 0.924),
    "Au": (1.000, 0.766, 0.336),
    "Cr": (0.549, 0.556, 0.554),
    "Cu": (0.955, 0.638, 0.538),
    "Ni_palik": (0.660, 0.609, 0.526),
    "W": (0.504, 0.498, 0.478),
}


def normal_reflectance(eta: float, k: float) -> float:
    """Fresnel reflectance of a conductor in air at normal incidence, from its complex index eta + ik."""
    return ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)
