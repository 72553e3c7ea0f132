"""Views of how a picture is made: what each shows, in which unit, on which scale (V3).

A frame holds their planes only while one of them is shown. Pixels in which there is nothing to tell hold a negative
number (`NOTHING`) in every channel and are shown in a neutral grey.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.colour_maps import CLASSES
from pmviewer.output.false_look import Look, Own
from pmviewer.output.falsecolour import Scale, false_colour

Family = Literal[
    "look-up",
    "shadow rays",
    "radiance photons",
    "importance",
    "density",
    "storing",
    "convergence",
    "virtual lights",
    "estimation",
    "noise",
    "samples",
    "depth in media",
    "beams",
    "slice",
    "error",
    "difference",
]
DENOISED = "denoised"
"""The one view of those that a frame holds only while it is shown that is a picture (`pmviewer.output.denoise`)."""
NOTHING = -1.0
DIMMED = 0.4
"""Brightness of cells whose radiance photon is the nearest, but not near enough to be used."""
GREY = (0.16, 0.16, 0.16)
"""Display-encoded colour of pixels in which there is nothing to tell."""
CLASS_COLOURS = CLASSES["usual"]
"""Of caustic convergence, unless the display settings choose others."""
LUMINANCE = (0.2126, 0.7152, 0.0722)


@dataclass(frozen=True)
class DiagnosticView:
    """`family`: views that one computation gives; `channels` of its plane, three for a colour whose luminance is
    shown; `text`: caption; `unit` of the plane's values; `none`: what a pixel is told that has nothing."""

    family: Family
    text: str
    unit: str
    none: str
    channels: int = 1
    log: bool = False
    fixed: tuple[float, float] | None = None
    """Ends of the scale, where they don't follow the picture."""
    cells: bool = False
    """Values are numbers of cells, each with a colour of its own, dimmed where a half is added."""
    diverging: bool = False
    """Values are ratios, shown by how far they are below or above 1."""
    classes: tuple[str, ...] = ()
    """Values are numbers of classes with these names, in CLASS_COLOURS."""
    signed: bool = False
    """Values may be below zero, which is the middle of the colours; there is something to tell in every pixel."""

    @property
    def own(self) -> Own:
        """How its numbers become colours by themselves; counts start at none."""
        from_none = self.unit in ("photons", "divisions")
        return Own(self.unit, self.log, self.fixed, self.diverging, self.signed, from_none)

    @property
    def in_colours(self) -> bool:
        """Whether its values are shown on a scale."""
        return not (self.cells or self.classes)


