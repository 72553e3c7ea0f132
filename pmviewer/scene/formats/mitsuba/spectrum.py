"""Spectra written as objects (`<spectrum type="…">`), reduced to one RGB colour."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmviewer.scene.description import RGB
from pmviewer.scene.formats.mitsuba.values import average_spectrum, parse_float

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Properties

WHITE: RGB = (1.0, 1.0, 1.0)


def spectrum_object(properties: Properties, default: RGB) -> RGB:
    """Colour of a nested spectrum, or of a texture that is not read as one; what varies becomes its mean, with a
    warning."""
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
    grey = ", ".join(f"{c:g}" for c in default)
    document.warn(f"{element} is not supported: the default ({grey}) is used.", element)
    return default


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
