"""Medium elements: homogeneous and heterogeneous participating media, with their phase functions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pmviewer.kernels.media.kinds import RAYLEIGH
from pmviewer.scene.description import Material, Medium
from pmviewer.scene.formats.mitsuba.document import Document, Properties
from pmviewer.scene.formats.mitsuba.interface import bounded
from pmviewer.scene.formats.mitsuba.older import is_clear
from pmviewer.scene.formats.mitsuba.volume import Volumes
from pmviewer.scene.formats.mitsuba.xml import Element
from pmviewer.scene.grid import Grid
from pmviewer.scene.medium import RGB, Phase

_LARGEST_SIGMA = 1e9
_STRAIGHTEST = 0.9999
"""Most |g|: beyond, float32 takes a lobe for a line."""


class Media:
    """Every medium of the scene once, however often it is referred to."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.volumes = Volumes(document)
        self.list: list[Medium] = []
        self._index: dict[int, int] = {}

    def of(self, element: Element) -> int:
        """Index of a <medium> element's medium; −1 for one that can't be shown, with a warning, and for one that does
        nothing."""
        if id(element) not in self._index:
            medium = self._read(Properties(element, self.document))
            self._index[id(element)] = -1
            if medium is not None and medium.acts:
                self._index[id(element)] = len(self.list)
                self.list.append(medium)
        return self._index[id(element)]

    def around(self, p: Properties) -> int:
        """Index of the medium that a sensor says it is in, −1 for none."""
        found = p.objects("medium")
        return self.of(found[0]) if found else -1

    def beside(self, p: Properties, material: Material) -> tuple[int, int] | None:
        """Indices of the media inside and outside of a shape, None where no medium begins or ends at it."""
        named = dict(reversed(p.named_objects("medium")))  # of two with one name the first
        for name in named.keys() - {"interior", "exterior"}:
            what = f"A medium of {p.element} has the name '{name[:40]}', not 'interior' or 'exterior': it was ignored."
            self.document.warn(what, p.element)
        inside, outside = (self.of(named[n]) if n in named else -1 for n in ("interior", "exterior"))
        if not named.keys() & {"interior", "exterior"}:
            return None
        if material.veiled and not is_clear(material):
            what = f"{p.element} lets rays pass in part and bounds a medium: the medium is left out."
            self.document.warn(what, p.element)
            return None
        return inside, outside

    def _read(self, p: Properties) -> Medium | None:
        if p.type == "heterogeneous":
            return self._varying(p)
        if p.type != "homogeneous":
            self.document.ignore(p.element, "is not supported: what it fills is clear")
            return None
        sigma_t, albedo = _coefficients(p)
        emission = _colour(p, "emission", 0.0, None)
        return _finished(p, Medium("medium", sigma_t, albedo, emission))

    def _varying(self, p: Properties) -> Medium | None:
        """A medium with grids; None, with a warning, where one can't be read. As in Mitsuba 3 it is where the volume of
        its extinction is, constant or not; version 0.6, which says "density", knows no box of a constant."""
        older = self.volumes.has(p, "density")
        density = self.volumes.of(p, "density" if older else "sigma_t", 1.0, None)
        albedo, emission = self.volumes.of(p, "albedo", 0.75, 1.0), self.volumes.of(p, "emission", 0.0, None)
        p.known("method", "step_size")
        if density is None or albedo is None or emission is None:
            self.document.ignore(p.element, "lacks its numbers: what it fills is clear")
            return None
        grid, other = density.grid if older else density.boxed, albedo.grid or emission.grid
        if grid is None and other is not None:
            grid = Grid(np.ones((1, 1, 1, 1), np.float32), other.to_world, "box")
        medium = Medium(
            "medium", density.factor, albedo.factor, emission.factor,
            density=grid, albedo_grid=albedo.grid, emission_grid=emission.grid,
        )  # fmt: skip
        return _finished(p, medium)


