"""Numbers that many BSDFs share: roughness along and across, its distribution, refractive indices."""

from __future__ import annotations

from typing import Literal

from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.optics import IOR

LARGEST_ALPHA = 10.0
_LEAST_IOR, _LARGEST_IOR = 1e-3, 1e3


def distribution(p: Properties) -> Literal["ggx", "beckmann"]:
    """Beckmann's by default, as in Mitsuba."""
    p.known("sample_visible")
    own = p.element.attributes.get("type", "").lower()
    name = p.string("distribution", "ggx" if own.endswith("ggx") else "beckmann").lower()
    if name == "ggx":
        return "ggx"
    if name != "beckmann":
        what = f"'distribution' of {p.element}: '{name[:40]}' is not supported, Beckmann's replaces it."
        p.document.warn(what, p.values["distribution"])
    return "beckmann"


def alphas(p: Properties) -> tuple[float, float]:
    """Roughness along and across the tangent."""
    if "alpha_u" not in p and "alpha_v" not in p:
        both = alpha(p, "alpha")
        return both, both
    if "alpha" in p:
        p.known("alpha")
        p.document.warn(f"{p.element} has 'alpha' beside 'alpha_u' and 'alpha_v': these are used.", p.element)
    if "alpha_u" not in p or "alpha_v" not in p:
        there, missing = ("alpha_u", "alpha_v") if "alpha_u" in p else ("alpha_v", "alpha_u")
        p.document.warn(f"{p.element} has '{there}' without '{missing}': it is rough alike in both ways.", p.element)
        both = alpha(p, there)
        return both, both
    return alpha(p, "alpha_u"), alpha(p, "alpha_v")


def alpha(p: Properties, name: str, default: float = 0.1, most: float = LARGEST_ALPHA) -> float:
    """Roughness of a property, cut to 0 … `most`."""
    return bounded(p, name, p.roughness(name, default), 0.0, most)


def bounded(p: Properties, name: str, value: float, least: float, most: float) -> float:
    """The number, cut to these bounds with a warning."""
    if least <= value <= most:
        return value
    cut = min(max(value, least), most)
    what = f"'{name}' of {p.element} lies outside {least:g} to {most:g}: {value:g} was taken as {cut:g}."
    p.document.warn(what, p.values.get(name, p.element))
    return cut


def share(p: Properties, name: str, default: float = 0.0) -> float:
    """A number from 0 to 1, written as a number, a colour (its luminance counts) or a texture (its mean)."""
    if p.tag_of(name) in (None, "float", "integer", "texture"):
        return bounded(p, name, p.roughness(name, default), 0.0, 1.0)
    r, g, b = p.colour(name, default)
    return bounded(p, name, 0.2126 * r + 0.7152 * g + 0.0722 * b, 0.0, 1.0)


def relative_ior(p: Properties, inside: str) -> float:
    """`int_ior` over `ext_ior`, or `eta`, which is their ratio; `inside` names the default of the inner one."""
    if p.tag_of("eta") in ("float", "integer"):
        p.known("int_ior", "ext_ior")
        return bounded(p, "eta", p.number("eta", 1.5), _LEAST_IOR, _LARGEST_IOR)
    return _ior(p, "int_ior", inside) / _ior(p, "ext_ior", "air")


def outside_ior(p: Properties) -> float:
    """Index of what surrounds a dielectric: `ext_ior`, 1 where `eta` is given in its place."""
    if p.tag_of("eta") in ("float", "integer"):
        return 1.0
    return _ior(p, "ext_ior", "air")


def _ior(p: Properties, name: str, default: str) -> float:
    if p.tag_of(name) in ("float", "integer"):
        return bounded(p, name, p.number(name, 1.0), _LEAST_IOR, _LARGEST_IOR)
    if p.tag_of(name) not in (None, "string"):
        p.known(name)
        what = f"'{name}' of {p.element} must be a number or a name: that of '{default}' is used."
        p.document.warn(what, p.values[name])
        return IOR[default]
    material = p.string(name, default).lower().replace("_", " ")
    if material not in IOR:
        what = f"'{name}' of {p.element}: the material '{material[:40]}' is not known, '{default}' replaces it."
        p.document.warn(what, p.values.get(name, p.element))
        return IOR[default]
    return IOR[material]
