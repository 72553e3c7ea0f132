"""What a file can name where it should name another file, in every place where it can."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any
from xml.sax.saxutils import quoteattr

from pmviewer.bench.hostile.seeds import MTL, OBJ, buffer, gltf_document, scene
from pmviewer.bench.hostile.special import Files, Maker, Special

LINKS = {"outside": "/etc/hostname", "zero": "/dev/zero", "itself": "itself", "parent": ".."}
"""Symbolic links beside the scene: name and where it points."""
PIPE = "pipe"
NAMES = {
    "a pipe": PIPE, "a device": "/dev/zero", "a random device": "/dev/urandom", "the terminal": "/dev/tty",
    "a folder": ".", "a file far above": "../../../../../../../../etc/passwd", "a link outside": "outside",
    "a link to a device": "zero", "a link to itself": "itself", "a link to a folder": "parent", "nothing": "",
    "a blank": " ", "a long name": "n" * 5000, "an address": "http://127.0.0.1:9/x.png",
    "a file address": "file:///etc/passwd", "a NUL": "a\0b", "memory": "/proc/self/mem", "standard input": "/dev/stdin",
    "backslashes": "..\\..\\x.png", "percent signs": "%2e%2e/%00", "a home": "~/x.png",
}  # fmt: skip

_BITMAP = (
    '<shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">'
    '<string name="filename" value={0}/></texture></bsdf></shape>'
)
_MESH = '<shape type="{1}"><string name="filename" value={0}/></shape>'
_SKY = '<emitter type="envmap"><string name="filename" value={0}/></emitter>'
_PATH = '<path value={0}/><shape type="obj"><string name="filename" value="hostname"/></shape>'


def specials() -> list[tuple[str, Maker]]:
    """Every name in every place."""
    return [
        (f"{place} names {kind}", partial(_made, format_, main, files, name))
        for kind, name in NAMES.items()
        for place, format_, main, files in _places()
    ]


def _made(format_: str, main: str, files: Callable[[str], Files], name: str) -> Special:
    return Special(format_, main, files(name), (PIPE,), LINKS)


def _places() -> list[tuple[str, str, str, Callable[[str], Files]]]:
    xml, include = "Mitsuba XML", "Mitsuba XML, include"
    found: list[tuple[str, str, str, Callable[[str], Files]]] = [
        (f"<{kind}>", f"Mitsuba XML with {kind}", "scene.xml", partial(_xml, _MESH, kind))
        for kind in ("obj", "ply", "serialized")
    ]
    found += [
        ("<bitmap>", xml, "scene.xml", partial(_xml, _BITMAP, "")),
        ("<envmap>", xml, "scene.xml", partial(_xml, _SKY, "")),
        ("<include>", include, "scene.xml", partial(_xml, "<include filename={0}/>", "")),
        ("<path>", include, "scene.xml", partial(_xml, _PATH, "")),
        ("mtllib", "OBJ", "mesh.obj", lambda name: {"mesh.obj": OBJ.replace("mesh.mtl", name).encode()}),
        ("map_Kd", "MTL", "mesh.obj", _mtl),
        ("a buffer", "glTF", "scene.gltf", partial(_gltf, "buffers")),
        ("an image", "glTF", "scene.gltf", partial(_gltf, "images")),
    ]
    return found


def _xml(middle: str, kind: str, name: str) -> Files:
    return {"scene.xml": scene(middle.format(quoteattr(name).replace("\0", "&#0;"), kind))}


def _mtl(name: str) -> Files:
    return {"mesh.obj": OBJ.encode(), "mesh.mtl": MTL.replace("tex.png", name).encode()}


def _gltf(where: str, name: str) -> Files:
    document: Any = gltf_document("data.bin")
    document[where][0]["uri"] = name
    return {"scene.gltf": json.dumps(document).encode(), "data.bin": buffer()}
