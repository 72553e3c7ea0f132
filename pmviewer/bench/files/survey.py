"""What kind of file is this, and is all there that it names? Asked of the files' own texts, not of our readers.

A quota of files that open means nothing where half of them lack their meshes, or are no scenes at all. So each file is
put into one of `STATES` by reading just enough of it.
"""

from __future__ import annotations

import json
import os
import re
import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

ENDINGS = (".xml", ".gltf", ".glb", ".obj", ".ply", ".stl")
STATES = {
    "complete": "a scene or mesh, and all files that it names are there",
    "incomplete": "names files that are not there, or parameters without values",
    "fragment": "a piece of a scene, without a <scene> of its own",
    "part": "named by another file of the folder",
    "foreign": "another program's format, or nothing that has a surface",
    "broken": "not even well-formed",
    "absent": "a pointer of git LFS in the file's place",
}
OBJECTS = {"scene", "shape", "bsdf", "emitter", "sensor", "integrator", "texture", "film", "medium", "sampler", "phase",
           "rfilter", "spectrum", "luminaire", "camera", "subsurface", "volume"}  # fmt: skip
NOT_READ = {"film", "integrator", "sampler", "rfilter", "subsurface"}
"""Elements whose file names are outputs, or caches that renderers make themselves."""
NAMED_ENDINGS = {".obj", ".ply", ".stl", ".serialized", ".xml", ".png", ".jpg", ".jpeg", ".exr", ".hdr", ".tga", ".bmp",
                 ".rgbe", ".pfm", ".spd", ".vol", ".hair", ".gif", ".bsdf", ".eta"}  # fmt: skip
_TRIANGLES = (4, 5, 6)
"""Modes of glTF's primitives: triangles, strips and fans."""
MOST_INCLUDES = 200
MOST_TEXT = 64 << 20
_INDENT = 64
"""Blanks that may stand before a statement of OBJ."""
LFS = b"version https://git-lfs"


@dataclass
class Survey:
    """`names`: files that are named and there; `missing`: what is named and isn't."""

    state: str = "complete"
    why: str = ""
    names: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        """For JSON, as `--json` keeps it."""
        return asdict(self)


class _Odd(Exception):
    """What a file is instead; (state, why)."""


def survey(path: Path) -> Survey:
    """Never raises; a file that can't be read is "broken"."""
    found = Survey()
    try:
        with path.open("rb") as stream:
            if stream.read(len(LFS)) == LFS:
                return Survey("absent", "a pointer of git LFS")
        _BY_ENDING[path.suffix.lower()](path, found)
    except _Odd as odd:
        found.state, found.why = odd.args
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError, RecursionError, struct.error,
            ElementTree.ParseError) as error:  # fmt: skip
        found.state, found.why = "broken", str(error)[:200]
    if found.state == "complete" and found.missing:
        found.state = "incomplete"
        found.why = f"{len(found.missing)} of what it names is missing: {', '.join(found.missing[:3])}"
    return found


def _name(found: Survey, text: str, folders: list[Path]) -> Path | None:
    """Note a named file as there or missing."""
    for folder in folders:
        place = Path(os.path.normpath(folder / text.replace("\\", "/")))
        if place.is_file():
            with place.open("rb") as stream:
                if stream.read(len(LFS)) == LFS:
                    break
            if str(place) not in found.names:
                found.names.append(str(place))
            return place
    if text not in found.missing:
        found.missing.append(text)
    return None


def _mitsuba(path: Path, found: Survey) -> None:
    root = ElementTree.parse(path).getroot()
    if root.tag != "scene":
        if root.tag in OBJECTS:
            raise _Odd("fragment", f"its root is <{root.tag}>")
        raise _Odd("foreign", f"its root is <{root.tag[:60]}>")
    if "version" not in root.attrib:
        raise _Odd("foreign", "its <scene> has no version")
    folders, values = [path.parent], dict[str, str]()
    waiting, seen = [root], 0
    has_shape = False
    while waiting and seen <= MOST_INCLUDES:
        tree = waiting.pop(0)
        seen += 1
        has_shape = has_shape or tree.tag == "shape" or next(tree.iter("shape"), None) is not None
        for element in tree.iter("default"):
            values.setdefault(element.get("name", ""), element.get("value", ""))
        for element in tree.iter("path"):
            folders.append(path.parent / _substituted(element.get("value", "").replace("\\", "/"), values, found))
        for text, is_include in _texts(tree):
            place = _name(found, _substituted(text, values, found), folders)
            if is_include and place is not None:
                waiting.append(ElementTree.parse(place).getroot())
    if not has_shape and not found.missing:
        raise _Odd("foreign", "has no <shape>")


def _texts(tree: ElementTree.Element) -> list[tuple[str, bool]]:
    """File names in an XML tree, and whether they are of <include>."""
    found: list[tuple[str, bool]] = []
    stack = [tree]
    while stack:
        element = stack.pop()
        if element.tag in NOT_READ:
            continue
        if element.tag == "include":
            found.append((element.get("filename", ""), True))
        elif element.tag == "string" and element.get("name") in ("filename", "nested_filename"):
            found.append((element.get("value", ""), False))
        elif element.tag == "spectrum" and element.get("filename"):
            found.append((element.get("filename", ""), False))
        elif Path(element.get("filename", "")).suffix.lower() in NAMED_ENDINGS:
            found.append((element.get("filename", ""), False))
        stack.extend(reversed(list(element)))
    return found


def _substituted(text: str, values: dict[str, str], found: Survey) -> str:
    for name in sorted(values, key=len, reverse=True):
        if name:
            text = text.replace(f"${name}", values[name])
    if match := re.search(r"\$\w+", text):
        found.missing.append(f"a value for {match[0]}")
    return text