def _finished(p: Properties, medium: Medium) -> Medium:
    """The medium with its name, scale and phase function, and a warning about what nobody asked for."""
    scale = bounded(p, "scale", p.number("scale", 1.0), 0.0, _LARGEST_SIGMA)
    most = _LARGEST_SIGMA / max(1.0, medium.density.most if medium.density is not None else 1.0)
    r, g, b = (min(s * scale, most) for s in medium.sigma_t)
    phase = _phase(p)
    p.known("has_spectral_extinction", "sample_emitters")
    p.warn_unused("phase", "volume")
    return replace(medium, name=p.element.attributes.get("id") or "medium", sigma_t=(r, g, b), phase=phase)


def _coefficients(p: Properties) -> tuple[RGB, RGB]:
    """Extinction and albedo, from sigma_t and albedo or, as in Mitsuba 0.6, from sigma_a and sigma_s."""
    if "material" in p:
        p.known("material")
        what = f"'material' of {p.element} is not supported: name sigma_t and albedo. Mitsuba's defaults are used."
        p.document.warn(what, p.values["material"])
    if "sigma_s" in p or "sigma_a" in p:
        a, s = _colour(p, "sigma_a", 0.0, None), _colour(p, "sigma_s", 0.0, None)
        total = (a[0] + s[0], a[1] + s[1], a[2] + s[2])
        r, g, b = (si / t if t > 0 else 0.0 for si, t in zip(s, total))
        return total, (r, g, b)
    return _colour(p, "sigma_t", 1.0, None), _colour(p, "albedo", 0.75, 1.0)


def _colour(p: Properties, name: str, default: float, most: float | None) -> RGB:
    """A colour, or the value of a constvolume of that name."""
    for at, element in p.named_objects("volume"):
        if at == name:
            inner = Properties(element, p.document, 1)
            if inner.type == "constvolume":
                return inner.bounded_colour("value", default, most)
            what = f"'{name}' of {p.element}: {element} is not supported there, {default:g} is used."
            p.document.warn(what, element)
            return (default, default, default)
    return p.bounded_colour(name, default, most)


def _phase(p: Properties) -> Phase:
    found = p.objects("phase")
    if not found:
        return Phase()
    if len(found) > 1:
        p.document.warn(f"{p.element} has more than one phase function: the first is used.", p.element)
    return _phase_of(Properties(found[0], p.document, 1))


def _mean_cosine(p: Properties) -> float | None:
    """Of a table of values over cosines from −1 to 1, linear in between; None where it says nothing."""
    try:
        values = np.array(p.string("values", "").replace(",", " ").split(), float)
    except ValueError:
        return None
    if len(values) < 2 or not np.all(np.isfinite(values)) or not np.any(values := np.maximum(values, 0.0)):
        return None
    low, high = values[:-1], values[1:]
    edges = np.linspace(-1, 1, len(values))
    # Of a linear piece the first moment is that of a trapezoid.
    moments = low * (2 * edges[:-1] + edges[1:]) + high * (edges[:-1] + 2 * edges[1:])
    return float(np.clip(moments.sum() / (3 * (low + high).sum()), -_STRAIGHTEST, _STRAIGHTEST))


def _phase_of(p: Properties) -> Phase:
    if p.type == "isotropic":
        p.warn_unused()
        return Phase()
    if p.type == "hg":
        g = bounded(p, "g", p.number("g", 0.8), -_STRAIGHTEST, _STRAIGHTEST)
        p.warn_unused()
        return Phase(g)
    if p.type == "rayleigh":
        p.warn_unused()
        return Phase(RAYLEIGH)
    if p.type == "tabphase" and (mean := _mean_cosine(p)) is not None:
        what = f"{p.element} is shown as 'hg' with the same mean cosine, {mean:.2g}."
        p.document.warn(what, p.element)
        p.warn_unused()
        return Phase(mean)
    parts = p.objects("phase")
    if p.type == "blendphase" and len(parts) == 2:
        first, second = (_phase_of(Properties(part, p.document, 2)) for part in parts)
        weight = bounded(p, "weight", p.number("weight", 0.5), 0.0, 1.0)
        p.warn_unused("phase")
        if not first.beside and not second.beside:
            return Phase(first.g, second.g, weight)
    p.document.warn(f"{p.element} is not supported: light is scattered alike in all directions.", p.element)
    return Phase()
