"""Which lobes a material has anywhere on its surface: what kernels decide hit by hit (`pmviewer.kernels.bsdf.lobes`,
`pmviewer.kernels.bsdf.principled`), for whoever must know before there is a hit. Of a blend only its parts have any."""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.bsdf.kinds import KINDS
from pmviewer.kernels.bsdf.microfacet import SMOOTHEST
from pmviewer.kernels.bsdf.principled_lobes import LEAST_ALPHA
from pmviewer.scene.description import LUMINANCE, Material, Principled
from pmviewer.scene.texture import Checkerboard, Texture

_SPREADING = ("rough dielectric", "principled", "diffuse transmitter")
"""Kinds whose FOLLOWED lobes are no deltas."""


def principled_of(material: Material) -> Principled:
    """The numbers of a principled material; the defaults if it was made without."""
    return material.principled if material.principled is not None else Principled()


def coat_alpha(material: Material) -> float:
    """Roughness of a principled material's clearcoat."""
    return 0.1 + principled_of(material).clearcoat_gloss * (0.001 - 0.1)


def _least_metallic(material: Material) -> float:
    return 0.0 if "metallic" in material.textures else principled_of(material).metallic


def transmits(material: Material) -> bool:
    """Has it lobes of both sides, so that its back is no other front?"""
    return material.transparent or (material.kind == "principled" and principled_of(material).spec_trans > 0)


def has_diffuse_lobe(material: Material) -> bool:
    """Has it a lobe that is STORED whatever the settings?"""
    if material.kind == "principled":
        p = principled_of(material)
        opaque = (1 - _least_metallic(material)) * (1 - p.spec_trans)
        return opaque > 0 and max(*material.reflectance, p.sheen) > 0
    return KINDS[material.kind].based and max(material.reflectance) > 0


def always_followed(material: Material) -> bool:
    """Has it a lobe that is FOLLOWED whatever the settings?"""
    if material.kind == "principled":
        return (1 - _least_metallic(material)) * principled_of(material).spec_trans > 0
    if material.kind == "conductor":
        return max(material.reflectance) > 0
    if material.kind == "plastic":
        return max(material.specular) > 0
    return material.transparent and max(*material.reflectance, *material.transmittance) > 0


def is_delta(material: Material) -> bool:
    """Are its FOLLOWED lobes deltas?"""
    return always_followed(material) and material.kind not in _SPREADING


def is_rough_glass(material: Material) -> bool:
    """Does it transmit by a lobe that is no delta?"""
    return always_followed(material) and material.kind in _SPREADING


def glossy_roughness(material: Material) -> tuple[float, ...]:
    """Roughness of the material's glossy reflections as kernels compare it with the setting, none without one. Where a
    texture gives it, the least and the greatest."""
    if material.kind != "principled":
        colour = KINDS[material.kind].glossy
        return _specular_roughness(material, 0.0) if colour and max(getattr(material, colour)) > 0 else ()
    p = principled_of(material)
    metal = "metallic" in material.textures or p.metallic > 0
    specular = (
        _specular_roughness(material, float(LEAST_ALPHA)) if metal or p.spec_tint > 0 or material.eta != 1 else ()
    )
    return (*specular, *((coat_alpha(material),) if p.clearcoat > 0 else ()))


def _specular_roughness(material: Material, least: float) -> tuple[float, ...]:
    if "alpha" not in material.textures:
        return (max(min(material.alpha), least),)
    if "alpha_across" in material.textures:
        both = [_extremes(material.textures[slot]) for slot in ("alpha", "alpha_across")]
        low, high = (max(least, min(values)) for values in zip(*both, strict=True))
        return (low,) if low == high else (low, high)
    # Textured roughness keeps the ratio of both directions.
    narrow = max(min(material.alpha), float(SMOOTHEST))
    middle = math.sqrt(narrow * max(*material.alpha, float(SMOOTHEST)))
    least = max(least, float(SMOOTHEST))
    low, high = (max(least, value * narrow / middle) for value in _extremes(material.textures["alpha"]))
    return (low,) if low == high else (low, high)


def _extremes(texture: Texture) -> tuple[float, float]:
    """The least and the greatest luminance."""
    if isinstance(texture, Checkerboard):
        values = np.array([texture.color0, texture.color1]) @ LUMINANCE
    else:
        weights = LUMINANCE * texture.scale
        values = texture.pixels @ weights if texture.pixels.shape[2] == 3 else texture.pixels * weights.sum()
    return float(values.min()), float(values.max())
