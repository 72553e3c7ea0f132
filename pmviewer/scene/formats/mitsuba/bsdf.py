"""BSDF elements as materials: the supported ones exactly, others as the nearest or as grey, with a warning."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from pmviewer.scene.description import BLACK, RGB, THIN_GLASS, Material, ThinGlass
from pmviewer.scene.formats.mitsuba import older
from pmviewer.scene.formats.mitsuba.compound import blend, mask, mixture, two_sided
from pmviewer.scene.formats.mitsuba.disney import PARTS, as_principled
from pmviewer.scene.formats.mitsuba.document import Document, Properties
from pmviewer.scene.formats.mitsuba.glass import dispersing
from pmviewer.scene.formats.mitsuba.interface import alpha, alphas, bounded, distribution, relative_ior
from pmviewer.scene.formats.mitsuba.maps import mapped, with_textures
from pmviewer.scene.formats.mitsuba.principled import principled, principled_thin
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.optics import IOR, METALS, metal

_AROUND_ONE = frozenset(("twosided", "mask", "bumpmap", "bump", "normalmap", "coating", "roughcoating"))
_COMPOUND = _AROUND_ONE | {"blendbsdf", "mixturebsdf"}
_GREY = (0.5, 0.5, 0.5)
_ELSEWHERE = {"glass": "dielectric", "mirror": "conductor", "lambertian": "diffuse", "matte": "diffuse",
              "disney": "principled", "disneybsdf": "principled", **dict.fromkeys(PARTS, "principled")}  # fmt: skip
"""Types of other renderers that read Mitsuba's format."""


class Materials:
    """Every material of the scene once, however often it is referred to."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.list: list[Material] = []
        self._index: dict[int, int] = {}
        self._built: dict[int, Material] = {}
        self._defaults: dict[RGB, int] = {}
        self._null: int | None = None

    def default(self, emits: bool) -> int:
        """What a shape without a BSDF gets: grey, or black if it is a light."""
        reflectance = BLACK if emits else _GREY
        if reflectance not in self._defaults:
            self._defaults[reflectance] = len(self.list)
            self.list.append(Material("black" if emits else "default", "diffuse", reflectance))
        return self._defaults[reflectance]

    def of(self, element: Element) -> int:
        """Index of a <bsdf> element's material."""
        key = id(element)
        if key not in self._index:
            material = self._build(element, element.attributes.get("id") or f"{element.attributes.get('type')}", 0)
            self._index[key] = len(self.list)
            self.list.append(material)
        return self._index[key]

    def boundary(self, material: int) -> int:
        """The material of a shape where a medium begins or ends: where rays never stop, one that tells them so."""
        if not older.is_clear(self.list[material]):
            return material
        if self._null is None:
            self._null = len(self.list)
            self.list.append(Material("boundary of a medium", "null", BLACK))
        return self._null

    def _build(self, element: Element, name: str, depth: int) -> Material:
        """The element's material, once however many others it is a part of."""
        if id(element) not in self._built:
            self._built[id(element)] = self._read(element, name, depth)
        return self._built[id(element)]

    def _read(self, element: Element, name: str, depth: int) -> Material:
        p = Properties(element, self.document, depth)
        if p.type not in SIMPLE and p.type not in _COMPOUND:
            p.type = self._similar(p)
        if p.type in SIMPLE:
            material = with_textures(p, SIMPLE[p.type](p, name))
            p.warn_unused("texture")
            return material
        parts = [
            self._build(e, e.attributes.get("id") or f"{e.attributes.get('type')}", depth + 1)
            for e in p.objects("bsdf")
        ]
        if p.type in ("blendbsdf", "mixturebsdf"):
            return (blend if p.type == "blendbsdf" else mixture)(p, name, parts)
        if p.type in _AROUND_ONE:
            if not parts:
                self.document.warn(f"{p.element} has no BSDF inside: a grey diffuse surface stands in.", p.element)
                parts = [Material(name, "diffuse", _GREY)]
            return _around(p, replace(parts[0], name=name), parts[1:])
        if parts:
            self.document.warn(f"{element} is not supported: the BSDF inside is shown without it.", element)
            return replace(parts[0], name=name)
        self.document.warn(f"{element} is not supported: a grey diffuse surface replaces it.", element)
        return Material(name, "diffuse", _GREY)

    def _similar(self, p: Properties) -> str:
        """What an unknown type is elsewhere, or the longest known one that its name begins with: others' plugins are
        called so."""
        word = p.type.lower()
        known = _ELSEWHERE.get(word) or max(
            (t for t in (*SIMPLE, *_COMPOUND) if word.startswith(t)), key=len, default=p.type
        )
        if known != p.type:
            self.document.warn(f"{p.element} is not supported: it is read as '{known}'.", p.element)
        if word.startswith("disney") and known == "principled":
            as_principled(p, word)
        return known


def _around(p: Properties, inner: Material, others: list[Material]) -> Material:
    if p.type == "twosided":
        return two_sided(p, inner, others)
    if others:
        p.document.warn(f"{p.element} has more than one BSDF inside: the first is used.", p.element)
    if p.type == "mask":
        return mask(p, inner)
    if p.type in ("coating", "roughcoating"):
        material = older.coating(p, inner.name, inner)
        p.warn_unused("bsdf")
        return material
    return mapped(p, inner)


