"""Picture files as linear float32 pixels: OpenEXR, Radiance HDR, PFM, PNG, JPEG and whatever else Pillow opens."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.resources import available_memory
from pmviewer.scene.formats.open_file import read_regular
from pmviewer.scene.formats.pfm import decode_pfm, is_pfm

MOST_PIXELS = 1 << 24
"""A larger picture is reduced by whole factors: 4096 × 4096, 200 MB of texels."""
_MOST_SIDE = 1 << 16
_READABLE = "PNG, JPEG, OpenEXR and Radiance HDR files can."


def read_picture(source: Path | bytes, name: str, raw: bool) -> tuple[NDArray[np.float32], str]:
    """Pixels (h, w, 1 or 3), finite and linear, and a sentence if the picture had to be changed ("" if not).

    `source` is a file or its content. `raw` values are taken as they are; others are decoded from sRGB, unless the file
    holds floats. Raises SceneError for what is not a whole picture or does not fit into memory.
    """
    data = _content(source, name)
    if data[:4] == b"\x76\x2f\x31\x01":
        pixels = _exr(source, data, name)
    elif data[:2] == b"#?":
        pixels = _hdr(data, name)
    elif is_pfm(data):
        pixels = decode_pfm(data, name)
    else:
        pixels = _encoded(data, name, partial(_samples, raw=raw))
    return _finished(pixels, name)


def read_opacity(source: Path | bytes, name: str) -> tuple[NDArray[np.float32], str]:
    """Pixels (h, w, 1 or 3) that say how opaque a surface is: the picture's alpha channel where it has one that isn't
    the same all over, else its values as they are. Otherwise as `read_picture`."""
    data = _content(source, name)
    if data[:4] == b"\x76\x2f\x31\x01" or data[:2] == b"#?":
        return read_picture(data, name, raw=True)
    return _finished(_encoded(data, name, _opacity), name)


def _content(source: Path | bytes, name: str) -> bytes:
    if isinstance(source, bytes):
        data = source
    else:
        try:
            data = read_regular(source, f"The texture {name!r}")
        except SceneError as error:
            raise SceneError(error.what, hint=_READABLE) from None
    if not data:
        raise SceneError(f"The texture {name!r} is empty (0 bytes).", hint="Export it again.")
    return data


def _finished(pixels: NDArray[np.float32], name: str) -> tuple[NDArray[np.float32], str]:
    """The pixels finite and not too many, and a sentence if they had to be changed."""
    if not pixels.size:
        raise SceneError(f"The texture {name!r} has no pixels.", hint="Export it again.")
    sentence = ""
    height, width = pixels.shape[:2]
    factor = 1
    while (width // factor) * (height // factor) > MOST_PIXELS:
        factor += 1
    if factor > 1:
        pixels = _reduced(pixels, factor)
        now = f"{pixels.shape[1]} × {pixels.shape[0]}"
        sentence = f"The texture '{name}' of {width} × {height} pixels was reduced to {now}."
    good = np.isfinite(pixels)
    if not good.all():
        sentence = f"The texture '{name}' has pixels that are not finite: black replaces them."
        pixels = np.where(good, pixels, np.float32(0))
    return np.ascontiguousarray(pixels, np.float32), sentence


def _reduced(pixels: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    """Means of blocks of `factor` × `factor` pixels; what is left over at the far edges is cut."""
    h, w, c = pixels.shape
    rows, columns = max(1, h // factor), max(1, w // factor)
    down, across = min(factor, h), min(factor, w)
    blocks = pixels[: rows * down, : columns * across].reshape(rows, down, columns, across, c)
    return blocks.mean(axis=(1, 3), dtype=np.float32)


def _check_memory(width: int, height: int, name: str) -> None:
    available = available_memory()
    needed = width * height * 32  # decoded bytes, float32 RGB and one copy of it
    if available is not None and needed > available:
        sizes = f"needs about {needed / 1e9:.1f} GB of memory and {available / 1e9:.1f} GB are free"
        raise SceneError(f"The texture {name!r} of {width} × {height} pixels {sizes}.", hint="Use a smaller picture.")


def _exr(source: Path | bytes, data: bytes, name: str) -> NDArray[np.float32]:
    from pmviewer.output.exr import BEAUTY, decode_exr

    try:
        image = decode_exr(data, source if isinstance(source, Path) else None)[0].get(BEAUTY)
    except SceneError as error:
        raise SceneError(f"The texture {name!r} can't be read: {error.what}", hint="Export it again.") from None
    if image is None or image.shape[2] == 2:
        raise SceneError(f"The texture {name!r} has no channels R, G, B or Y.")
    return image[..., :3]


def _hdr(data: bytes, name: str) -> NDArray[np.float32]:
    from pmviewer.scene.formats.hdr import decode_hdr

    try:
        return decode_hdr(data)
    except SceneError as error:
        raise SceneError(f"The texture {name!r}: {error.what}", hint=error.hint) from None


def _encoded(data: bytes, name: str, values: Callable[[Any], NDArray[np.float32]]) -> NDArray[np.float32]:
    """What `values` makes of the opened picture."""
    from PIL import Image

    try:
        with Image.open(BytesIO(data)) as picture:
            width, height = picture.size
            if max(width, height) > _MOST_SIDE:
                raise SceneError(
                    f"The texture {name!r} has {width} × {height} pixels: too many.", hint="Use a smaller picture."
                )
            _check_memory(width, height, name)
            return values(picture)
    except SceneError:
        raise
    except Exception:  # damaged pictures make the decoders raise anything
        what = f"The texture {name!r} can't be read: it is damaged, or no picture of a known kind."
        raise SceneError(what, hint=_READABLE) from None


def read_alpha(data: bytes, name: str) -> NDArray[np.float32] | None:
    """The picture's alpha (h, w, 1) from 0 to 1, or None where it has none. Raises SceneError as `read_picture`."""
    values = _encoded(data, name, _alpha)
    return _finished(values, name)[0] if values.size else None


