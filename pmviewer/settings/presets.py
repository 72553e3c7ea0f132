"""Presets: whole ways of rendering under one name, for a quick look, for the truth, and as the papers did it.

A preset sets all of RESET: what it doesn't name has its default. Camera, display, seed and stop rules stay.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from pmviewer.settings.access import SETTINGS, Settings, get

RESET = (
    "photons.",
    "importance.",
    "estimate.",
    "direct.",
    "gather.",
    "virtual.",
    "render.method",
    "render.direct",
    "render.caustic",
    "render.indirect",
    "render.outline_rays",
    "render.mirror_rays",
    "render.edge_rays",
    "render.adaptive",
)
"""What a preset sets, by the beginnings of names."""


def assignments(values: Mapping[str, Any]) -> dict[str, Any]:
    """All that a preset or automatic mode sets, by full name: `values`, and the defaults of the rest."""
    return {path: info.default for path, info in SETTINGS.items() if path.startswith(RESET)} | dict(values)


def given(settings: Settings, told: Collection[str] = ()) -> list[str]:
    """Settings of these that somebody has changed already or has `told`, by full name."""
    return [
        path
        for path, info in SETTINGS.items()
        if path.startswith(RESET) and (path in told or get(settings, path) != info.default)
    ]


@dataclass(frozen=True)
class Preset:
    """`values` by full name, beside the defaults."""

    name: str
    text: str
    values: Mapping[str, Any]

    def assignments(self) -> dict[str, Any]:
        """All that it sets, by full name."""
        return assignments(self.values)


PRESETS: tuple[Preset, ...] = (
    Preset(
        "Preview",
        "Few photons and wide look-ups: the first passes come fast and are calm.",
        {"photons.N": 40_000, "estimate.radius": 0.01, "estimate.filter": "epanechnikov", "render.outline_rays": 4},
    ),
    Preset("Balanced", "The defaults: progressive, both maps shown directly, converging from pass to pass.", {}),
    Preset(
        "Reference",
        "The path tracer: no bias and no maps. Slow, most of all for caustics of small lights.",
        {"render.method": "path"},
    ),
    Preset(
        "Jensen 1996",
        "Global Illumination using Photon Maps: maps made once, 80 nearest photons with the cone filter of constant 1, "
        "final gather along the hemisphere grid, projection maps, shadow photons.",
        {
            "render.method": "gather",
            "photons.indirect_caustics": False,
            "photons.N": 200_000,
            "photons.renew": "once",
            "photons.sequence": "independent",
            "photons.projection": "on",
            "estimate.lookup": "nearest",
            "estimate.k": 80,
            "estimate.filter": "cone",
            "estimate.cone_k": 1.0,
            "direct.shadow_photons": True,
            "gather.directions": "hemisphere grid",
        },
    ),
    Preset(
        "Christensen 1999",
        "Faster Photon Map Global Illumination: irradiance precomputed at every fourth photon from its 50 nearest, "
        "final gather into the nearest of those.",
        {
            "render.method": "gather",
            "photons.indirect_caustics": False,
            "photons.renew": "once",
            "estimate.lookup": "nearest",
            "estimate.k": 50,
            "gather.radiance_photons": "1/4",
            "gather.rays": 16,
        },
    ),
    Preset(
        "Keller and Wald 2000",
        "Efficient Importance Sampling Techniques for the Photon Map: photons stored by their visual importance, five "
        "times as many for caustics (q = 1/5), shadow rays split into lights with photons near and others.",
        {
            "render.method": "gather",
            "photons.q": 0.2,
            "importance.map": "screen",
            "importance.deposition": "Keller-Wald",
            "direct.choice": "Keller-Wald",
        },
    ),
    Preset(
        "Suykens and Willems 2000",
        "Density Control for Photon Maps: photons stored until the density that importance requires is there, the "
        "power of others redistributed; M_r 2 for the global and 25 for the caustic map.",
        {
            "render.method": "gather",
            "photons.indirect_caustics": False,
            "importance.map": "average",
            "importance.deposition": "density control",
            "importance.around": "nearest",
            "importance.M_r": 2.0,
            "importance.caustic_M_r": 25.0,
        },
    ),
    Preset(
        "Peter and Pietrek 1998",
        "Importance Driven Construction of Photon Maps: test photons tell which of the lights' photons reach what the "
        "camera sees; those are emitted.",
        {"render.method": "gather", "importance.map": "screen", "importance.emission": "Peter-Pietrek"},
    ),
    Preset(
        "Szirmay-Kalos and Szécsi 2003",
        "Improved Indirect Photon Mapping with Weighted Importance Sampling: 200 photons as virtual lights, weighed by "
        "whole gathering walks, normalised per object.",
        {
            "render.method": "virtual lights",
            "virtual.number": 200,
            "virtual.estimator": "full path",
            "virtual.normalisation": "per object",
        },
    ),
    Preset(
        "Pharr",
        "Extended Photon Map Implementation: one map, 50 nearest photons, Simpson's kernel, radiance photons at one in "
        "eight, gather rays guided by cones around photons.",
        {
            "render.method": "gather",
            "photons.indirect_caustics": False,
            "photons.renew": "once",
            "estimate.lookup": "nearest",
            "estimate.k": 50,
            "estimate.filter": "simpson",
            "gather.radiance_photons": "1/8",
            "gather.directions": "photon cones",
            "gather.rays": 32,
        },
    ),
    Preset(
        "Hachisuka, Ogaki and Jensen 2008",
        "Progressive Photon Mapping: each pixel's own radius, shrunk by the photons that it finds, alpha 0.7.",
        {"photons.sequence": "independent", "estimate.radius_rule": "pixel", "estimate.alpha": 0.7},
    ),
    Preset(
        "Knaus and Zwicker 2011",
        "Progressive Photon Mapping: A Probabilistic Approach: independent passes whose common radius shrinks, alpha "
        "2/3.",
        {"photons.sequence": "independent", "estimate.alpha": 2 / 3},
    ),
)
