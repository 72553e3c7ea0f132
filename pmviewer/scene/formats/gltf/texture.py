"""Textures of a glTF file: pictures in files, data URIs or buffers, with their samplers and transformations."""

from __future__ import annotations

import base64
import math
from pathlib import Path
from typing import Any, Literal
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.texture_file import read_picture
from pmviewer.scene.texture import RGB, Affine, Bitmap

Json = dict[str, Any]
_NEAREST = 9728
_WRAP: dict[int, Literal["repeat", "mirror", "clamp"]] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}


class GltfTextures:
    """Bitmaps of one file; each picture is decoded once."""

    def __init__(self, header: Json, binary: bytes, path: Path, diagnostics: Diagnostics) -> None:
        self._header, self._binary, self._path, self._diagnostics = header, binary, path, diagnostics
        self._pictures: dict[tuple[int, bool], NDArray[np.float32] | None] = {}

    def bitmap(self, info: Json | None, raw: bool, scale: RGB = (1.0, 1.0, 1.0)) -> Bitmap | None:
        """The texture that a material refers to; None when there is none or it can't be read (with a warning)."""
        if info is None:
            return None
        if info.get("texCoord", 0) != 0:
            self._diagnostics.warn("Only the first set of texture coordinates is read: other textures lie on it too.")
        try:
            texture = self._header["textures"][info["index"]]
            pixels = self._picture(texture["source"], raw)
            sampler = self._header["samplers"][texture["sampler"]] if "sampler" in texture else {}
        except (KeyError, IndexError, TypeError):
            self._diagnostics.warn("Some textures are not in the file: they are left out.")
            return None
        if pixels is None:
            return None
        wrap = _WRAP.get(sampler.get("wrapS", 10497), "repeat")
        if sampler.get("wrapS", 10497) != sampler.get("wrapT", 10497):
            self._diagnostics.warn("Textures repeat vertically as they do horizontally.")
        nearest = sampler.get("magFilter") == _NEAREST
        return Bitmap(
            pixels, wrap, "nearest" if nearest else "bilinear", _transform(info), scale, f"image {texture['source']}"
        )

    def _picture(self, index: int, raw: bool) -> NDArray[np.float32] | None:
        key = (index, raw)
        if key not in self._pictures:
            name = f"image {index}"
            try:
                image = self._header["images"][index]
                name = str(image.get("name") or image.get("uri", name))[:80]
                name = "image in the file" if name.startswith("data:") else name
                self._pictures[key], sentence = read_picture(self._bytes(image), name, raw)
                if sentence:
                    self._diagnostics.warn(sentence)
            except (SceneError, OSError, KeyError, IndexError, TypeError, ValueError) as error:
                what = error.what if isinstance(error, SceneError) else f"The texture {name!r} can't be read."
                self._diagnostics.warn(f"{what} It is left out.")
                self._pictures[key] = None
        return self._pictures[key]

    def _bytes(self, image: Json) -> bytes:
        uri = image.get("uri")
        if uri is None:
            view = self._header["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            return self._buffer(view.get("buffer", 0))[start : start + view["byteLength"]]
        return self._content(uri)

    def _buffer(self, index: int) -> bytes:
        uri = self._header["buffers"][index].get("uri")
        return self._binary if uri is None else self._content(uri)

    def _content(self, uri: str) -> bytes:
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        file = self._path.parent / unquote(uri)
        if not file.is_file():
            raise SceneError(f"The texture {uri[:200]!r} does not exist.")
        return file.read_bytes()


def _transform(info: Json) -> Affine:
    """KHR_texture_transform: scaled, turned against the clock as one looks at the picture, moved."""
    t = info.get("extensions", {}).get("KHR_texture_transform", {})
    (x, y), (sx, sy), angle = t.get("offset", (0, 0)), t.get("scale", (1, 1)), float(t.get("rotation", 0))
    cos, sin = math.cos(angle), math.sin(angle)
    return (cos * sx, sin * sy, float(x), -sin * sx, cos * sy, float(y))
