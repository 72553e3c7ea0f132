"""From radiance to the screen: exposure, tone curves, and how each view of a frame is shown.

The window draws the same curves on the graphics card (`shaders/picture.frag`); change both together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]
Curve = Literal["sRGB", "Reinhard", "filmic", "linear"]

MAGENTA = (1.0, 0.0, 1.0)
"""Colour of pixels that are not numbers: it appears in no tone-mapped grey, and nobody overlooks it."""
_BRIGHTEST = np.float32(1e15)
"""Exposed radiance is cut here, where every curve has long reached 1 and its square is still finite."""


@dataclass(frozen=True)
class DisplayImage:
    """`pixels` (h, w, 3) float32 in [0, 1], display-encoded. `bounds`: the values shown at the ends of a normalised
    view, in the view's unit, for its legend; None for views that aren't normalised."""

    pixels: Image
    bounds: tuple[float, float] | None = None


def srgb_encode(x: Image) -> Image:
    """The sRGB opto-electronic transfer function of IEC 61966-2-1, for x in [0, 1]."""
    curved = np.float32(1.055) * np.power(x, np.float32(1 / 2.4)) - np.float32(0.055)
    return np.where(x <= np.float32(0.0031308), np.float32(12.92) * x, curved).astype(np.float32)


def _filmic(x: Image) -> Image:
    """Narkowicz' fit of the ACES film curve ("ACES Filmic Tone Mapping Curve", 2015)."""
    a, b, c, d, e = (np.float32(v) for v in (2.51, 0.03, 2.43, 0.59, 0.14))
    return np.asarray(x * (a * x + b) / (x * (c * x + d) + e), np.float32)


def tone_map(image: NDArray[Any], exposure_ev: float, curve: Curve) -> Image:
    """Radiance (h, w, 3), (h, w, 1) or (h, w) to display-encoded (h, w, 3) float32 in [0, 1].

    The radiance is scaled by 2^exposure_ev first. sRGB: cut at 1. Reinhard: x/(1+x) per channel. filmic: see `_filmic`.
    All three are then sRGB-encoded. linear: cut at 1, nothing else. Negative values and NaN become 0, +inf becomes 1.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        x = _three_channels(image) * np.float32(2.0**exposure_ev)
        x = np.nan_to_num(np.clip(x, np.float32(0), _BRIGHTEST), copy=False, nan=0.0)
    if curve == "Reinhard":
        x = x / (np.float32(1) + x)
    elif curve == "filmic":
        x = _filmic(x)
    x = np.minimum(x, np.float32(1))
    return x if curve == "linear" else srgb_encode(x)


def to_uint8(image: Image) -> NDArray[np.uint8]:
    """[0, 1] to 0–255, halves rounded up; what lies outside is cut."""
    return (np.clip(image, 0, 1) * np.float32(255) + np.float32(0.5)).astype(np.uint8)


def depth_bounds(depth: NDArray[np.floating]) -> tuple[float, float]:
    """Nearest and farthest depth seen; a pixel that sees nothing has depth 0. (0, 1) when none sees anything."""
    seen = depth[np.isfinite(depth) & (depth > 0)]
    return (float(seen.min()), float(seen.max())) if seen.size else (0.0, 1.0)


def display_image(view: str, array: NDArray[np.floating], exposure: float = 0.0, curve: Curve = "sRGB") -> DisplayImage:
    """How a view of a frame is shown.

    Parameters
    ----------
    view: `beauty`, a term, `albedo` (sRGB-encoded, no exposure), `normal` (n/2 + 1/2) or `depth` (near is bright,
        nothing seen is black).
    array: (h, w, 3), or (h, w, 1) for depth.
    exposure, curve: as in `tone_map`, for radiance.

    Pixels with a value that is not finite are magenta.
    """
    broken = ~np.isfinite(array).all(axis=-1)
    bounds = None
    if view == "normal":
        n = np.nan_to_num(array, posinf=0.0, neginf=0.0).astype(np.float32)
        seen = np.any(n != 0, axis=-1, keepdims=True)
        pixels = np.where(seen, np.clip(n * np.float32(0.5) + np.float32(0.5), 0, 1), np.float32(0))
    elif view == "depth":
        bounds = depth_bounds(array)
        pixels = _three_channels(_depth_grey(array, bounds))
    elif view == "albedo":
        pixels = tone_map(array, 0.0, "sRGB")
    else:
        pixels = tone_map(array, exposure, curve)
    if broken.any():
        pixels = pixels.copy()
        pixels[broken] = MAGENTA
    return DisplayImage(np.ascontiguousarray(pixels, np.float32), bounds)


def _depth_grey(depth: NDArray[np.floating], bounds: tuple[float, float]) -> Image:
    near, far = bounds
    with np.errstate(invalid="ignore"):
        t = np.clip((depth - near) / max(far - near, 1e-30), 0, 1)
        return np.where(depth > 0, 1 - 0.9 * t, 0).astype(np.float32)


def _three_channels(image: NDArray[Any]) -> Image:
    if image.ndim == 2:
        image = image[..., None]
    if image.ndim != 3 or image.shape[2] not in (1, 3):
        raise ValueError(f"an image is (h, w), (h, w, 1) or (h, w, 3), not {image.shape}")
    return np.broadcast_to(image, (*image.shape[:2], 3)).astype(np.float32)
