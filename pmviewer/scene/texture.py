"""Mean colours of pictures: what stands in for textures, which are not supported yet."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.description import RGB

_SAMPLED = 64


def mean_colour(path: Path, raw: bool = False) -> RGB:
    """Mean linear RGB of a picture file; `raw` values are linear already, others are sRGB-encoded.

    Raises SceneError when the file is not a picture that Pillow can open.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            return mean_of_image(picture, raw)
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise SceneError(f"The texture can't be read: {error}.", path, hint="PNG and JPEG files can.") from None


def mean_of_image(picture: object, raw: bool = False) -> RGB:
    """Mean linear RGB of a Pillow image."""
    from PIL import Image

    assert isinstance(picture, Image.Image)
    # A small version is mean enough and keeps huge textures cheap.
    small = picture.convert("RGB")
    small.thumbnail((_SAMPLED, _SAMPLED), Image.Resampling.BOX)
    encoded = np.asarray(small, np.float64).reshape(-1, 3) / 255
    linear = encoded if raw else np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    r, g, b = (float(c) for c in linear.mean(axis=0))
    return (r, g, b)
