"""Mutations of XML and JSON that are still well-formed: what a wrong exporter, or somebody with intent, writes."""

from __future__ import annotations

import copy
import json
import random
import struct
import zlib
from typing import Any
from xml.etree import ElementTree

from pmviewer.bench.hostile.mutate import NUMBERS
from pmviewer.bench.hostile.seeds import glb

TAGS = ("shape", "bsdf", "emitter", "texture", "sensor", "film", "integrator", "sampler", "rfilter", "medium", "ref",
        "include", "default", "path", "alias", "float", "integer", "boolean", "string", "rgb", "spectrum", "blackbody",
        "transform", "lookat", "matrix", "scale", "rotate", "translate", "point", "vector", "scene", "unknown",
        "object", "srgb")  # fmt: skip
TYPES = ("sphere", "rectangle", "cube", "obj", "ply", "serialized", "shapegroup", "instance", "merge", "heightfield",
         "hair", "diffuse", "dielectric", "roughdielectric", "conductor", "principled", "blendbsdf", "mask", "twosided",
         "bumpmap", "normalmap", "null", "plastic", "area", "point", "spot", "envmap", "constant", "directional",
         "projector", "sunsky", "sky", "sun", "bitmap", "checkerboard", "mesh_attribute", "scale", "perspective",
         "orthographic", "thinlens", "distant", "batch", "path", "hdrfilm", "", "nothing of the kind")  # fmt: skip
BOMB = (
    '<?xml version="1.0"?><!DOCTYPE scene [<!ENTITY a "ha">%s]>'
    '<scene version="3.0.0"><string name="x" value="&z;"/></scene>'
)
DEEP = 3000
TELLING = {"count", "byteLength", "byteOffset", "bufferView", "indices", "mesh", "children", "componentType", "type",
           "uri"}  # fmt: skip
"""Keys of glTF that say how much there is, or where."""
VALUES: tuple[Any, ...] = (None, True, -1, 0, 1, 1e308, 100_000_000, 2**31, 2**53, 2**63, 1.5, "", "x" * 100_000, [],
                           {}, [[]], [None], {"a": {}}, "0", -0.0, [0] * 1000, float("nan"), float("inf"))  # fmt: skip


def mutate_xml(data: bytes, chance: random.Random) -> bytes:
    """One to three structural changes of a document; rarely one that only text can hold."""
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError:
        return data
    if chance.random() < 0.08:
        return _xml_text(data, chance)
    for _ in range(chance.choice((1, 1, 2, 3))):
        _change_element(root, chance)
    text: bytes = ElementTree.tostring(root, "utf-8", xml_declaration=True)
    return text


def _xml_text(data: bytes, chance: random.Random) -> bytes:
    kind = chance.randrange(6)
    if kind == 0:
        names = "bcdefghijklmnopqrstuvwxyz"
        links = "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("a" + names, names, strict=False))
        return (BOMB % links).encode()
    if kind == 1:
        return data.replace(b"<scene", b'<!DOCTYPE scene SYSTEM "file:///etc/passwd"><scene', 1)
    if kind == 2:
        return data.replace(b"<scene", b"<![CDATA[<scene", 1)
    if kind == 3:
        return data.replace(b"</scene>", b'<bsdf type="diffuse">' * DEEP + b"</bsdf>" * DEEP + b"</scene>")
    if kind == 4:
        open_, shut = b'<shape type="shapegroup" id="g">', b"</shape>"
        return data.replace(b"</scene>", open_ * DEEP + shut * DEEP + b"</scene>")
    return data.replace(b"UTF-8", b"klingon").replace(b"utf-8", b"EBCDIC-CP-US")


