"""Not Mitsuba's: dispersion of dielectrics, by a glass's name, Sellmeier's or Cauchy's equation, or Abbe's number."""

from __future__ import annotations

import math
from dataclasses import replace

from pmviewer.scene.description import Material
from pmviewer.scene.dispersion import GLASSES, LEAST_ABBE, Dispersion, by_abbe, glass_named
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.interface import outside_ior
from pmviewer.scene.formats.mitsuba.values import parse_list

_WAYS = ("glass", "sellmeier_b", "cauchy_a", "abbe")
_BESIDE = ("sellmeier_c", "cauchy_b")
_MOST_TERMS = 8


def dispersing(p: Properties, material: Material) -> Material:
    """The dielectric with what its properties say of dispersion. A glass's own index replaces `int_ior`; with `abbe` it
    is the index at 587.6 nm."""
    said = [way for way in _WAYS if way in p]
    for way in said[1:]:
        p.known(way)
        p.document.warn(f"{p.element} has '{said[0]}' and '{way}': the first is used.", p.values[way])
    if not said:
        for way in _BESIDE:
            if way in p:
                p.known(way)
                first = {"sellmeier_c": "sellmeier_b", "cauchy_b": "cauchy_a"}[way]
                p.document.warn(f"{p.element} has '{way}' without '{first}': it is left out.", p.values[way])
        return material
    outside = outside_ior(p)
    dispersion = _READERS[said[0]](p, material.eta * outside)
    if dispersion is None:
        return material
    if dispersion.problem:
        p.document.warn(f"The glass of {p.element} {dispersion.problem}.", p.values[said[0]])
    if said[0] != "abbe":
        p.known("int_ior", "eta")
    return replace(material, dispersion=dispersion, eta=dispersion.n_d / outside)


def _named(p: Properties, n_d: float) -> Dispersion | None:
    name = p.string("glass", "")
    glass = glass_named(name)
    if glass is None:
        known = ", ".join(each.name for each in GLASSES.values())
        what = f"'glass' of {p.element}: '{name[:40]}' is none of {known}: it does not disperse light."
        p.document.warn(what, p.values["glass"])
    return glass


def _sellmeier(p: Properties, n_d: float) -> Dispersion | None:
    try:
        b, c = parse_list(p.string("sellmeier_b", "")), parse_list(p.string("sellmeier_c", ""))
        if not 0 < len(b) == len(c) <= _MOST_TERMS:
            raise ValueError("expected as many numbers in 'sellmeier_b' as in 'sellmeier_c', from 1 to 8")
        if not all(map(math.isfinite, (*b, *c))):
            raise ValueError("expected finite numbers")
    except ValueError as error:
        what = f"'sellmeier_b' and 'sellmeier_c' of {p.element}: {error}; it does not disperse light."
        p.document.warn(what, p.values["sellmeier_b"])
        return None
    return Dispersion("sellmeier", (*b, *c))


def _cauchy(p: Properties, n_d: float) -> Dispersion | None:
    a, b = p.number("cauchy_a", n_d), p.number("cauchy_b", 0.0)
    return Dispersion("cauchy", (a, b))


def _abbe(p: Properties, n_d: float) -> Dispersion | None:
    abbe = p.number("abbe", 0.0)
    if not abbe >= LEAST_ABBE:
        what = f"'abbe' of {p.element} is {abbe:g}, less than {LEAST_ABBE:g}: it does not disperse light."
        p.document.warn(what, p.values["abbe"])
        return None
    return by_abbe(n_d, abbe)


_READERS = {"glass": _named, "sellmeier_b": _sellmeier, "cauchy_a": _cauchy, "abbe": _abbe}