def _diffuse(p: Properties, name: str) -> Material:
    return Material(name, "diffuse", p.bounded_colour(older.diffuse_name(p), 0.5, 1))


def _conductor(p: Properties, name: str) -> Material:
    scale = p.bounded_colour("specular_reflectance", 1.0, 1)
    index = None
    wanted = p.string("material", "none")
    if "eta" in p or "k" in p:
        index = (p.bounded_colour("eta", 0.0, None), p.bounded_colour("k", 1.0, None))
    elif wanted.lower() != "none":
        index = metal(wanted)
        if index is None:
            known = ", ".join(METALS)
            sentence = f"Metal '{wanted[:40]}' of {p.element} is not known ({known} are): a perfect mirror replaces it."
            p.document.warn(sentence, p.element)
    outside = _outside(p)
    if index is not None and outside != 1:
        index = tuple((r / outside, g / outside, b / outside) for r, g, b in index)  # type: ignore[assignment]
    if p.type == "conductor":
        return Material(name, "conductor", scale, metal=index)
    return Material(name, "rough conductor", scale, metal=index, alpha=alphas(p), distribution=distribution(p))


def _outside(p: Properties) -> float:
    """Index of what surrounds a conductor: `ext_eta`, a number or a name (version 0.6)."""
    if p.tag_of("ext_eta") in ("float", "integer"):
        return bounded(p, "ext_eta", p.number("ext_eta", 1.0), 1e-3, 1e3)
    name = p.string("ext_eta", "vacuum").lower()
    if name not in IOR:
        p.document.warn(f"'ext_eta' of {p.element}: '{name[:40]}' is not known, air replaces it.", p.element)
    return IOR.get(name, IOR["air"])


def _dielectric(p: Properties, name: str) -> Material:
    thin = p.type == "thindielectric"
    material = Material(
        name,
        "thin dielectric" if thin else "dielectric",
        reflectance=p.bounded_colour("specular_reflectance", 1.0, 1),
        transmittance=p.bounded_colour("specular_transmittance", 1.0, 1),
        eta=relative_ior(p, "bk7"),
    )
    if not thin:
        # Not Mitsuba's: σ of Beer–Lambert's law inside, per scene unit.
        material = replace(material, absorption=p.bounded_colour("absorption", 0.0, None))
        material = dispersing(p, material)
    if p.type == "roughdielectric":
        return replace(material, kind="rough dielectric", alpha=alphas(p), distribution=distribution(p))
    return replace(material, thin_glass=_thin_glass(p))


def _thin_glass(p: Properties) -> ThinGlass:
    """Not Mitsuba's: how light passes the glass (`Material.thin_rule`)."""
    asked = p.string("thin_glass", "")
    for rule in THIN_GLASS:
        if asked == rule:
            return rule
    known = ", ".join(THIN_GLASS[1:])
    p.document.warn(f"'thin_glass' of {p.element} is '{asked[:40]}', none of {known}: it is left out.", p.element)
    return ""


def _plastic(p: Properties, name: str) -> Material:
    material = Material(
        name,
        "plastic",
        reflectance=p.bounded_colour("diffuse_reflectance", 0.5, 1),
        specular=p.bounded_colour("specular_reflectance", 1.0, 1),
        eta=relative_ior(p, "polypropylene"),
        nonlinear=p.boolean("nonlinear", False),
    )
    if p.type == "plastic":
        return material
    rough = alpha(p, "alpha")
    return replace(material, kind="rough plastic", alpha=(rough, rough), distribution=distribution(p))


def _schlick(p: Properties, name: str) -> Material:
    """Not Mitsuba's: `alpha` from 1, diffuse, to 0, specular (`pmviewer.kernels.bsdf.schlick`)."""
    factor = math.sqrt(alpha(p, "alpha", most=1.0))
    colour = p.bounded_colour("reflectance", 0.5, 1)
    specular = p.bounded_colour("specular_reflectance", 1.0, 1) if "specular_reflectance" in p else colour
    return Material(name, "schlick", colour, specular=specular, alpha=(factor, factor))


def _ward(p: Properties, name: str) -> Material:
    """As in Mitsuba 0.6, always in the form whose albedo is bounded (`pmviewer.kernels.bsdf.ward`)."""
    specular = p.bounded_colour("specular_reflectance", 0.2, 1)
    diffuse = older.cut_diffuse(p, p.bounded_colour("diffuse_reflectance", 0.5, 1), specular)
    p.known("variant")
    return Material(name, "ward", diffuse, specular=specular, alpha=alphas(p))


def _null(p: Properties, name: str) -> Material:
    return older.clear(name)


SIMPLE: dict[str, Callable[[Properties, str], Material]] = {
    "diffuse": _diffuse,
    "conductor": _conductor,
    "roughconductor": _conductor,
    "dielectric": _dielectric,
    "thindielectric": _dielectric,
    "roughdielectric": _dielectric,
    "plastic": _plastic,
    "roughplastic": _plastic,
    "schlick": _schlick,
    "ward": _ward,
    "principled": principled,
    "principledthin": principled_thin,
    "null": _null,
    "phong": older.phong,
    "roughdiffuse": older.rough_diffuse,
    "difftrans": older.diffuse_transmitter,
    "hk": older.hanrahan_krueger,
    "pplastic": older.polarised_plastic,
    "polarizer": older.polariser,
    "circular": older.polariser,
    "retarder": older.retarder,
}
"""BSDFs without another one inside, by type."""
