"""Bytes of a glTF file: buffers in the file, beside it or in data URIs, and the views into them."""

from __future__ import annotations

import base64
import binascii
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.formats.gltf.compression import decode_meshopt
from pmviewer.scene.formats.gltf.document import Document, Json, extension, is_index
from pmviewer.scene.formats.open_file import read_regular

Bytes = NDArray[np.uint8]
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


def content(document: Document, uri: Any, what: str) -> bytes:
    """What a URI stands for. Raises SceneError for a file that is not there, naming it."""
    if not isinstance(uri, str):
        raise document.error(f"{what} has no file name.")
    if uri.startswith("data:"):
        head, _, body = uri.partition(",")
        try:
            return base64.b64decode(body) if head.endswith("base64") else unquote_to_bytes(body)
        except (ValueError, binascii.Error):
            raise document.error(f"{what} is not readable base64.") from None
    if "://" in uri:
        hint = "Download it, put it beside the scene file, and name it there."
        raise document.error(f"{what} lies at a web address, {uri[:200]!r}: nothing is downloaded.", hint=hint)
    hint = "Copy it beside the .gltf file, or export a .glb, which holds everything."
    missing = document.error(f"{what} {uri[:200]!r} does not exist.", hint=hint)
    for name in dict.fromkeys((unquote_to_bytes(uri).decode("utf-8", "replace"), uri)):
        file = document.path.parent / name.replace("\\", "/")
        try:
            if file.is_file():
                return read_regular(file, f"{what} {uri[:200]!r}")
        except ValueError:  # a name with a zero byte
            raise missing from None
    raise missing


class Buffers:
    """Buffers and their views, each read and decompressed once, when it is first asked for."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._whole: dict[int, Bytes] = {}
        self._views: dict[int, Bytes] = {}
        self._rebuilt = 0

    @property
    def rebuilt(self) -> int:
        """Bytes that decompression made so far."""
        return self._rebuilt

    def view(self, index: Any, who: str) -> tuple[Bytes, int | None]:
        """Bytes (n,) of a view and its stride, None where its elements follow each other."""
        row = self._document.row("bufferViews", index, who)
        packed = next((p for name in _MESHOPT if (p := extension(row, name))), None)
        if packed is not None:
            if index not in self._views:
                self._views[index] = self._unpacked(packed, index)
            stride = packed.get("byteStride") if packed.get("mode") == "ATTRIBUTES" else None
            return self._views[index], stride
        data = self._range(row, f"buffer view {index}")
        stride = row.get("byteStride")
        if stride is not None and (not is_index(stride) or stride > 1 << 16):
            raise self._document.error(f"Buffer view {index} has a stride of {str(stride)[:20]} bytes.")
        return data, stride

    def _range(self, row: Json, who: str) -> Bytes:
        """What a view, or the packed data of one, names: buffer, byteOffset, byteLength."""
        data = self._buffer(row.get("buffer", 0), who)
        start, length = row.get("byteOffset", 0), row.get("byteLength", 0)
        if not is_index(start) or not is_index(length) or start + length > len(data):
            what = f"{who.capitalize()} is {str(length)[:20]} bytes from {str(start)[:20]} on, "
            raise self._document.error(f"{what}but its buffer has {len(data)}.")
        return data[start : start + length]

    def _buffer(self, index: Any, who: str) -> Bytes:
        row = self._document.row("buffers", index, who)
        if index not in self._whole:
            uri, name = row.get("uri"), f"the file's buffer {index}"
            binary = self._document.binary
            data = binary if uri is None else content(self._document, uri, "The file's buffer")
            length = row.get("byteLength", len(data))
            if uri is None and not binary:
                raise self._document.error(f"{name.capitalize()} is not in the file.", "Export it again as .glb.")
            if not is_index(length) or length > len(data):
                what = f"{name.capitalize()} is cut off: {len(data)} of {str(length)[:20]} bytes are there."
                raise self._document.error(what, hint="Copy or export it again.")
            self._whole[index] = np.frombuffer(data, np.uint8)
        return self._whole[index]

    def _unpacked(self, packed: Json, index: int) -> Bytes:
        data = self._range(packed, f"buffer view {index}")
        try:
            result = decode_meshopt(data, packed)
        except SceneError as error:
            what = f"Buffer view {index}: {error.what}" if not error.hint else error.what
            raise self._document.error(what, hint=error.hint or DAMAGED_DATA) from None
        self._rebuilt += len(result)
        return result


DAMAGED_DATA = "The compressed data are damaged: export the file again."
