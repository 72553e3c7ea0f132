"""Hostile files that are not mutations: references to what is no file, bombs, extremes of counts and of nesting."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from pmviewer.bench.hostile import seeds
from pmviewer.bench.hostile.seeds import MTL, OBJ, exr, glb, gltf_document, hdr, ply, png

LINKS = {
    "outside": "/etc/hostname",
    "zero": "/dev/zero",
    "itself": "itself",
    "parent": "..",
}
"""Symbolic links that every case's folder gets if asked for: name and where it points."""


@dataclass(frozen=True)
class Special:
    """`files` of bytes; names in `fifos` are made as pipes, those in `links` as symbolic links (`LINKS`)."""

    name: str
    format: str
    main: str
    files: dict[str, bytes]
    fifos: tuple[str, ...] = ()
    links: dict[str, str] = field(default_factory=dict)


BAD_NAMES = {
    "pipe": "pipe", "device": "/dev/zero", "random device": "/dev/urandom", "terminal": "/dev/tty", "folder": ".",
    "above": "../../../../../../etc/passwd", "link out": "outside", "link to device": "zero", "link circle": "itself",
    "link above": "parent", "nothing": "", "blank": " ", "long": "n" * 5000, "address": "http://127.0.0.1:9/x.png",
    "file address": "file:///etc/passwd", "nul": "a\0b", "process": "/proc/self/mem", "own descriptor": "/dev/stdin",
    "backslashes": "..\\..\\x.png", "percent": "%2e%2e/%00", "tilde": "~/x.png",
}  # fmt: skip
"""What a file can name instead of a file."""


def _named(kind: str, name: str) -> dict[str, Callable[[], Special]]:
    """The same bad name in every place where a file is named."""

    def xml(middle: str) -> bytes:
        text = name.replace("&", "&amp;").replace('"', "&quot;").replace("\0", "&#0;")
        return seeds._scene(middle.format(name=text))

    def made(where: str, format_: str, main: str, files: dict[str, bytes]) -> Special:
        return Special(f"{where} is {kind}", format_, main, files, ("pipe",), dict(LINKS))

    def document(change: Callable[[dict[str, Any]], None]) -> bytes:
        content = gltf_document("data.bin")
        change(content)
        return json.dumps(content).encode()

    bitmap = '<shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">'
    bitmap += '<string name="filename" value="{name}"/></texture></bsdf></shape>'
    mesh = '<shape type="{{0}}"><string name="filename" value="{name}"/></shape>'
    coded = name.encode("utf-8", "surrogateescape")
    cases: dict[str, Callable[[], Special]] = {}
    for shape in ("obj", "ply", "serialized"):
        cases[shape] = lambda s=shape: made(f"<{s}>", f"Mitsuba XML with {s}", "scene.xml",
                                            {"scene.xml": xml(mesh.replace("{{0}}", s))})  # fmt: skip
    cases["bitmap"] = lambda: made("<bitmap>", "Mitsuba XML", "scene.xml", {"scene.xml": xml(bitmap)})
    cases["envmap"] = lambda: made("<envmap>", "Mitsuba XML", "scene.xml", {
        "scene.xml": xml('<emitter type="envmap"><string name="filename" value="{name}"/></emitter>')})  # fmt: skip
    cases["include"] = lambda: made("<include>", "Mitsuba XML, include", "scene.xml",
                                    {"scene.xml": xml('<include filename="{name}"/>')})  # fmt: skip
    cases["path"] = lambda: made("<path>", "Mitsuba XML, include", "scene.xml",
                                 {"scene.xml": xml('<path value="{name}"/>' + bitmap)})  # fmt: skip
    cases["mtllib"] = lambda: made("mtllib", "OBJ", "mesh.obj",
                                   {"mesh.obj": OBJ.encode().replace(b"mesh.mtl", coded)})  # fmt: skip
    cases["map_Kd"] = lambda: made("map_Kd", "MTL", "mesh.obj",
                                   {"mesh.obj": OBJ.encode(), "mesh.mtl": MTL.encode().replace(b"tex.png", coded)})  # fmt: skip
    cases["buffer"] = lambda: made("buffer", "glTF", "scene.gltf",
                                   {"scene.gltf": document(lambda d: d["buffers"][0].update(uri=name))})  # fmt: skip
    cases["image"] = lambda: made("image", "glTF", "scene.gltf", {
        "scene.gltf": document(lambda d: d["images"][0].update(uri=name)), "data.bin": seeds._buffer()})  # fmt: skip
    return cases


