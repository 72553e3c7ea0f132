"""Mitsuba's `principled` and `principledthin` (Burley 2012, 2015) as materials."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pmviewer.scene.description import BLACK, Material, Principled
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.interface import bounded, share
from pmviewer.scene.formats.mitsuba.texture import has_vertex_colours, squared_luminance

_SHARES = ("metallic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness", "clearcoat", "clearcoat_gloss")
_THIN_SHARES = ("sheen", "sheen_tint", "flatness")
_SMOOTHEST = 1e-3
"""Mitsuba's least roughness of microfacets."""
_LARGEST_SPECULAR = 12.0
"""The index grows beyond all bounds at 12.5."""
_NO_COAT = 1e-4


def index_of(specular: float) -> float:
    """Refractive index whose reflection head-on is 0.08·specular."""
    return 2 / (1 - math.sqrt(0.08 * specular)) - 1


def principled(p: Properties, name: str) -> Material:
    """`base_color`, `roughness` and `metallic` may be textures; of other textures the mean counts, with a warning."""
    numbers = {n: share(p, n) for n in _SHARES}
    if "eta" in p:
        eta = bounded(p, "eta", p.number("eta", 1.5), 1e-3, 1e3)
        if "specular" in p:
            p.known("specular")
            p.document.warn(f"{p.element} has both 'eta' and 'specular': 'eta' is used.", p.element)
    else:
        eta = index_of(bounded(p, "specular", p.roughness("specular", 0.5), 0.0, _LARGEST_SPECULAR))
    if numbers["spec_trans"] > 0 and abs(eta - 1) < _NO_COAT:
        eta = 1.001  # as Mitsuba: what transmits needs an index
    p.known("main_specular_sampling_rate", "clearcoat_sampling_rate", "diffuse_reflectance_sampling_rate")
    return _textured(
        p,
        Material(
            name,
            "principled",
            reflectance=p.bounded_colour("base_color", 0.5, 1),
            alpha=_alphas(p),
            eta=eta,
            principled=Principled(**numbers),
        ),
        set(_SHARES) - {"metallic"},
    )


def principled_thin(p: Properties, name: str) -> Material:
    """A sheet without an inside: in the share 1 − `spec_trans` diffuse and sheen on both sides, or, in half of
    `diff_trans`, diffuse light through; in the rest smooth thin glass, which tints what passes and reflects about as
    much as one face."""
    numbers = {n: share(p, n) for n in _THIN_SHARES}
    glass = share(p, "spec_trans")
    through = bounded(p, "diff_trans", p.roughness("diff_trans", 0.0), 0.0, 2.0) / 2
    eta = bounded(p, "eta", p.roughness("eta", 1.5), 1e-3, 1e3)
    colour = p.bounded_colour("base_color", 0.5, 1)
    p.known("spec_tint", *(f"{what}_sampling_rate" for what in (
        "specular_reflectance", "diffuse_reflectance", "specular_transmittance", "diffuse_transmittance",
    )))  # fmt: skip
    sheet = Material(
        name,
        "principled",
        colour,
        two_sided=True,
        alpha=_alphas(p),
        eta=1.0,  # all that it mirrors is the glass's
        principled=Principled(**numbers),
    )
    sheet = _textured(p, sheet, {*_THIN_SHARES, "spec_trans", "diff_trans", "eta"})
    if through > 0 and glass < 1:
        picture = sheet.textures.get("reflectance")
        colours = {} if picture is None else {"transmittance": picture}
        if sheet.vertex_colours:
            what = f"{p.element}: colours at the vertices don't tint the light that 'diff_trans' lets through."
            p.document.warn(what, p.element)
        beyond = Material(f"{name} (through)", "diffuse transmitter", BLACK, colour, textures=colours)
        sheet = Material(f"{name} (sheet)", "blend", BLACK, parts=(sheet, beyond), weight=through)
    if not glass > 0:
        return sheet
    p.document.warn(f"{p.element}: the share 'spec_trans' is shown as smooth thin glass.", p.element)
    picture = sheet.textures.get("reflectance")
    pane = Material(
        f"{name} (glass)",
        "thin dielectric",
        (1.0, 1.0, 1.0),
        transmittance=colour,
        eta=_pane_index(eta),
        textures={} if picture is None else {"transmittance": picture},
    )
    if glass >= 1:
        return replace(pane, name=name)
    return Material(name, "blend", BLACK, parts=(sheet, pane), weight=glass)


def _pane_index(eta: float) -> float:
    """The index of a pane, reflections between its faces counted, that reflects as much of what comes from all sides
    as one face of index `eta` does: that is all a sheet reflects. Below 1 it stays what it is."""
    low, high = 1.0, eta
    if not eta > 1:
        return eta
    sought = _reflected(eta)[0]
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if _reflected(middle)[1] < sought else (low, middle)
    return (low + high) / 2


def _reflected(eta: float) -> tuple[float, float]:
    """Of light from all sides, by one face and by a pane, whose rays go to and fro: 2R/(1 + R)."""
    cos = (np.arange(256) + 0.5) / 256
    inside = np.sqrt(1 - (1 - cos**2) / eta**2)
    across, along = (cos - eta * inside) / (cos + eta * inside), (eta * cos - inside) / (eta * cos + inside)
    face = (across**2 + along**2) / 2
    return float((face * 2 * cos).mean()), float((2 * face / (1 + face) * 2 * cos).mean())


def _alphas(p: Properties) -> tuple[float, float]:
    """Roughness squared, along and across the grain."""
    squared = share(p, "roughness", 0.5) ** 2
    aspect = math.sqrt(1 - 0.9 * share(p, "anisotropic"))
    return max(_SMOOTHEST, squared / aspect), max(_SMOOTHEST, squared * aspect)


def _textured(p: Properties, material: Material, means: set[str]) -> Material:
    """With the textures of base colour, roughness and metal; `means` are properties of whose textures only the mean
    was read."""
    textures = dict(material.textures)
    if "base_color" in p.textures:
        textures["reflectance"] = p.textures["base_color"]
    if "roughness" in p.textures:
        textures["alpha"] = squared_luminance(p.textures["roughness"])
    if "metallic" in p.textures and material.principled is not None and "metallic" not in means:
        textures["metallic"] = p.textures["metallic"]
    for name in sorted((means | {"anisotropic", "specular"}) & p.textures.keys()):
        what = f"'{name}' of {p.element} is a texture: its mean is used everywhere."
        p.document.warn(what, p.values[name])
    return replace(material, textures=textures, vertex_colours=has_vertex_colours(p, "base_color"))