DIAGNOSTICS: Mapping[str, DiagnosticView] = {
    "look-up radius": DiagnosticView(
        "look-up", "radius of the photon look-up at the first surface, latest pass", "m", "no look-up"
    ),
    "photon count": DiagnosticView(
        "look-up", "photons in the look-up at the first surface, latest pass", "photons", "no look-up"
    ),
    "shadow rays skipped": DiagnosticView(
        "shadow rays",
        "share of light samples whose shadow ray shadow photons spared",
        "%",
        "no light sample counts here",
        fixed=(0.0, 100.0),
    ),
    "radiance photons": DiagnosticView(
        "radiance photons",
        "irradiance that a gather ray would take here, from the nearest radiance photon",
        "W/m²",
        "no surface that stores photons",
        channels=3,
        log=True,
    ),
    "radiance cells": DiagnosticView(
        "radiance photons",
        "the nearest radiance photon; dim: beyond the cut-off, a look-up of its own",
        "",
        "no radiance photon near",
        cells=True,
    ),
    "importance": DiagnosticView(
        "importance",
        "importance of the first surface: pixels of the picture that ask for a unit of its area",
        "px/m²",
        "no surface that stores photons",
        log=True,
    ),
    "required density": DiagnosticView(
        "importance",
        "density that the photon map should have at the first surface",
        "photons/m²",
        "no surface that stores photons",
        log=True,
    ),
    "achieved density": DiagnosticView(
        "density",
        "density of the photons stored at the first surface, latest pass",
        "photons/m²",
        "no surface that stores photons",
        log=True,
    ),
    "density ratio": DiagnosticView(
        "density",
        "achieved / required density at the first surface; blue: too few photons, orange: more than enough",
        "×",
        "nothing required",
        log=True,
        diverging=True,
    ),
    "storing probability": DiagnosticView(
        "storing",
        "probability with which Keller and Wald's rule stores a photon that arrives at the first surface",
        "",
        "no surface that stores photons",
        fixed=(0.0, 1.0),
    ),
    "caustic convergence": DiagnosticView(
        "convergence",
        "state of the caustic map at the first surface, latest pass",
        "",
        "no caustic",
        classes=("more photons needed", "converged", "dense enough"),
    ),
    "virtual light error": DiagnosticView(
        "virtual lights",
        "standard error of the plain sum over virtual lights relative to that sum, all passes",
        "%",
        "no light from virtual lights",
        log=True,
    ),
    "sum of weights": DiagnosticView(
        "virtual lights",
        "mean over passes of the sum of the virtual lights' weights; it tends to the normalisation",
        "",
        "no weighted light",
    ),
    "normalisation": DiagnosticView(
        "virtual lights",
        "what weighted sums are multiplied by: how often a gathering walk makes what the lights stand for",
        "",
        "no weighted light",
    ),
    "estimation mask": DiagnosticView(
        "estimation",
        "where the latest pass could estimate gathers: critical pixels gather as usual",
        "",
        "no diffuse surface seen first",
        classes=("critical", "safe"),
    ),
    "gathered points": DiagnosticView(
        "estimation",
        "how the latest pass got the indirect light of a pixel",
        "",
        "no diffuse surface seen first",
        classes=("gathered as usual", "interpolated", "full gather"),
    ),
    "subdivision level": DiagnosticView(
        "estimation",
        "how often the tile was divided in which the latest pass interpolated or gathered the pixel",
        "divisions",
        "gathered as usual",
    ),
    "reprojected share": DiagnosticView(
        "estimation",
        "share of the directions of a gather that the latest pass took from others near it, interpolated in between",
        "%",
        "gathered as usual",
        fixed=(0.0, 100.0),
    ),
    "noise": DiagnosticView(
        "noise",
        "standard error of the pixel relative to the pixel, from how the passes differ",
        "%",
        "fewer than two passes",
        log=True,
    ),
    "samples a pass": DiagnosticView(
        "samples",
        "samples of the pixel in the latest pass: more at mirrors, glass and edges, and where it is noisy",
        "samples",
        "not rendered",
        log=True,
        fixed=(1.0, 16.0),
    ),
    "optical depth": DiagnosticView(
        "depth in media",
        "optical depth of media from the camera to the first surface, mean of the channels",
        "",
        "no medium before the first surface",
    ),
    "mean free path": DiagnosticView(
        "depth in media",
        "mean way of light between collisions: the ray's way in media over its optical depth",
        "m",
        "nothing to collide with before the first surface",
        log=True,
    ),
    "volume radius": DiagnosticView(
        "beams",
        "radius of the beam estimate around the camera ray, latest pass; on lattices the widest of its photons",
        "m",
        "no medium that scatters before the first surface",
    ),
    "volume photon count": DiagnosticView(
        "beams",
        "photons in the beam estimate along the camera ray, latest pass",
        "photons",
        "no medium that scatters before the first surface",
    ),
    "extinction slice": DiagnosticView(
        "slice",
        "extinction of media where a plane cuts them, mean of the channels",
        "1/m",
        "no medium on the plane here, or a surface before it",
    ),
    "photon slice": DiagnosticView(
        "slice",
        "density of the volume photons where a plane cuts media, latest pass",
        "photons/m³",
        "no medium that scatters on the plane here, or a surface before it",
        log=True,
    ),
}
HELD_WHILE_SHOWN = (DENOISED, *DIAGNOSTICS)
ERROR = DiagnosticView(
    "error", "(I–R)²/(R²+0.01) of each pixel, mean of the channels", "", "", log=True, fixed=(1e-5, 1.0)
)
"""The view *error*, which needs a reference and nothing of the frame but its picture. Its scale is the same for every
picture, so that two can be compared."""


def scalar(values: NDArray[np.floating]) -> NDArray[np.float32]:
    """(h, w) of a plane (h, w, 1), or the luminance of (h, w, 3); negative where there is nothing."""
    if values.shape[-1] == 1:
        return np.ascontiguousarray(values[..., 0], np.float32)
    return (values @ np.array(LUMINANCE, np.float32)).astype(np.float32)


def told(info: DiagnosticView, values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Those of the values (h, w) in whose pixels there is something to tell, (n,); what is no number counts."""
    return values.reshape(-1) if info.signed else values[~(values < 0)]


def view_scale(view: str, plane: NDArray[np.floating], look: Look | None = None) -> Scale:
    """The scale on which a plane of that view is shown."""
    info = DIAGNOSTICS[view]
    return (look or Look()).scale(info.own, told(info, scalar(plane)))


def cell_colours(cells: NDArray[Any]) -> NDArray[np.float32]:
    """Display-encoded colours (n, 3) of cell numbers (n,) ≥ 0: pseudo-random, never dark. `shaders/picture.frag` has
    the same hash."""
    h = np.asarray(cells).astype(np.uint32)
    for factor in (np.uint32(0x7FEB352D), np.uint32(0x846CA68B)):
        h ^= h >> np.uint32(16)
        h *= factor
    h ^= h >> np.uint32(16)
    parts = np.stack([h & 255, (h >> 8) & 255, (h >> 16) & 255], axis=-1).astype(np.float32) / np.float32(255)
    return (np.float32(0.25) + np.float32(0.75) * parts).astype(np.float32)


def coloured(view: str, plane: NDArray[np.floating], look: Look | None = None) -> NDArray[np.float32]:
    """Display-encoded picture (h, w, 3) of a plane."""
    return coloured_by(DIAGNOSTICS[view], plane, look or Look())


def coloured_by(info: DiagnosticView, plane: NDArray[np.floating], look: Look) -> NDArray[np.float32]:
    """The same of any kind of view in false colours."""
    values = scalar(plane)
    if info.classes:
        pixels = np.array(look.class_colours, np.float32)[np.maximum(values, 0).astype(int)]
    elif info.cells:
        cells = np.floor(np.maximum(values, 0))
        pixels = cell_colours(cells)
        pixels[values > cells] *= np.float32(DIMMED)
    else:
        pixels = false_colour(values, look.scale(info.own, told(info, values)), look.table(info.own))
    if not info.signed:
        pixels[values < 0] = GREY
    return pixels
