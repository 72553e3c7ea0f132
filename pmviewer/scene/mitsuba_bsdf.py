"""BSDF elements as materials: the supported ones exactly, common others by the nearest one, with a warning."""

from __future__ import annotations

from pmviewer.scene.description import BLACK, RGB, Material
from pmviewer.scene.mitsuba_document import Document, Properties
from pmviewer.scene.mitsuba_xml import Element
from pmviewer.scene.optics import IOR, METALS, normal_reflectance

_WRAPPERS = frozenset(("mask", "bumpmap", "normalmap"))


class Materials:
    """Every material of the scene once, however often it is referred to."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.list: list[Material] = []
        self._index: dict[int, int] = {}
        self._defaults: dict[RGB, int] = {}

    def default(self, emits: bool) -> int:
        """What a shape without a BSDF gets: grey, or black if it is a light."""
        reflectance = BLACK if emits else (0.5, 0.5, 0.5)
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

    def _build(self, element: Element, name: str, depth: int) -> Material:
        p = Properties(element, self.document, depth)
        if p.type in ("twosided", *_WRAPPERS):
            return self._wrapped(p, name, depth)
        if p.type == "diffuse":
            if "diffuse_reflectance" in p.values:
                material = Material(name, "diffuse", p.bounded_colour("diffuse_reflectance", 0.5, 1))
            else:
                material = Material(name, "diffuse", p.bounded_colour("reflectance", 0.5, 1))
        elif p.type in ("conductor", "roughconductor"):
            material = self._conductor(p, name)
        elif p.type in ("dielectric", "thindielectric", "roughdielectric"):
            material = self._dielectric(p, name)
        elif p.type in ("plastic", "roughplastic"):
            self._approximate(p, "its diffuse part")
            material = Material(name, "diffuse", p.bounded_colour("diffuse_reflectance", 0.5, 1))
        else:
            self.document.warn(f"{element} is not supported: a grey diffuse surface replaces it.", element)
            return Material(name, "diffuse")
        p.warn_unused()
        return material

    def _approximate(self, p: Properties, by: str) -> None:
        self.document.warn(f"{p.element} is approximated by {by}.", p.element)
        p.known(*p.values)

    def _wrapped(self, p: Properties, name: str, depth: int) -> Material:
        inner = p.objects("bsdf")
        if not inner:
            raise self.document.error(f"{p.element} needs a BSDF inside.", p.element)
        material = self._build(inner[0], name, depth + 1)
        if p.type in _WRAPPERS:
            self.document.warn(f"{p.element} is not supported: only the BSDF inside is used.", p.element)
            return material
        if len(inner) > 1:
            self.document.warn(f"{p.element}: the second BSDF is ignored, both sides use the first.", p.element)
        if material.kind == "dielectric":
            self.document.warn(f"{p.element} has no effect on a transparent BSDF.", p.element)
        p.warn_unused("bsdf")
        return Material(
            material.name, material.kind, material.reflectance, material.transmittance, material.eta,
            two_sided=material.kind != "dielectric",
        )  # fmt: skip

    def _conductor(self, p: Properties, name: str) -> Material:
        scale = p.bounded_colour("specular_reflectance", 1.0, 1)
        metal = p.string("material", "none")
        mirror = (1.0, 1.0, 1.0)
        if "eta" in p or "k" in p:
            eta, k = p.bounded_colour("eta", 0.0, None), p.bounded_colour("k", 1.0, None)
            mirror = tuple(normal_reflectance(e, x) for e, x in zip(eta, k))  # type: ignore[assignment]
            self._same_at_all_angles(p)
        elif metal in METALS:
            mirror = METALS[metal]
            self._same_at_all_angles(p)
        elif metal != "none":
            known = ", ".join(METALS)
            sentence = f"Metal '{metal}' of {p.element} is not known ({known} are): a perfect mirror replaces it."
            self.document.warn(sentence, p.element)
        if p.type == "roughconductor":
            self._approximate(p, "a smooth mirror")
        reflectance = tuple(s * m for s, m in zip(scale, mirror))
        return Material(name, "conductor", reflectance)  # type: ignore[arg-type]

    def _same_at_all_angles(self, p: Properties) -> None:
        sentence = f"{p.element} with a metal's index reflects at all angles as it does head-on."
        self.document.warn(sentence, p.element)

    def _dielectric(self, p: Properties, name: str) -> Material:
        inside, outside = self._ior(p, "int_ior", "bk7"), self._ior(p, "ext_ior", "air")
        material = Material(
            name,
            "dielectric",
            reflectance=p.bounded_colour("specular_reflectance", 1.0, 1),
            transmittance=p.bounded_colour("specular_transmittance", 1.0, 1),
            eta=inside / outside,
        )
        if p.type != "dielectric":
            self._approximate(p, "a plain dielectric")
        return material

    def _ior(self, p: Properties, name: str, default: str) -> float:
        if p.tag_of(name) in ("float", "integer"):
            value = p.number(name, 1.0)
            if not 1e-3 <= value <= 1e3:
                at = p.values[name]
                raise self.document.error(f"'{name}' of {p.element}: expected 0.001 to 1000, found {value:g}.", at)
            return value
        material = p.string(name, default).lower()
        if material not in IOR:
            known = ", ".join(IOR)
            what = f"'{name}' of {p.element}: the material '{material}' is not known."
            raise self.document.error(what, p.values.get(name, p.element), f"Give a number or one of: {known}.")
        return IOR[material]