def _change_element(root: ElementTree.Element, chance: random.Random) -> None:
    parents = [(parent, child) for parent in root.iter() for child in parent]
    if not parents:
        return
    parent, child = chance.choice(parents)
    other = chance.choice(parents)[1]
    match chance.randrange(14):
        case 0:
            parent.remove(child)
        case 1:
            parent.append(copy.deepcopy(child))
        case 2:
            parent.extend([copy.deepcopy(child) for _ in range(chance.choice((30, 3000)))])
        case 3:
            nested = child
            for _ in range(chance.choice((1, 5, 40, 70))):
                outer = ElementTree.Element(child.tag, child.attrib)
                outer.append(nested)
                nested = outer
            parent.append(nested)
        case 4:
            child.tag = chance.choice(TAGS)
        case 5:
            child.set("type", chance.choice(TYPES))
        case 6 if child.attrib:
            del child.attrib[chance.choice(list(child.attrib))]
        case 7 if child.attrib:
            child.set(chance.choice(list(child.attrib)), chance.choice(NUMBERS).decode())
        case 8 if child.attrib:
            child.set(chance.choice(list(child.attrib)), "L" * 70_000)
        case 9:
            other.append(copy.deepcopy(child))
        case 10:
            parent.append(ElementTree.Element(chance.choice(TAGS), {"type": chance.choice(TYPES), "name": "to_world"}))
        case 11:
            named = [e.get("id", "") for e in root.iter() if e.get("id")]
            child.append(ElementTree.Element("ref", {"id": chance.choice(named or ["nobody"])}))
        case 12:
            child.set("id", chance.choice([e.get("id", "x") for e in root.iter()]))
        case _:
            root.set("version", chance.choice(("", "0", "0.6.0", "99.0.0", "three", "-1", "1e999", "3", "3.0.0.0.0")))


def mutate_json(data: bytes, chance: random.Random) -> bytes:
    """One to three changes of values, keys and nesting; rarely one of the text."""
    document = json.loads(data)
    if chance.random() < 0.05:
        return _json_text(data, chance)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        _change_value(document, chance)
    return json.dumps(document).encode("utf-8", "surrogatepass")


def _json_text(data: bytes, chance: random.Random) -> bytes:
    return chance.choice((
        b"[" * 100_000,
        b'{"asset":' * 20_000,
        data.replace(b"{", b'{"asset": 1, ', 1),
        data.replace(b'"asset"', b'"\\ud800"', 1),
        data + data,
        b"\xef\xbb\xbf" + data,
        data.replace(b"2.0", b"9" * 20_000, 1),
        b"null", b"[]", b"{}", b'"glTF"', b"1e999", b'{"asset": {"version": "2.0"}}',
    ))  # fmt: skip


def _places(node: Any, found: list[tuple[Any, Any]]) -> list[tuple[Any, Any]]:
    entries = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in entries:
        found.append((node, key))
        _places(value, found)
    return found


def _change_value(document: Any, chance: random.Random) -> None:
    places = _places(document, [])
    holder, key = chance.choice(places)
    match chance.randrange(9):
        case 0 | 1 | 2:
            holder[key] = copy.deepcopy(chance.choice(VALUES))
        case 3:
            del holder[key]
        case 4:
            other, at = chance.choice(places)
            holder[key] = copy.deepcopy(other[at])
        case 5:
            numbers = [(h, k) for h, k in places if isinstance(h[k], int | float) and not isinstance(h[k], bool)]
            for h, k in numbers if chance.random() < 0.1 else [chance.choice(numbers)]:
                h[k] = chance.choice((h[k] + 1, -h[k], h[k] * 1000, 1e8, 2**32, 2**62, -1, 0, 1e300, 0.5))
        case 6 if isinstance(holder, list):
            holder.extend([copy.deepcopy(holder[key])] * chance.choice((2, 2000)))
        case 7 if isinstance(holder, dict):
            holder[chance.choice(("children", "extensions", "mesh", "sparse", "weights", "targets", "skin", "uri"))] = (
                copy.deepcopy(chance.choice((0, [0], [0, 0, 0], {}, "data:;base64,AAAA", *VALUES[:12])))
            )
        case _:
            named = [(h, k) for h, k in places if k in TELLING]
            h, k = chance.choice(named or places)
            h[k] = copy.deepcopy(chance.choice(VALUES))


def mutate_glb(data: bytes, chance: random.Random) -> bytes:
    """The JSON chunk changed, and packed as it should be."""
    length = struct.unpack("<I", data[12:16])[0]
    try:
        document = json.loads(mutate_json(data[20 : 20 + length], chance))
    except (ValueError, RecursionError):
        document = None
    return glb(document, data[20 + length + 8 :])


def mutate_deflated(data: bytes, chance: random.Random, mutations: Any) -> bytes:
    """Of a `.serialized` file: what is compressed is changed and compressed again."""
    reader = zlib.decompressobj()
    body = reader.decompress(data[4:])
    body = chance.choice(mutations)(body, chance)
    packed = data[:4] + zlib.compress(body)
    return packed + struct.pack("<Q", 0) + struct.pack("<I", 1)