def _alpha(picture: Any) -> NDArray[np.float32]:
    """(h, w, 1) from 0 to 1; empty for a picture without alpha."""
    if "A" not in picture.getbands() and "transparency" not in picture.info:
        return np.empty((0, 0, 1), np.float32)
    return np.asarray(picture.convert("RGBA").getchannel("A"), np.float32)[..., None] / np.float32(255)


def _samples(picture: Any, raw: bool) -> NDArray[np.float32]:
    """(h, w, 1 or 3) in [0, 1], decoded from sRGB unless `raw`; alpha is dropped, palettes are looked up."""
    if picture.mode.startswith("I"):  # 16 bits of grey, which Pillow widens to 32
        values = np.asarray(picture, np.float32)[..., None] / np.float32(65535)
        return values if raw else linear(values)
    if picture.mode == "F":
        return np.asarray(picture, np.float32)[..., None]  # floats are linear already
    grey = picture.mode in ("1", "L", "LA")
    steps = np.arange(256, dtype=np.float32) / np.float32(255)
    eight_bits = (steps if raw else linear(steps))[np.asarray(picture.convert("L" if grey else "RGB"))]
    return eight_bits[..., None] if grey else eight_bits


def _opacity(picture: Any) -> NDArray[np.float32]:
    if "A" in picture.getbands() or "transparency" in picture.info:
        alpha = _alpha(picture)
        if alpha.min() < alpha.max():
            return alpha
    return _samples(picture, raw=True)


def linear(encoded: NDArray[np.float32]) -> NDArray[np.float32]:
    """sRGB-encoded values as linear ones (IEC 61966-2-1)."""
    low = encoded <= np.float32(0.04045)
    high = ((encoded + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(low, encoded / np.float32(12.92), high)
