"""PNG files."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, PngImagePlugin

from pmviewer.errors import SceneError
from pmviewer.output.files import read_file, write_file
from pmviewer.output.tone import to_uint8

COMPRESSION = 1
"""Deflate level: renders barely shrink further at higher ones, but take several times as long."""


def write_png(path: str | Path, image: NDArray[Any], metadata: Mapping[str, str] | None = None) -> None:
    """Write (h, w), (h, w, 1), (h, w, 3) or (h, w, 4); uint8, or float in [0, 1], display-encoded.

    `metadata` becomes text chunks (keys: 1–79 Latin-1 characters). Raises OutputError; the old file then stays.
    """
    write_file(path, encode_png(image, metadata), (".png",))


def encode_png(image: NDArray[Any], metadata: Mapping[str, str] | None = None) -> bytes:
    """The bytes of the file that `write_png` writes."""
    if image.dtype != np.uint8:
        image = to_uint8(np.asarray(image, np.float32))
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[..., 0]
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] in (3, 4))) or image.size == 0:
        raise ValueError(f"an image is (h, w), (h, w, 3) or (h, w, 4), not {image.shape}")
    texts = PngImagePlugin.PngInfo()
    for key, value in (metadata or {}).items():
        texts.add_text(key, value)
    buffer = io.BytesIO()
    picture = Image.fromarray(np.ascontiguousarray(image))
    picture.save(buffer, "PNG", compress_level=COMPRESSION, pnginfo=texts)
    return buffer.getvalue()


def read_png(path: str | Path) -> tuple[NDArray[np.uint8], dict[str, str]]:
    """Pixels (h, w) or (h, w, 3 or 4) uint8, and the text chunks. Raises SceneError for anything but a whole PNG."""
    data = read_file(path)
    try:
        with Image.open(io.BytesIO(data), formats=("PNG",)) as picture:
            texts = {str(key): str(value) for key, value in getattr(picture, "text", {}).items()}
            if picture.mode not in ("L", "RGB", "RGBA"):
                picture = picture.convert("RGBA")  # type: ignore[assignment]
            return np.array(picture, np.uint8), texts
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise SceneError(f"This is not a whole PNG file ({error}).", path) from None