def _gltf(path: Path, found: Survey) -> None:
    _gltf_document(json.loads(path.read_bytes()[:MOST_TEXT].decode("utf-8-sig")), path, found)


def _glb(path: Path, found: Survey) -> None:
    with path.open("rb") as stream:
        magic, version, _ = struct.unpack("<4sII", stream.read(12))
        if magic != b"glTF":
            raise _Odd("broken", "does not begin with glTF")
        if version != 2:
            raise _Odd("foreign", f"glTF of version {version}")
        length, _ = struct.unpack("<II", stream.read(8))
        _gltf_document(json.loads(stream.read(min(length, MOST_TEXT)).decode("utf-8")), path, found)


def _gltf_document(document: dict[str, Any], path: Path, found: Survey) -> None:
    version = str(document.get("asset", {}).get("version", "1.0"))
    if not version.startswith("2"):
        raise _Odd("foreign", f"glTF of version {version}")
    for entry in [*document.get("buffers", []), *document.get("images", [])]:
        uri = entry.get("uri")
        if uri is not None and not uri.startswith("data:"):
            _name(found, unquote(uri), [path.parent])
    for number, entry in enumerate(document.get("buffers", [])):
        first_of_glb = number == 0 and path.suffix.lower() == ".glb"
        if not (first_of_glb or "uri" in entry or entry.get("extensions")):
            found.missing.append(f"the bytes of buffer {number}")
    if not document.get("meshes"):
        raise _Odd("foreign", "has no meshes")
    modes = [part.get("mode", 4) for mesh in document["meshes"] for part in mesh.get("primitives", [])]
    if modes and not any(mode in _TRIANGLES for mode in modes):
        raise _Odd("foreign", "has no triangles")


def _obj(path: Path, found: Survey) -> None:
    data = path.read_bytes()
    if not all(any(_lines_of(data, word)) for word in (b"v", b"f")):
        raise _Odd("foreign", "has no faces")
    for rest in _lines_of(data, b"mtllib"):
        place = _library(found, rest.decode("utf-8", "replace").strip(), path.parent)
        if place is not None:
            _mtl(place, found)


def _lines_of(data: bytes, word: bytes) -> Iterator[bytes]:
    """What follows the word in the lines that begin with it, found without looking at each line: scenes have gigabytes
    of them."""
    at = -1
    while (at := data.find(word, at + 1)) >= 0:
        before = data[max(at - _INDENT, 0) : at]
        begun = re.search(rb"(?:^|[\r\n])[ \t]*$" if at <= _INDENT else rb"[\r\n][ \t]*$", before)
        if begun and data[at + len(word) : at + len(word) + 1] in (b" ", b"\t"):
            yield _rest(data, at + len(word))


def _rest(data: bytes, at: int) -> bytes:
    """The rest of the line."""
    end = data.find(b"\n", at)
    return data[at : end if end >= 0 else len(data)]


def _library(found: Survey, text: str, folder: Path) -> Path | None:
    whole = (folder / text.replace("\\", "/")).is_file()
    names = [text] if whole or " " not in text else text.split()
    places = [_name(found, name, [folder]) for name in names]
    return places[0]


def _mtl(path: Path, found: Survey) -> None:
    for line in path.read_bytes()[:MOST_TEXT].decode("utf-8", "replace").splitlines():
        words = line.split()
        if words and words[0].lower() in (
            "map_kd",
            "map_ka",
            "map_ks",
            "map_ke",
            "map_d",
            "map_bump",
            "bump",
            "map_ns",
        ):
            rest = line.split(None, 1)[1].strip() if len(words) > 1 else ""
            # Options before the name ("-bm 0.2 file name.png") are of single words.
            name = rest if not rest.startswith("-") else words[-1]
            if name:
                _name(found, name, [path.parent])


def _ply(path: Path, found: Survey) -> None:
    with path.open("rb") as stream:
        head = stream.read(1 << 16)
    end = head.find(b"end_header")
    if not head.startswith(b"ply") or end < 0:
        raise _Odd("broken", "has no PLY header")
    counts = {
        m[1].decode("ascii", "replace"): int(m[2]) for m in re.finditer(rb"(?m)^element\s+(\S+)\s+(\d+)", head[:end])
    }
    if not (counts.get("face") or counts.get("tristrips")):
        raise _Odd("foreign", "has no faces")


def _stl(path: Path, found: Survey) -> None:
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(84)
        begin = head + stream.read(1 << 16)
    if len(head) == 84 and 84 + 50 * struct.unpack("<I", head[80:])[0] == size:
        if size == 84:
            raise _Odd("foreign", "has no faces")
        return
    if not head.lstrip().lower().startswith(b"solid"):
        if len(head) < 84 or struct.unpack("<I", head[80:])[0] * 50 + 84 > size:
            raise _Odd("broken", "is shorter than its header says")
    elif b"facet" not in begin.lower():
        raise _Odd("foreign", "has no faces")


_BY_ENDING = {".xml": _mitsuba, ".gltf": _gltf, ".glb": _glb, ".obj": _obj, ".ply": _ply, ".stl": _stl}


def candidates(folder: Path) -> list[Path]:
    """All regular files below a folder that one of our readers might open, sorted."""
    return sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS and p.is_file())


def surveys(paths: list[Path]) -> dict[Path, Survey]:
    """Of each file, with those that another one names as "part": a scene that only others include, and the meshes of
    scenes."""
    found = {path: survey(path) for path in paths}
    for path, one in list(found.items()):
        for name in one.names:
            named = Path(name)
            if named in found and named != path and found[named].state in ("complete", "incomplete"):
                found[named] = Survey("part", f"named by {path.name}", found[named].names, found[named].missing)
    return found
