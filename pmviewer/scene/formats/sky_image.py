"""Pictures of the sky: OpenEXR, Radiance HDR, PFM, PNG, JPEG as linear radiance."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.output.exr import BEAUTY, read_exr
from pmviewer.scene.formats.hdr import read_hdr
from pmviewer.scene.formats.open_file import open_regular
from pmviewer.scene.formats.pfm import decode_pfm

LEAST_WIDTH, LEAST_HEIGHT = 2, 3
MOST_PIXELS = 1 << 27
LARGEST_RADIANCE = 1e30


def read_sky(path: Path) -> tuple[NDArray[np.float32], int]:
    """Linear RGB (h, w, 3), and how many of its numbers were negative or not finite and are 0 now.

    8-bit pictures are decoded from sRGB, those of less than 2 × 3 pixels continued. Raises SceneError for what is no
    such picture.
    """
    open_regular(path, "It")[0].close()
    ending = path.suffix.lower()
    if ending == ".exr":
        pixels = _exr(path)
    elif ending in (".hdr", ".rgbe", ".pic"):
        pixels = read_hdr(path)
    elif ending == ".pfm":
        pixels = _pfm(path)
    else:
        pixels = _encoded(path)
    height, width = pixels.shape[:2]
    if not width * height:
        raise SceneError("The picture has no pixels.", path)
    if width < LEAST_WIDTH or height < LEAST_HEIGHT:
        # The last column and row again, as Mitsuba does.
        wider = (0, max(0, LEAST_HEIGHT - height)), (0, max(0, LEAST_WIDTH - width)), (0, 0)
        pixels = np.pad(pixels, wider, mode="edge")
    with np.errstate(invalid="ignore"):
        usable = (pixels >= 0) & (pixels <= LARGEST_RADIANCE)
    return np.ascontiguousarray(np.where(usable, pixels, 0), np.float32), int((~usable).sum())


def _exr(path: Path) -> NDArray[np.float32]:
    layers, _ = read_exr(path)
    if BEAUTY not in layers or layers[BEAUTY].shape[2] not in (1, 3, 4):
        raise SceneError("The file has no channels R, G, B or Y.", path)
    pixels = layers[BEAUTY][:, :, :3]
    return np.broadcast_to(pixels, (*pixels.shape[:2], 3))


def _pfm(path: Path) -> NDArray[np.float32]:
    try:
        pixels = decode_pfm(path.read_bytes(), path.name)
    except OSError as error:
        raise SceneError(f"It can't be read: {error.strerror}.", path) from None
    return np.broadcast_to(pixels, (*pixels.shape[:2], 3))


def _encoded(path: Path) -> NDArray[np.float32]:
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            if picture.width * picture.height > MOST_PIXELS:
                raise SceneError(f"The picture has {picture.width} × {picture.height} pixels: too many.", path)
            if picture.mode == "F":
                return np.repeat(np.asarray(picture, np.float32)[..., None], 3, axis=2)
            if picture.mode.startswith("I"):
                raise SceneError("Pictures of 16 or 32 bits a pixel can't be read.", path, hint="Save it as OpenEXR.")
            encoded = np.asarray(picture.convert("RGB"))
    except UnidentifiedImageError:
        raise SceneError("It is no kind of picture that is known.", path) from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        hint = "OpenEXR, Radiance HDR, PFM, PNG and JPEG files can be read."
        raise SceneError(f"It can't be read: {error}.", path, hint=hint) from None
    levels = np.arange(256) / 255
    linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4).astype(np.float32)
    return linear[encoded]
