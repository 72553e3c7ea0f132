"""Textures as loaders describe them, and their value at texture coordinates, in NumPy.

Conventions are Mitsuba 3's: row 0 of a bitmap lies at v = 0, texel (i, j) has its centre at ((i + ½)/width,
(j + ½)/height), and `to_uv` maps a surface's coordinates to the texture's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

RGB = tuple[float, float, float]
Float = NDArray[np.float64]

Affine = tuple[float, float, float, float, float, float]
"""u' = a u + b v + c, v' = d u + e v + f."""
IDENTITY: Affine = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Relative luminance of linear sRGB primaries (Rec. 709)."""


@dataclass(frozen=True, eq=False)
class Bitmap:
    """`pixels` (h, w, 1 or 3) float32, linear, times `scale`."""

    pixels: NDArray[np.float32]
    wrap: Literal["repeat", "mirror", "clamp"] = "repeat"
    filter: Literal["bilinear", "nearest"] = "bilinear"
    to_uv: Affine = IDENTITY
    scale: RGB = (1.0, 1.0, 1.0)
    name: str = "bitmap"

    @property
    def mean(self) -> RGB:
        """Mean linear RGB of the picture."""
        columns = self.pixels.sum(axis=0, dtype=np.float64)  # along rows first: a ninth of the time of both at once
        mean = np.resize(columns.mean(axis=0) / len(self.pixels), 3)
        r, g, b = (float(m) * s for m, s in zip(mean, self.scale))
        return (r, g, b)


@dataclass(frozen=True, eq=False)
class Checkerboard:
    """Two by two fields in [0, 1)², repeated: `color0` where both coordinates are in the same half, else `color1`."""

    color0: RGB = (0.4, 0.4, 0.4)
    color1: RGB = (0.2, 0.2, 0.2)
    to_uv: Affine = IDENTITY
    name: str = "checkerboard"

    @property
    def mean(self) -> RGB:
        """Mean linear RGB."""
        r, g, b = ((x + y) / 2 for x, y in zip(self.color0, self.color1))
        return (r, g, b)


Texture = Bitmap | Checkerboard

SLOTS = (
    "reflectance", "specular_reflectance", "alpha", "alpha_across", "transmittance", "normal", "bump", "opacity",
    "weight", "metallic",
)  # fmt: skip
"""What a material's texture can give: colours, roughness (its luminance; `alpha` is that along the tangent where there
is `alpha_across`, which principled materials don't have), a tangent-space normal as (n + 1) / 2, a height in scene
units (its luminance), or one of the numbers of that name (its luminance)."""


def scaled(texture: Texture, factor: RGB) -> Texture:
    """The texture times a colour."""
    if isinstance(texture, Bitmap):
        return replace(texture, scale=_times(texture.scale, factor))
    return replace(texture, color0=_times(texture.color0, factor), color1=_times(texture.color1, factor))


def _times(a: RGB, b: RGB) -> RGB:
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


def limited(texture: Texture, most: float | None) -> tuple[Texture, str]:
    """The texture with values between 0 and `most`, and a sentence if some were outside ("" if not)."""
    sentence = ""
    if isinstance(texture, Checkerboard):
        if most is None or max(*texture.color0, *texture.color1) <= most:
            return texture, ""
        a, b = ((min(r, most), min(g, most), min(b, most)) for r, g, b in (texture.color0, texture.color1))
        return replace(texture, color0=a, color1=b), f"values above {most:g} were cut: they would create energy."
    pixels = texture.pixels
    if pixels.min() < 0:
        pixels = np.maximum(pixels, np.float32(0))
        sentence = "the texture's negative values were cut."
    if most is not None and pixels.max() * max(texture.scale) > most:
        pixels = np.minimum(pixels, np.float32(most / max(texture.scale)))
        sentence = f"values above {most:g} were cut: they would create energy."
    return (replace(texture, pixels=pixels), sentence) if sentence else (texture, "")


def evaluate(texture: Texture, uv: Float) -> Float:
    """Linear RGB (n, 3) at texture coordinates (n, 2)."""
    a, b, c, d, e, f = texture.to_uv
    u, v = a * uv[:, 0] + b * uv[:, 1] + c, d * uv[:, 0] + e * uv[:, 1] + f
    if isinstance(texture, Checkerboard):
        same = (u - np.floor(u) > 0.5) == (v - np.floor(v) > 0.5)
        return np.where(same[:, None], texture.color0, texture.color1)
    height, width = texture.pixels.shape[:2]
    x, y = u * width, v * height
    if texture.filter == "bilinear":
        x, y = x - 0.5, y - 0.5
    i, j = np.floor(x), np.floor(y)

    def texel(di: int, dj: int) -> Float:
        column, row = _wrapped(i + di, width, texture.wrap), _wrapped(j + dj, height, texture.wrap)
        return np.broadcast_to(texture.pixels[row, column], (len(uv), texture.pixels.shape[2])).astype(float)

    value = texel(0, 0)
    if texture.filter == "bilinear":
        s, t = (x - i)[:, None], (y - j)[:, None]
        value = (1 - t) * ((1 - s) * value + s * texel(1, 0)) + t * ((1 - s) * texel(0, 1) + s * texel(1, 1))
    return np.broadcast_to(value, (len(uv), 3)) * texture.scale


def _wrapped(index: Float, size: int, wrap: str) -> NDArray[np.int64]:
    """Texel numbers in 0 … size − 1."""
    k = index.astype(np.int64)
    if wrap == "clamp":
        return np.clip(k, 0, size - 1)
    if wrap == "repeat":
        return k % size
    k = k % (2 * size)
    return np.minimum(k, 2 * size - 1 - k)