def _scene_of(middle: str) -> dict[str, bytes]:
    return {"scene.xml": seeds._scene(middle)}


def _gltf(**accessor: Any) -> dict[str, bytes]:
    content: Any = gltf_document("data.bin")
    content["accessors"][0].update(accessor)
    for key in [key for key, value in content["accessors"][0].items() if value is None]:
        del content["accessors"][0][key]
    return {"scene.gltf": json.dumps(content).encode(), "data.bin": seeds._buffer(), "tex.png": png()}


def _nodes(count: int, children: Callable[[int], list[int]]) -> dict[str, bytes]:
    content: Any = gltf_document("data.bin")
    content["nodes"] = [{"mesh": 0, "children": children(i)} if children(i) else {"mesh": 0} for i in range(count)]
    content["scenes"] = [{"nodes": [0]}]
    return {"scene.gltf": json.dumps(content).encode(), "data.bin": seeds._buffer(), "tex.png": png()}


@cache
def _zeros(count: int) -> bytes:
    """`count` zero bytes as a zlib stream, put together from one block that stands for a mebibyte."""
    packer = zlib.compressobj(9, wbits=-15)
    block = packer.compress(b"\0" * (1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)
    packer = zlib.compressobj(9, wbits=-15)
    rest = packer.compress(b"\0" * (count & (1 << 20) - 1)) + packer.flush()
    adler = (count % 65521) << 16 | 1  # of zeros alone (RFC 1950)
    return b"\x78\xda" + block * (count >> 20) + rest + struct.pack(">I", adler)


def _grid(size: int, name: str) -> str:
    return (
        f'<shape type="rectangle"><bsdf type="displacement"><integer name="subdivisions" value="{size}"/>'
        f'<texture type="bitmap"><string name="filename" value="{name}"/></texture></bsdf></shape>'
    )


def _group_chain(count: int) -> str:
    text = '<shape type="shapegroup" id="g0"><shape type="sphere"/></shape>'
    for i in range(1, count):
        text += (
            f'<shape type="shapegroup" id="g{i}">'
            + f'<shape type="instance"><ref id="g{i - 1}"/></shape>' * 2
            + "</shape>"
        )
    return text + f'<shape type="instance"><ref id="g{count - 1}"/></shape>'


def _serialized(vertices: int, triangles: int, body: bytes = b"") -> bytes:
    head = struct.pack("<I", 0x1000) + b"x\0" + struct.pack("<QQ", vertices, triangles)
    return struct.pack("<HH", 0x041C, 4) + zlib.compress(head + body) + struct.pack("<QI", 0, 1)


_OBJ_SCENE = seeds._MESHES.format(kind="serialized", file="m.serialized", more="")


def _others() -> dict[str, Callable[[], Special]]:
    xml, gltf, obj = "Mitsuba XML", "glTF", "OBJ"
    texture = seeds._TEXTURED.format(sky="sky.hdr")
    sheet = seeds._TEXTURED.format(sky="sky.exr")

    def of(format_: str, main: str, files: Callable[[], dict[str, bytes]]) -> Callable[[str], Callable[[], Special]]:
        return lambda name: lambda: Special(name, format_, main, files())

    def ply_header(element: str) -> bytes:
        return ply(True).replace(b"element vertex 5", element.encode())

    table: dict[str, Callable[[str], Callable[[], Special]]] = {
        "includes itself": of("Mitsuba XML, include", "scene.xml", lambda: _scene_of('<include filename="scene.xml"/>')),
        "includes in a circle": of("Mitsuba XML, include", "scene.xml", lambda: {
            **_scene_of('<include filename="b.xml"/>'), "b.xml": b'<scene version="3.0.0"><include filename="c.xml"/></scene>',
            "c.xml": b'<scene version="3.0.0"><include filename="b.xml"/></scene>'}),
        "includes that double": of("Mitsuba XML, include", "scene.xml", lambda: {
            **_scene_of('<include filename="p0.xml"/>'),
            **{f"p{i}.xml": b'<scene version="3.0.0">' + f'<include filename="p{i + 1}.xml"/>'.encode() * 2 + b"</scene>"
               for i in range(40)}, "p40.xml": b'<scene version="3.0.0"><shape type="sphere"/></scene>'}),
        "3000 nested groups": of(xml, "scene.xml", lambda: _scene_of(
            '<shape type="shapegroup" id="g">' * 50 + '<shape type="sphere"/>' + "</shape>" * 50)),
        "chain of 3000 groups": of(xml, "scene.xml", lambda: _scene_of(_group_chain(3000))),
        "copies that double 40 times": of(xml, "scene.xml", lambda: _scene_of(_group_chain(40))),
        "bsdfs nested": of(xml, "scene.xml", lambda: _scene_of(
            '<shape type="sphere">' + '<bsdf type="twosided">' * 55 + '<bsdf type="diffuse"/>' + "</bsdf>" * 55 + "</shape>")),
        "50 000 shapes": of(xml, "scene.xml", lambda: _scene_of('<shape type="sphere"/>' * 50_000)),
        "parameters that double": of(xml, "scene.xml", lambda: _scene_of('<default name="a0" value="xxxxxxxxxx"/>' + "".join(
            f'<default name="a{i + 1}" value="{f"$a{i}" * 10}"/>' for i in range(30)) + '<shape type="$a30"/>')),
        "picture of 10^9 pixels": of(xml, "scene.xml", lambda: {"scene.xml": seeds._scene('<shape type="sphere"/>').replace(
            b'value="$res"', b'value="1000000000"')}),
        "fine displacement": of(xml, "scene.xml", lambda: {**_scene_of(_grid(4000, "tex.png")), "tex.png": png()}),
        "finest displacement": of(xml, "scene.xml", lambda: {**_scene_of(_grid(2**31 - 1, "tex.png")), "tex.png": png()}),
        "serialized of 2^40 vertices": of("Mitsuba XML with serialized", "scene.xml", lambda: {
            **_scene_of(_OBJ_SCENE), "m.serialized": _serialized(2**40, 1)}),
        "serialized of 10^8 triangles": of("Mitsuba XML with serialized", "scene.xml", lambda: {
            **_scene_of(_OBJ_SCENE), "m.serialized": _serialized(3, 10**8, b"\0" * 36)}),
        "serialized bomb": of("Mitsuba XML with serialized", "scene.xml", lambda: {
            **_scene_of(_OBJ_SCENE), "m.serialized": struct.pack("<HH", 0x041C, 4) + _zeros(3 << 30) + struct.pack("<QI", 0, 1)}),
        "serialized of 2^32 meshes": of("Mitsuba XML with serialized", "scene.xml", lambda: {
            **_scene_of(_OBJ_SCENE), "m.serialized": _serialized(3, 1, b"\0" * 48)[:-4] + b"\xff" * 4}),
        "PNG of 2^31 pixels a side": of("PNG image", "scene.xml", lambda: {
            **_scene_of(texture), "tex.png": png(2**31 - 1, 2**31 - 1, zlib.compress(b"\0")), "sky.hdr": hdr()}),
        "PNG bomb": of("PNG image", "scene.xml", lambda: {
            **_scene_of(texture), "tex.png": png(30_000, 30_000, _zeros(30_000 * 90_001)), "sky.hdr": hdr()}),
        "PNG text bomb": of("PNG image", "scene.xml", lambda: {
            **_scene_of(texture), "tex.png": _with_text(png()), "sky.hdr": hdr()}),
        "HDR of 10^10 pixels": of("HDR image", "scene.xml", lambda: {
            **_scene_of(texture), "tex.png": png(), "sky.hdr": hdr().replace(b"-Y 4 +X 8", b"-Y 100000 +X 100000")}),
        "HDR of negative size": of("HDR image", "scene.xml", lambda: {
            **_scene_of(texture), "tex.png": png(), "sky.hdr": hdr().replace(b"-Y 4 +X 8", b"-Y -4 +X 8")}),
        "EXR of 10^10 pixels": of("EXR image", "scene.xml", lambda: {
            **_scene_of(sheet), "tex.png": png(),
            "sky.exr": exr().replace(struct.pack("<4i", 0, 0, 7, 3), struct.pack("<4i", 0, 0, 99_999, 99_999))}),
        "EXR inside out": of("EXR image", "scene.xml", lambda: {
            **_scene_of(sheet), "tex.png": png(),
            "sky.exr": exr().replace(struct.pack("<4i", 0, 0, 7, 3), struct.pack("<4i", 7, 3, -2**31, 2**31 - 1))}),
        "accessor of 10^8 without a view": of(gltf, "scene.gltf", lambda: _gltf(bufferView=None, count=100_000_000)),
        "accessor of 10^12": of(gltf, "scene.gltf", lambda: _gltf(count=10**12)),
        "sparse accessor of 10^8": of(gltf, "scene.gltf", lambda: _gltf(bufferView=None, count=10**8, sparse={
            "count": 1, "indices": {"bufferView": 2, "componentType": 5123}, "values": {"bufferView": 0}})),
        "buffer of 10^12 bytes": of(gltf, "scene.gltf", lambda: {
            **_gltf(), "scene.gltf": _gltf()["scene.gltf"].replace(b'"byteLength": 136', b'"byteLength": 1000000000000')}),
        "nodes in a chain of 20 000": of(gltf, "scene.gltf", lambda: _nodes(20_000, lambda i: [i + 1] if i < 19_999 else [])),
        "nodes that double 40 times": of(gltf, "scene.gltf", lambda: _nodes(41, lambda i: [i + 1, i + 1] if i < 40 else [])),
        "node its own child": of(gltf, "scene.gltf", lambda: _nodes(2, lambda i: [i])),
        "300 000 nodes": of(gltf, "scene.gltf", lambda: _nodes(300_000, lambda i: list(range(1, 300_000)) if i == 0 else [])),
        "base64 bomb": of(gltf, "scene.gltf", lambda: {"scene.gltf": json.dumps(
            gltf_document("data:application/octet-stream;base64," + "A" * 30_000_001)).encode(), "tex.png": png()}),
        "draco without data": of(gltf, "scene.gltf", lambda: {"scene.gltf": json.dumps(_with_extension(
            "KHR_draco_mesh_compression", {"bufferView": 0, "attributes": {"POSITION": 0}})).encode(),
            "data.bin": seeds._buffer()}),
        "meshopt of 10^9": of(gltf, "scene.gltf", lambda: {"scene.gltf": json.dumps(_meshopt()).encode(),
                                                           "data.bin": seeds._buffer()}),
        "GLB of 4 GiB by its header": of("GLB", "scene.glb", lambda: {
            "scene.glb": glb()[:8] + b"\xff" * 4 + glb()[12:], "tex.png": png()}),
        "GLB chunk of 4 GiB": of("GLB", "scene.glb", lambda: {"scene.glb": glb()[:12] + b"\xff" * 4 + glb()[16:]}),
        "GLB in itself": of("GLB", "scene.glb", lambda: {"scene.glb": glb(tail=glb())}),
        "PLY of 10^12 vertices": of("PLY", "mesh.ply", lambda: {"mesh.ply": ply_header("element vertex 1000000000000")}),
        "PLY of 10^8 properties": of("PLY", "mesh.ply", lambda: {"mesh.ply": ply(True).replace(
            b"property float x\n", b"property float x\n" + b"property float p\n" * 200_000)}),
        "PLY list of 2^32": of("PLY", "mesh.ply", lambda: {"mesh.ply": ply(True).replace(
            b"list uchar int", b"list uint int")[:-78] + b"\xff" * 78}),
        "PLY of negative vertices": of("PLY", "mesh.ply", lambda: {"mesh.ply": ply_header("element vertex -5")}),
        "PLY without end of header": of("PLY", "mesh.ply", lambda: {"mesh.ply": b"ply\nformat ascii 1.0\n" + b"comment x\n" * 500_000}),
        "STL of 2^32 facets": of("STL", "mesh.stl", lambda: {"mesh.stl": seeds.stl(True)[:80] + b"\xff" * 4 + seeds.stl(True)[84:]}),
        "STL solid and binary": of("STL", "mesh.stl", lambda: {"mesh.stl": b"solid" + seeds.stl(True)[5:]}),
        "OBJ with a face of 10^6 corners": of(obj, "mesh.obj", lambda: {
            "mesh.obj": OBJ.encode() + b"f" + b" 1 2 3 4" * 250_000 + b"\n", "mesh.mtl": MTL.encode(), "tex.png": png()}),
        "OBJ with far indices": of(obj, "mesh.obj", lambda: {
            "mesh.obj": OBJ.encode() + b"f 999999999999999999999 2 3\nf -1 -2 -999999999\nf 0 0 0\n", "mesh.mtl": MTL.encode(),
            "tex.png": png()}),
        "OBJ with a million groups": of(obj, "mesh.obj", lambda: {
            "mesh.obj": OBJ.encode() + b"".join(b"g %d\nusemtl m%d\nf 1 2 3\n" % (i, i) for i in range(100_000)),
            "mesh.mtl": MTL.encode(), "tex.png": png()}),
        "MTL its own library": of("MTL", "mesh.obj", lambda: {"mesh.obj": OBJ.encode().replace(b"mesh.mtl", b"mesh.obj")}),
        "one line of 20 MB": of(obj, "mesh.obj", lambda: {"mesh.obj": OBJ.encode() + b"#" + b"x" * 20_000_000}),
        "OBJ that is a picture": of(obj, "mesh.obj", lambda: {"mesh.obj": png(64, 64)}),
    }  # fmt: skip
    return {name: make(name) for name, make in table.items()}


def _with_text(picture: bytes) -> bytes:
    body = b"Comment\0\0" + _zeros(1 << 30)
    chunk = struct.pack(">I", len(body)) + b"zTXt" + body + struct.pack(">I", zlib.crc32(b"zTXt" + body))
    return picture[:33] + chunk + picture[33:]


def _with_extension(name: str, content: Any) -> Any:
    document: Any = gltf_document("data.bin")
    document["extensionsUsed"] = document["extensionsRequired"] = [name]
    document["meshes"][0]["primitives"][0]["extensions"] = {name: content}
    return document


def _meshopt() -> Any:
    name = "EXT_meshopt_compression"
    document: Any = gltf_document("data.bin")
    document["extensionsUsed"] = [name]
    document["bufferViews"][0]["extensions"] = {name: {
        "buffer": 0, "byteOffset": 0, "byteLength": 60, "byteStride": 12, "count": 10**9, "mode": "ATTRIBUTES"}}  # fmt: skip
    return document


@cache
def specials() -> list[tuple[str, Callable[[], Special]]]:
    """Names and makers of all; bombs are made when they are asked for."""
    made = list(_others().items())
    for kind, name in BAD_NAMES.items():
        made += [(f"{where} names {kind}", make) for where, make in _named(kind, name).items()]
    return made
