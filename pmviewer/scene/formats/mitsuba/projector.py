"""`projector`: a picture as the irradiance that it has on the plane at distance 1, and where the projector stands."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.description import Light, ProjectorLight
from pmviewer.scene.formats.mitsuba.camera import field_of_view, share_of_width
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.interface import bounded
from pmviewer.scene.formats.mitsuba.texture import constant, is_constant
from pmviewer.scene.formats.mitsuba.transform import Matrix, nearest_rotation
from pmviewer.scene.texture import Bitmap, Texture, evaluate

MOST_LINES = 4096
"""Columns, or rows, of a picture."""
REPLACED = 2048
"""Those of one that is sampled instead."""
_SHEAR = 1e-3

Float = NDArray[np.float64]


def read_projector(p: Properties, name: str) -> list[Light]:
    """The projector of an <emitter>; none, with a warning, where `to_world` is singular.

    On the plane at distance 1 Mitsuba's projector has π times `scale` times its `irradiance` on what faces its axis. A
    scale along z in `to_world` multiplies this, and those across widen the picture, as its direct light has it.
    """
    m = p.transform()
    irradiance = p.bounded_colour("irradiance", 1.0, None)
    factor = math.pi * bounded(p, "scale", p.number("scale", 1.0), 0.0, 1e30)
    picture = p.textures.get("irradiance") or constant(irradiance)
    fov, axis = field_of_view(p)
    height, width = picture.pixels.shape[:2] if isinstance(picture, Bitmap) else (1, 1)
    half = math.tan(math.radians(fov) / 2) * share_of_width(axis, width, height)
    placed = turned(p, m)
    if placed is None:
        return []
    turn, (across, up, ahead) = placed
    pixels, columns, rows = _lines(p, picture)
    with np.errstate(over="ignore"):
        pixels *= np.float32(factor * ahead)
    if not np.isfinite(pixels).all():
        raise p.document.error(f"'scale' of {p.element} makes irradiances too large.", p.values.get("scale", p.element))
    halves = (half * across / ahead, half * height / width * up / ahead)
    x, y, z = (float(c) for c in m[:3, 3])
    return [ProjectorLight(name, (x, y, z), turn, halves, pixels, columns, rows)]


def turned(p: Properties, m: Matrix) -> tuple[Matrix, Float] | None:
    """Rotation or mirroring of a light that throws a picture, and the scales along its axes; None with a warning where
    there is no such thing."""
    lengths = np.linalg.norm(m[:3, :3], axis=0)
    if not lengths.min() > 1e-12 * lengths.max() > 0:
        p.document.warn(f"{p.element} has no direction to shine in: it is left out.", p.element)
        return None
    axes = m[:3, :3] / lengths
    if np.abs(axes.T @ axes - np.eye(3)).max() > _SHEAR:
        p.document.warn(f"'to_world' of {p.element} shears: only its rotation is used.", p.values["to_world"])
        return nearest_rotation(m[:3, :3])[0], np.ones(3)
    return nearest_rotation(axes)[0], lengths


def _lines(p: Properties, texture: Texture) -> tuple[NDArray[np.float32], Float, Float]:
    """Lines between which the texture is bilinear: its values (h, w, 3) where they cross, columns (w,), rows (h,)."""
    a, b, c, d, e, f = texture.to_uv
    nearest = not (isinstance(texture, Bitmap) and texture.filter == "bilinear")
    columns = rows = np.array([0.0, 1.0])
    if not is_constant(texture):
        width, height = _fields(texture)
        if b != 0 or d != 0 or max(abs(a) * width, abs(e) * height) > MOST_LINES:
            why = "its 'to_uv' turns it" if b != 0 or d != 0 else f"it has more than {MOST_LINES:,} in a row or column"
            p.document.warn(f"The picture of {p.element} is shown as {REPLACED} × {REPLACED} pixels: {why}.", p.element)
            columns = rows = np.linspace(0.0, 1.0, REPLACED + 1)
            nearest = False
        else:
            shift = 0.0 if nearest else 0.5
            columns, rows = _edges(a * width, c * width - shift), _edges(e * height, f * height - shift)
    if not nearest:
        return _values(texture, columns, rows), columns, rows
    fields = _values(texture, (columns[:-1] + columns[1:]) / 2, (rows[:-1] + rows[1:]) / 2)
    return fields.repeat(2, axis=0).repeat(2, axis=1), columns.repeat(2)[1:-1], rows.repeat(2)[1:-1]


def _fields(texture: Texture) -> tuple[int, int]:
    """How many parts across and down a texture changes in."""
    if isinstance(texture, Bitmap):
        return texture.pixels.shape[1], texture.pixels.shape[0]
    return 2, 2


def _edges(slope: float, start: float) -> Float:
    """0, the places between at which start + slope·place is a whole number, and 1."""
    low, high = sorted((start, start + slope))
    whole = np.arange(math.ceil(low), math.floor(high) + 1)
    inside = (whole - start) / slope if slope != 0 else np.zeros(0)
    inside = np.sort(inside)
    return np.array([0.0, *inside[(inside > 1e-9) & (inside < 1 - 1e-9)], 1.0])


def _values(texture: Texture, columns: Float, rows: Float) -> NDArray[np.float32]:
    values = np.empty((len(rows), len(columns), 3), np.float32)
    for row, v in zip(values, rows, strict=True):
        row[:] = evaluate(texture, np.stack([columns, np.full(len(columns), v)], axis=1))
    return values
