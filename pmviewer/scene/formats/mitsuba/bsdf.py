"""BSDF elements as materials: the supported ones exactly, others replaced by a grey surface, with a warning."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from pmviewer.scene.description import BLACK, RGB, Material
from pmviewer.scene.formats.mitsuba.document import Document, Properties
from pmviewer.scene.formats.mitsuba.maps import mapped, with_textures
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.optics import IOR, METALS, metal

_LARGEST_ALPHA = 10.0
_WRAPPERS = frozenset(("mask",))
_MAPS = frozenset(("bumpmap", "normalmap"))
_MAP_SLOTS = frozenset(("bump", "normal"))


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
        if p.type in ("twosided", *_WRAPPERS, *_MAPS):
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
            material = self._plastic(p, name)
        elif p.type == "schlick":
            material = self._schlick(p, name)
        elif p.type == "ward":
            material = self._ward(p, name)
        else:
            self.document.warn(f"{element} is not supported: a grey diffuse surface replaces it.", element)
            return Material(name, "diffuse")
        material = with_textures(p, material)
        p.warn_unused()
        return material

    def _wrapped(self, p: Properties, name: str, depth: int) -> Material:
        inner = p.objects("bsdf")
        if not inner:
            raise self.document.error(f"{p.element} needs a BSDF inside.", p.element)
        material = self._build(inner[0], name, depth + 1)
        if p.type in _MAPS:
            return mapped(p, material)
        if p.type in _WRAPPERS:
            self.document.warn(f"{p.element} is not supported: only the BSDF inside is used.", p.element)
            return material
        if len(inner) > 1:
            self.document.warn(f"{p.element}: the second BSDF is ignored, both sides use the first.", p.element)
        if material.transparent:
            self.document.warn(f"{p.element} has no effect on a transparent BSDF.", p.element)
        p.warn_unused("bsdf")
        mapped_inside = not _MAP_SLOTS.isdisjoint(material.textures)
        return replace(
            material, two_sided=not material.transparent, mirrored_maps=mapped_inside and not material.transparent
        )

    def _conductor(self, p: Properties, name: str) -> Material:
        scale = p.bounded_colour("specular_reflectance", 1.0, 1)
        index = None
        wanted = p.string("material", "none")
        if "eta" in p or "k" in p:
            index = (p.bounded_colour("eta", 0.0, None), p.bounded_colour("k", 1.0, None))
        elif wanted != "none":
            index = metal(wanted)
            if index is None:
                known = ", ".join(METALS)
                sentence = f"Metal '{wanted}' of {p.element} is not known ({known} are): a perfect mirror replaces it."
                self.document.warn(sentence, p.element)
        if p.type == "conductor":
            return Material(name, "conductor", scale, metal=index)
        return Material(
            name,
            "rough conductor",
            scale,
            metal=index,
            alpha=self._alphas(p),
            distribution=self._distribution(p),
        )

    def _dielectric(self, p: Properties, name: str) -> Material:
        inside, outside = self._ior(p, "int_ior", "bk7"), self._ior(p, "ext_ior", "air")
        material = Material(
            name,
            "thin dielectric" if p.type == "thindielectric" else "dielectric",
            reflectance=p.bounded_colour("specular_reflectance", 1.0, 1),
            transmittance=p.bounded_colour("specular_transmittance", 1.0, 1),
            eta=inside / outside,
        )
        if p.type != "thindielectric":
            # Not Mitsuba's: σ of Beer–Lambert's law inside, per scene unit.
            material = replace(material, absorption=p.bounded_colour("absorption", 0.0, None))
        if p.type == "roughdielectric":
            alpha, distribution = self._alphas(p), self._distribution(p)
            return replace(material, kind="rough dielectric", alpha=alpha, distribution=distribution)
        return material

    def _plastic(self, p: Properties, name: str) -> Material:
        inside, outside = self._ior(p, "int_ior", "polypropylene"), self._ior(p, "ext_ior", "air")
        material = Material(
            name,
            "plastic",
            reflectance=p.bounded_colour("diffuse_reflectance", 0.5, 1),
            specular=p.bounded_colour("specular_reflectance", 1.0, 1),
            eta=inside / outside,
            nonlinear=p.boolean("nonlinear", False),
        )
        if p.type == "plastic":
            return material
        alpha = self._alpha(p, "alpha")
        return replace(material, kind="rough plastic", alpha=(alpha, alpha), distribution=self._distribution(p))

    def _schlick(self, p: Properties, name: str) -> Material:
        """Not Mitsuba's: `alpha` from 1, diffuse, to 0, specular (`pmviewer.kernels.schlick`)."""
        factor = self._alpha(p, "alpha", most=1.0)
        colour = p.bounded_colour("reflectance", 0.5, 1)
        specular = p.bounded_colour("specular_reflectance", 1.0, 1) if "specular_reflectance" in p else colour
        return Material(name, "schlick", colour, specular=specular, alpha=(math.sqrt(factor), math.sqrt(factor)))

    def _ward(self, p: Properties, name: str) -> Material:
        """As in Mitsuba 0.6, always in the form whose albedo is bounded (`pmviewer.kernels.ward`)."""
        diffuse = p.bounded_colour("diffuse_reflectance", 0.5, 1)
        specular = p.bounded_colour("specular_reflectance", 0.2, 1)
        p.known("variant")
        if max(d + s for d, s in zip(diffuse, specular)) > 1:
            sentence = (
                f"Diffuse and specular reflectance of {p.element} add up to more than 1: the diffuse one was cut."
            )
            self.document.warn(sentence, p.element)
            r, g, b = (min(d, 1 - s) for d, s in zip(diffuse, specular))
            diffuse = (r, g, b)
        return Material(name, "ward", diffuse, specular=specular, alpha=self._alphas(p))

    def _distribution(self, p: Properties) -> Literal["ggx", "beckmann"]:
        p.known("sample_visible")
        name = p.string("distribution", "beckmann").lower()
        if name == "ggx":
            return "ggx"
        if name != "beckmann":
            what = f"'distribution' of {p.element}: expected beckmann or ggx, found '{name}'."
            raise self.document.error(what, p.values["distribution"])
        return "beckmann"

    def _alphas(self, p: Properties) -> tuple[float, float]:
        """Roughness along and across the tangent."""
        if "alpha_u" not in p and "alpha_v" not in p:
            alpha = self._alpha(p, "alpha")
            return alpha, alpha
        if "alpha" in p or "alpha_u" not in p or "alpha_v" not in p:
            what = f"{p.element} needs either 'alpha' or both 'alpha_u' and 'alpha_v'."
            raise self.document.error(what, p.element)
        return self._alpha(p, "alpha_u"), self._alpha(p, "alpha_v")

    def _alpha(self, p: Properties, name: str, most: float = _LARGEST_ALPHA) -> float:
        alpha = p.roughness(name, 0.1)
        if not 0 <= alpha <= most:
            what = f"'{name}' of {p.element}: expected 0 to {most:g}, found {alpha:g}."
            raise self.document.error(what, p.values.get(name, p.element))
        return alpha

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
