"""Spectra as linear sRGB, by the rules of Mitsuba 3's RGB variants.

What a surface makes of light (reflectances, refractive indices) is seen in daylight (D65), so that 1 at all wavelengths
is white; light itself (`emitted`) is seen as it is.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pmviewer.scene.cie import EQUAL_ENERGY, FIRST_NM, LAST_NM, rgb_of_blackbody, rgb_of_samples
from pmviewer.scene.description import RGB
from pmviewer.scene.formats.mitsuba.values import in_order, is_sampled, parse_list, parse_rgb, parse_samples

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Document, Properties
    from pmviewer.scene.formats.mitsuba.xml import Element

LARGEST_FILE = 4 << 20
_OUT_OF_GAMUT = 0.01
"""A negative channel beyond this share of the largest is worth a warning."""
Samples = tuple[list[float], list[float]]


def spectrum_text(text: str, emitted: bool, element: Element, document: Document) -> RGB:
    """Colour of "0.5", "0.1 0.2 0.3" (RGB, as in Mitsuba 0.6) or "400:0.1, 500:0.2 …". Raises ValueError."""
    if is_sampled(text):
        return _seen(parse_samples(text), emitted, element, document)
    r, g, b = parse_rgb(text)
    if emitted and len(parse_list(text)) == 1:
        return (r * EQUAL_ENERGY[0], g * EQUAL_ENERGY[1], b * EQUAL_ENERGY[2])
    return (r, g, b)


def spectrum_file(path: Path, emitted: bool, element: Element, document: Document) -> RGB:
    """Colour of an .spd file: a wavelength and a value a line, # starts a comment. Raises ValueError."""
    if path.stat().st_size > LARGEST_FILE:
        raise ValueError(f"expected a spectrum of at most {LARGEST_FILE >> 20} MiB in {path.name}")
    rows = [parse_list(line.partition("#")[0]) for line in path.read_text("utf-8", "replace").splitlines()]
    rows = [row for row in rows if row]
    if any(len(row) != 2 for row in rows):
        raise ValueError(f"expected a wavelength and a value in each line of {path.name}")
    return _seen(in_order([r[0] for r in rows], [r[1] for r in rows]), emitted, element, document)


def spectrum_object(p: Properties, default: RGB) -> RGB:
    """Colour of a nested spectrum; what is not one becomes the default, with a warning."""
    kind, element, document = p.type, p.element, p.document
    if kind in ("rgb", "srgb", "rawconstant"):
        return p.colour("value" if "value" in p else "color", default[0])
    if kind == "uniform":
        p.known("wavelength_min", "wavelength_max")
        value = p.number("value", default[0])
        return (value, value, value)
    if kind == "d65":
        scale = p.number("scale", 1.0)
        r, g, b = _in_daylight(p)
        return (scale * r, scale * g, scale * b)
    try:
        if kind in ("regular", "irregular"):
            return _seen(_samples(p), p.emitted, element, document)
        if kind == "blackbody":
            return _blackbody(p, element, document)
    except ValueError as error:
        document.warn(f"{element}: {error}; the default ({_shown(default)}) is used.", element)
        return default
    document.warn(f"{element} is not supported: the default ({_shown(default)}) is used.", element)
    return default


def _in_daylight(p: Properties) -> RGB:
    """Colour of what stands inside a d65; white if nothing does. Textures have been taken out before."""
    named = [name for name, value in p.values.items() if name == "color" or value.tag == "spectrum"]
    if named:
        return p.colour(named[0], 1.0)
    inner = p.objects("spectrum")
    return p.nested_spectrum(inner[0]) if inner else (1.0, 1.0, 1.0)


def blackbody_tag(element: Element, document: Document) -> RGB:
    """Colour of Mitsuba 0.6's <blackbody temperature="5000K" scale="…"/>. Raises ValueError."""
    kelvin = parse_list(element.attributes.get("temperature", "").strip().rstrip("kK"))
    scale = parse_list(element.attributes.get("scale", "1"))
    if len(kelvin) != 1 or len(scale) != 1:
        raise ValueError("expected a temperature such as 5000K and a scale")
    r, g, b = _in_gamut(_glow(kelvin[0]), element, document)
    return (r * scale[0], g * scale[0], b * scale[0])


def _blackbody(p: Properties, element: Element, document: Document) -> RGB:
    first, last = p.number("wavelength_min", FIRST_NM), p.number("wavelength_max", LAST_NM)
    scale = p.number("scale", 1.0)
    r, g, b = _in_gamut(_glow(p.number("temperature", 5000.0), first, last), element, document)
    return (r * scale, g * scale, b * scale)


def _glow(kelvin: float, first: float = FIRST_NM, last: float = LAST_NM) -> RGB:
    if not 1.0 <= kelvin <= 1e6:
        raise ValueError(f"expected a temperature of 1 to 1000000 K, found {kelvin:g}")
    return rgb_of_blackbody(kelvin, first, last)


def _samples(p: Properties) -> Samples:
    if "value" in p:
        return parse_samples(p.string("value", ""))
    values = parse_list(p.string("values", ""))
    if p.type == "irregular":
        return in_order(parse_list(p.string("wavelengths", "")), values)
    bounds = parse_list(p.string("range", "")) or [FIRST_NM, LAST_NM]
    first, last = p.number("wavelength_min", bounds[0]), p.number("wavelength_max", bounds[-1])
    step = (last - first) / max(1, len(values) - 1)
    return in_order([first + i * step for i in range(len(values))], values)


def _seen(samples: Samples, emitted: bool, element: Element, document: Document) -> RGB:
    return _in_gamut(rgb_of_samples(*samples, lit=not emitted), element, document)


def _in_gamut(colour: RGB, element: Element, document: Document) -> RGB:
    if min(colour) < -_OUT_OF_GAMUT * max(map(abs, colour)):
        sentence = "The colour of a spectrum lies outside of what RGB can show: its negative part is cut off."
        document.warn(sentence, element)
    r, g, b = (max(0.0, c) for c in colour)
    return (r, g, b)


def _shown(colour: RGB) -> str:
    return ", ".join(f"{c:g}" for c in colour)
