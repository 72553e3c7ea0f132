"""`<texture type="bitmap">` of version 0.x to 3: its picture, and how it is looked up."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.mitsuba.texture_place import to_uv
from pmviewer.scene.formats.texture_file import read_picture
from pmviewer.scene.texture import Bitmap, Texture

if TYPE_CHECKING:
    from pmviewer.scene.formats.mitsuba.document import Properties

_LEFT_OUT = "Pictures that can't be used are left out, what they would colour keeps its default: {names}."
_CHANNELS = {"r": 0, "g": 1, "b": 2, "x": 0, "y": 1, "z": 2}
_WRAPS = ("repeat", "mirror", "clamp")
_FILTERS = {"bilinear": "bilinear", "nearest": "nearest", "trilinear": "bilinear", "ewa": "bilinear"}


def read_bitmap(p: Properties) -> Texture | None:
    """The texture; None for a picture that is missing or broken, which one warning lists."""
    raw, gamma = p.boolean("raw", False), p.number("gamma", 0.0)
    channel = p.string("channel", "").lower()
    wrap, filter, place = _wrap(p), _filter(p), to_uv(p)
    p.known("accel", "format", "cache", "max_anisotropy")
    name = p.string("filename", "")
    p.warn_unused()
    pixels = _picture(p, name, raw or gamma > 0, channel)
    if pixels is None:
        return None
    if gamma > 0 and gamma != 1 and not raw:
        pixels = np.maximum(pixels, np.float32(0)) ** np.float32(gamma)
    texture = Bitmap(pixels, wrap, filter, place, name=Path(name.replace("\\", "/")).name)
    return replace(texture, filter="nearest") if pixels.shape[:2] == (1, 1) else texture


def _picture(p: Properties, name: str, raw: bool, channel: str) -> NDArray[np.float32] | None:
    """Pixels of the file, read once, or None with a warning."""
    document = p.document
    try:
        if not name:
            raise SceneError("it names no file")
        path = document.file(name, p.element)
        key = (f"{path}\0{channel}", raw)
        if key not in document.pictures:
            pixels, sentence = read_picture(path, path.name, raw)
            if sentence:
                document.warn(sentence, p.element)
            document.pictures[key] = _channel(p, path, pixels, channel)
        return document.pictures[key]
    except SceneError as error:
        reason = "does not exist" if "does not exist" in error.what else error.what.rstrip(".")
        shown = name.replace("\\", "/")[-80:] or '<texture type="bitmap">'
        document.diagnostics.warn_of(f"{shown} ({reason[:160]})", _LEFT_OUT, p.element.line)
        return None


def _channel(p: Properties, path: Path, pixels: NDArray[np.float32], channel: str) -> NDArray[np.float32]:
    """One channel of the picture as grey if one is asked for (version 0.6)."""
    if channel in ("", "all"):
        return pixels
    if channel == "a":
        return _alpha(path, pixels)
    if channel in _CHANNELS:
        return np.ascontiguousarray(pixels[..., [min(_CHANNELS[channel], pixels.shape[2] - 1)]])
    p.document.warn(f"'channel' of {p.element}: '{channel[:40]}' is not known, all are used.", p.element)
    return pixels


def _alpha(path: Path, pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """Opacity of the picture's pixels, (h, w, 1); 1 where the file has none."""
    from PIL import Image

    try:
        with Image.open(BytesIO(path.read_bytes())) as picture:
            levels = picture.convert("RGBA").getchannel("A").resize((pixels.shape[1], pixels.shape[0]))
            return (np.asarray(levels, np.float32) / np.float32(255))[..., None]
    except Exception:  # OpenEXR and what else Pillow does not open
        return np.ones((*pixels.shape[:2], 1), np.float32)


def _wrap(p: Properties) -> Literal["repeat", "mirror", "clamp"]:
    both = p.string("wrap_mode", "repeat").lower()
    u, v = p.string("wrap_mode_u", both).lower(), p.string("wrap_mode_v", both).lower()
    if u != v:
        p.document.warn(f"{p.element} continues along v as it does along u.", p.element)
    if u not in _WRAPS:
        at = p.values.get("wrap_mode", p.values.get("wrap_mode_u", p.element))
        instead = "clamp" if u in ("zero", "one", "black", "white") else "repeat"
        p.document.warn(f"'wrap_mode' of {p.element}: '{u[:40]}' is not supported, it is taken as {instead}.", at)
        return instead  # type: ignore[return-value]
    return u  # type: ignore[return-value]


def _filter(p: Properties) -> Literal["bilinear", "nearest"]:
    word = p.string("filter_type", "bilinear").lower()
    if word not in ("bilinear", "nearest"):
        sentence = "Textures are looked up bilinearly where the file asks for 'trilinear', 'ewa' or another filter."
        p.document.warn(sentence, p.values["filter_type"])
    return _FILTERS.get(word, "bilinear")  # type: ignore[return-value]
