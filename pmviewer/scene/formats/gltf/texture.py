"""Textures of a glTF file: pictures in files, data URIs or buffers, with their samplers and transformations."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.gltf.buffers import Buffers, content
from pmviewer.scene.formats.gltf.document import Document, Json, extension, is_index
from pmviewer.scene.formats.gltf.ktx import is_ktx2, png_from_ktx2
from pmviewer.scene.formats.texture_file import read_alpha, read_picture
from pmviewer.scene.texture import RGB, Affine, Bitmap

Pixels = NDArray[np.float32]
WHITE: RGB = (1.0, 1.0, 1.0)
GREY = 0.5
"""What a colour that can't be read counts as: white would be too bright for most surfaces, and black is none."""
_NEAREST = 9728
_WRAP: dict[int, Literal["repeat", "mirror", "clamp"]] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
_SOURCES = ("EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds", "KHR_texture_basisu")
"""Extensions that name a picture beside or instead of the texture's own, in the order they are tried."""
_TRANSFORM = "KHR_texture_transform"


class GltfTextures:
    """Bitmaps of one file; each picture is decoded once for each use of it (colour, numbers, alpha)."""

    def __init__(self, document: Document, buffers: Buffers) -> None:
        self._document, self._buffers = document, buffers
        self._pictures: dict[tuple[int, str], Pixels | None] = {}
        self._bytes: dict[int, bytes] = {}

    def colour(self, info: Json | None, scale: RGB = WHITE) -> Bitmap | None:
        """The texture that a material refers to as linear colours; None when there is none. One that can't be read is
        grey, with a warning."""
        return self._bitmap(info, "colour", scale)

    def numbers(self, info: Json | None) -> Bitmap | None:
        """The texture as three numbers a pixel, None where it can't be read (with a warning) or there is none."""
        return self._bitmap(info, "raw", WHITE)

    def channel(self, info: Json | None, index: int) -> Bitmap | None:
        """One channel of the numbers, (h, w, 1)."""
        whole = self.numbers(info)
        if whole is None:
            return None
        index = min(index, whole.pixels.shape[2] - 1)
        return replace(whole, pixels=np.ascontiguousarray(whole.pixels[..., index : index + 1]))

    def alpha(self, info: Json | None) -> Bitmap | None:
        """The texture's alpha, (h, w, 1); None where there is none."""
        return self._bitmap(info, "alpha", WHITE)

    def _bitmap(self, info: Json | None, use: str, scale: RGB) -> Bitmap | None:
        if info is None:
            return None
        index = info.get("index")
        textures = self._document.rows("textures")
        if not is_index(index) or index is None or index >= len(textures):
            self._document.warn("Some textures are not in the file: they are left out.")
            return None
        texture = textures[index]
        found, source = self._first(texture, use)
        if found is None and use != "colour":
            return None
        if found is None:
            found = np.full((1, 1, 1), GREY, np.float32)
        sampler: Json = {}
        if "sampler" in texture:
            samplers = self._document.rows("samplers")
            number = texture["sampler"]
            sampler = samplers[number] if is_index(number) and number < len(samplers) else {}
        wrap, other = (_wrap(sampler.get(key)) for key in ("wrapS", "wrapT"))
        if wrap != other:
            self._document.warn("Textures repeat vertically as they do horizontally.")
        nearest = sampler.get("magFilter") == _NEAREST
        transform = self._transform(info)
        return Bitmap(found, wrap, "nearest" if nearest else "bilinear", transform, scale, f"image {source}")

    def _first(self, texture: Json, use: str) -> tuple[Pixels | None, int]:
        """The texture's picture, or that of an extension where it has none of its own that can be read."""
        candidates = [texture.get("source"), *(extension(texture, name).get("source") for name in _SOURCES)]
        images: list[int] = [i for i in candidates if is_index(i)]
        for image in images:
            pixels = self._picture(image, use)
            if pixels is not None:
                return pixels, image
        if not images:
            self._document.warn("Some textures name no picture: they are left out.")
        return None, images[0] if images else -1

    def _picture(self, index: int, use: str) -> Pixels | None:
        key = (index, use)
        if key in self._pictures:
            return self._pictures[key]
        name = f"image {index}"
        try:
            image = self._document.row("images", index, "a texture")
            name = str(image.get("name") or image.get("uri", name))[:80]
            name = "image in the file" if name.startswith("data:") else name
            data = self._encoded(image, index, name)
            if use == "alpha":
                self._pictures[key] = read_alpha(data, name)
            else:
                self._pictures[key], sentence = read_picture(data, name, use == "raw")
                if sentence:
                    self._document.warn(sentence)
        except SceneError as error:
            instead = "Grey replaces it." if use == "colour" else "It is left out."
            hint = f" {error.hint}" if "pmviewer[gltf]" in error.hint else ""
            self._document.warn(f"{error.what}{hint} {instead}", kind=f"texture {name} {instead}")
            self._pictures[key] = None
        return self._pictures[key]

    def _encoded(self, image: Json, index: int, name: str) -> bytes:
        """The picture file, as something that `read_picture` knows."""
        if index not in self._bytes:
            if image.get("uri") is None:
                data = self._buffers.view(image.get("bufferView"), f"image {index}")[0].tobytes()
            else:
                data = content(self._document, image["uri"], "The texture")
            self._bytes[index] = png_from_ktx2(data, name) if is_ktx2(data) else data
        return self._bytes[index]

    def _transform(self, info: Json) -> Affine:
        """KHR_texture_transform: scaled, turned against the clock as one looks at the picture, moved."""
        t = extension(info, _TRANSFORM)
        try:
            (x, y), (sx, sy) = t.get("offset", (0, 0)), t.get("scale", (1, 1))
            angle = float(t.get("rotation", 0))
            cos, sin = math.cos(angle), math.sin(angle)
            affine = (cos * sx, sin * sy, float(x), -sin * sx, cos * sy, float(y))
            if max(map(abs, affine)) < 1e6:
                return affine
        except (TypeError, ValueError, OverflowError):
            pass
        self._document.warn("A texture's transformation is not given by usable numbers: it is left out.")
        return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0)


def uv_set(info: Json | None) -> int:
    """Which of a mesh's texture coordinates the texture lies on."""
    info = info or {}
    number = extension(info, _TRANSFORM).get("texCoord", info.get("texCoord", 0))
    return int(number) if is_index(number) else 0


def _wrap(value: Any) -> Literal["repeat", "mirror", "clamp"]:
    return _WRAP.get(value, "repeat") if is_index(value) else "repeat"
