"""Displacement as a shape's property: a texture of heights, its scale and offset, and how finely the shape is cut."""

from __future__ import annotations

from pmviewer.scene.description import Geometry
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.meshes.displacement import MOST_TRIANGLES, Fractal, Height, Waves, displaced, n_displaced

FINEST = 4096


def displacement(p: Properties, geometry: Geometry) -> Geometry:
    """The shape's geometry, displaced if it has `displacement`. Raises SceneError."""
    texture = p.texture_properties("displacement")
    if texture is None:
        return geometry
    height = _height(texture)
    scale, offset = p.number("displacement_scale", 1.0), p.number("displacement_offset", 0.0)
    cuts = _between(p, "subdivision", 32, 1, FINEST)
    texture.warn_unused()
    document = p.document
    count = n_displaced(geometry, cuts)
    if document.displaced + count > MOST_TRIANGLES:
        what = (
            f"'displacement' of {p.element} would make {count:,} triangles, at most {MOST_TRIANGLES:,} in all are made."
        )
        raise document.error(what, p.element, "Use a smaller 'subdivision', or instances of one displaced shape.")
    document.displaced += count
    try:
        return displaced(geometry, height, scale, offset, cuts)
    except ValueError as error:
        raise p.document.error(f"'displacement' of {p.element}: {error}.", p.element) from None


def _height(p: Properties) -> Height:
    seed = _between(p, "seed", 0, 0, 1 << 30)
    if p.type == "fractal":
        octaves = _between(p, "octaves", 6, 1, 16)
        roughness = p.number("roughness", 0.5)
        if not 0 <= roughness <= 1:
            raise p.document.error(f"'roughness' of {p.element} must lie between 0 and 1.", p.element)
        return Fractal(octaves, roughness, _between(p, "frequency", 4, 1, 1 << 16), seed)
    if p.type == "waves":
        count, frequency, spread = (
            _between(p, "count", 24, 1, 100),
            p.number("frequency", 4.0),
            p.number("spread", 60.0),
        )
        if not 0 < frequency <= 1e4:
            raise p.document.error(f"'frequency' of {p.element} must be above 0 and at most 10000.", p.element)
        return Waves(count, frequency, spread, seed)
    hint = 'Use type="fractal" or type="waves".'
    raise p.document.error(f"{p.element} can't be a displacement.", p.element, hint)


def _between(p: Properties, name: str, default: int, least: int, most: int) -> int:
    value = p.integer(name, default)
    if not least <= value <= most:
        what = f"'{name}' of {p.element} must lie between {least} and {most}, found {value}."
        raise p.document.error(what, p.values.get(name, p.element))
    return value
