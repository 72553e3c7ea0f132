"""Spectra and textures written as objects (`<spectrum type="…">`, `<texture type="…">`), reduced to one RGB colour."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmviewer.errors import SceneError
from pmviewer.scene.description import RGB
from pmviewer.scene.mitsuba_values import average_spectrum, parse_float
from pmviewer.scene.texture import mean_colour

if TYPE_CHECKING:
    from pmviewer.scene.mitsuba_document import Properties

WHITE: RGB = (1.0, 1.0, 1.0)


def spectrum_object(properties: Properties, default: RGB) -> RGB:
    """Colour of a nested texture or spectrum; whatever varies is replaced by its mean, with a warning."""
    kind, element, document = properties.type, properties.element, properties.document
    if kind in ("rgb", "srgb"):
        return properties.colour("color", default[0])
    if kind == "uniform":
        value = properties.number("value", default[0])
        return (value, value, value)
    if kind == "d65":
        document.warn(f"{element} is taken as white.", element)
        scale = properties.number("scale", 1.0)
        return (scale, scale, scale)
    if kind in ("regular", "irregular"):
        document.warn(f"{element} is approximated by its means over three bands of wavelengths.", element)
        return _sampled(properties)
    if kind == "checkerboard":
        a, b = properties.colour("color0", 0.4), properties.colour("color1", 0.2)
        document.warn(f"{element} is not supported: its mean colour is used.", element)
        return _mean(a, b)
    if kind == "bitmap":
        document.warn(f"{element} is not supported: its mean colour is used.", element)
        raw = properties.boolean("raw", False)
        path = document.file(properties.string("filename", ""), element)
        try:
            return mean_colour(path, raw)
        except SceneError as error:
            raise document.error(error.what, element, error.hint) from None
    grey = ", ".join(f"{c:g}" for c in default)
    document.warn(f"{element} is not supported: the default ({grey}) is used.", element)
    return default


def _mean(a: RGB, b: RGB) -> RGB:
    r, g, b_ = ((x + y) / 2 for x, y in zip(a, b))
    return (r, g, b_)


def _sampled(properties: Properties) -> RGB:
    def numbers(name: str) -> list[float]:
        return [parse_float(w) for w in properties.string(name, "").replace(",", " ").split()]

    element, document = properties.element, properties.document
    try:
        values = numbers("values")
        if properties.type == "irregular":
            wavelengths = numbers("wavelengths")
        else:
            first, last = properties.number("wavelength_min", 360.0), properties.number("wavelength_max", 830.0)
            step = (last - first) / max(1, len(values) - 1)
            wavelengths = [first + i * step for i in range(len(values))]
        if len(wavelengths) != len(values) or sorted(wavelengths) != wavelengths:
            raise ValueError("expected as many values as wavelengths, in increasing order")
        return average_spectrum(wavelengths, values)
    except ValueError as error:
        raise document.error(f"{element}: {error}.", element) from None
