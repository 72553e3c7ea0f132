"""The outside of a glTF file: GLB container, JSON, and its rows by kind and number, checked."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard

from pmviewer.errors import SceneError
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.open_file import read_regular

Json = dict[str, Any]
DAMAGED = "The file is damaged: export it again."
_GLB_JSON, _GLB_BIN = 0x4E4F534A, 0x004E4942
_LISTS = (
    "accessors", "animations", "buffers", "bufferViews", "cameras", "images", "materials", "meshes", "nodes",
    "samplers", "scenes", "skins", "textures",
)  # fmt: skip
_SINGULAR = {"accessors": "accessor", "bufferViews": "buffer view", "meshes": "mesh"}


@dataclass(frozen=True)
class Document:
    """JSON header and binary chunk of one file. All lists of `header` that glTF defines hold objects only."""

    header: Json
    binary: bytes
    path: Path
    diagnostics: Diagnostics

    def rows(self, kind: str) -> list[Json]:
        """All of "nodes", "meshes", …; empty if the file has none."""
        rows: list[Json] = self.header.get(kind, [])
        return rows

    def row(self, kind: str, index: Any, who: str) -> Json:
        """One of them, which `who` ("node 3") refers to. Raises SceneError if there is none."""
        rows = self.rows(kind)
        if not is_index(index) or index >= len(rows):
            one = _SINGULAR.get(kind, kind.removesuffix("s"))
            what = f"{who[:1].upper()}{who[1:]} refers to {one} {str(index)[:40]}, but the file has {len(rows)}."
            raise self.error(what)
        return rows[index]

    def extension(self, name: str) -> Json:
        """The file's own part of an extension; empty if it has none."""
        return extension(self.header, name)

    def error(self, what: str, hint: str = DAMAGED) -> SceneError:
        """The error to raise."""
        return self.diagnostics.error(what, hint=hint)

    def warn(self, sentence: str, kind: str | None = None) -> None:
        """Keep one warning per kind (the sentence itself if none is given)."""
        self.diagnostics.warn(sentence, kind=kind)


def is_index(value: Any) -> TypeGuard[int]:
    """A whole number from 0 on?"""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def extension(row: Json, name: str) -> Json:
    """An object's extension of this name; empty if it has none (or none that is an object)."""
    extensions = row.get("extensions")
    found = extensions.get(name) if isinstance(extensions, dict) else None
    return found if isinstance(found, dict) else {}


def has_extension(row: Json, name: str) -> bool:
    """Does the object have this extension, if only an empty one?"""
    extensions = row.get("extensions")
    return isinstance(extensions, dict) and isinstance(extensions.get(name), dict)


def name_of(row: Json, otherwise: str) -> str:
    """The object's name, for people."""
    return str(row.get("name") or otherwise)[:80]


def read_document(path: Path, diagnostics: Diagnostics) -> Document:
    """Open a .gltf or .glb file, whatever its ending says. Raises SceneError."""
    text, binary = _chunks(read_regular(path), diagnostics)
    try:
        header = json.loads(text)
    except (ValueError, RecursionError):
        raise diagnostics.error("This is not a glTF file (no readable JSON in it).", hint="Export it again.") from None
    asset = header.get("asset") if isinstance(header, dict) else None
    version = str(asset.get("version", "")) if isinstance(asset, dict) else ""
    if not version.startswith("2"):
        found = f"This is glTF {version[:10]}, expected 2.0." if version else "This is not a glTF 2.0 file."
        raise diagnostics.error(found, hint="Convert it to glTF 2.0.")
    for kind in _LISTS:
        rows = header.setdefault(kind, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise diagnostics.error(f"The file's '{kind}' are not a list of objects.", hint=DAMAGED)
    return Document(header, binary, path, diagnostics)


def _chunks(data: bytes, diagnostics: Diagnostics) -> tuple[bytes, bytes]:
    """JSON text and binary chunk of either kind of file."""
    if data[:4] != b"glTF":
        return data, b""
    if len(data) < 20:
        raise diagnostics.error("The GLB file is cut off.", hint="Export it again.")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise diagnostics.error(f"This is glTF version {version}, expected 2.", hint="Convert it to glTF 2.0.")
    if length > len(data):
        what = f"The GLB file is cut off: {len(data)} of {length} bytes are there."
        raise diagnostics.error(what, hint="Copy or export it again.")
    offset, text, binary = 12, b"", b""
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        chunk = data[offset + 8 : offset + 8 + size]
        if kind == _GLB_JSON and not text:
            text = chunk
        elif kind == _GLB_BIN and not binary:
            binary = chunk
        offset += 8 + size
    return text, binary
