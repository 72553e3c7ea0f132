"""Small honest files of every format that the readers know, as bytes. Mutations start from these.

A seed is a little folder: files by name, of which `main` is opened and `victims` are mutated.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

CORNERS = ((-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FACES = ((0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (0, 2, 1), (0, 3, 2))
UVS = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.5, 0.5))


@dataclass(frozen=True)
class Seed:
    """`format` groups findings in the report."""

    name: str
    format: str
    main: str
    files: Mapping[str, bytes]
    victims: tuple[str, ...]


def png(width: int = 4, height: int = 4, data: bytes | None = None) -> bytes:
    """RGB, 8 bits; `data` are the compressed scanlines if they shall be others."""
    rows = b"".join(b"\0" + bytes((40 * x + 7, 50 * y + 9, 128)[c] % 256 for x in range(width) for c in range(3))
                    for y in range(height)) if data is None else b""  # fmt: skip
    body = zlib.compress(rows) if data is None else data

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def hdr(width: int = 8, height: int = 4) -> bytes:
    """Radiance RGBE, not compressed."""
    pixels = bytes((100 + x, 90 + y, 80, 129)[c] for y in range(height) for x in range(width) for c in range(4))
    return f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode() + pixels


def exr(width: int = 8, height: int = 4) -> bytes:
    """OpenEXR with three float channels in scanlines, not compressed."""

    def attribute(name: str, kind: str, value: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<I", len(value)) + value

    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = (
        b"".join(name + b"\0" + struct.pack("<I4B2I", 2, 0, 0, 0, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    )
    head = struct.pack("<II", 20000630, 2)
    head += attribute("channels", "chlist", channels) + attribute("compression", "compression", b"\0")
    head += attribute("dataWindow", "box2i", window) + attribute("displayWindow", "box2i", window)
    head += attribute("lineOrder", "lineOrder", b"\0") + attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
    head += attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0))
    head += attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0"
    line = 3 * 4 * width
    offsets = [len(head) + 8 * height + y * (8 + line) for y in range(height)]
    rows = [struct.pack("<iI", y, line) + struct.pack(f"<{3 * width}f", *([0.5] * 3 * width)) for y in range(height)]
    return head + struct.pack(f"<{height}Q", *offsets) + b"".join(rows)


def serialized() -> bytes:
    """Mitsuba's compressed mesh: two meshes of version 4 and the table of their places."""
    out, offsets = b"", []
    for name in (b"one", b"two"):
        offsets.append(len(out))
        body = struct.pack("<I", 0x1000 | 0x0002) + name + b"\0" + struct.pack("<QQ", len(CORNERS), len(FACES))
        body += b"".join(struct.pack("<3f", *c) for c in CORNERS) + b"".join(struct.pack("<2f", *c) for c in UVS)
        body += b"".join(struct.pack("<3I", *f) for f in FACES)
        out += struct.pack("<HH", 0x041C, 4) + zlib.compress(body)
    return out + struct.pack("<2Q", *offsets) + struct.pack("<I", 2)


VOLUME = """    <medium type="heterogeneous" id="smoke">
      <volume name="sigma_t" type="gridvolume"><string name="filename" value="{file}"/>
        <boolean name="use_grid_bbox" value="true"/></volume><float name="scale" value="2"/>
      <volume name="albedo" type="constvolume"><rgb name="value" value="0.9 0.8 0.7"/></volume></medium>
    <shape type="cube"><bsdf type="null"/><ref name="interior" id="smoke"/></shape>
"""


NUMBERS = struct.pack("<24f", *(n / 24 for n in range(24)))
"""Of a volume of 4 × 3 × 2 places."""


def vol(
    sides: tuple[int, int, int] = (4, 3, 2),
    channels: int = 1,
    box: tuple[float, ...] = (0, 0, 0, 1, 1, 1),
    numbers: bytes = NUMBERS,
) -> bytes:
    """Mitsuba's volume file, version 3."""
    return struct.pack("<3sB5i6f", b"VOL", 3, 1, *sides, channels, *box) + numbers


def npy() -> bytes:
    """The same numbers as NumPy writes them."""
    head = b"{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, 4), }".ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head + vol()[48:]


OBJ = "mtllib mesh.mtl\no pyramid\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
OBJ += "".join(f"vt {u} {v}\n" for u, v in UVS) + "vn 0 0 1\ng sides\nusemtl painted\ns 1\n"
OBJ += "".join(f"f {a + 1}/{a + 1}/1 {b + 1}/{b + 1}/1 {c + 1}/{c + 1}/1\n" for a, b, c in FACES[:4])
OBJ += "usemtl lamp\nf 1 4 3 2\n"
MTL = """newmtl painted
Ka 0 0 0
Kd 0.6 0.5 0.4
Ks 0.1 0.1 0.1
Ns 20
Ni 1.5
d 1
illum 2
map_Kd tex.png
map_Bump -bm 0.2 tex.png
newmtl lamp
Kd 0 0 0
Ke 4 4 3
illum 1
"""


def ply(binary: bool) -> bytes:
    """Positions, texture coordinates, colours and faces."""
    head = f"ply\nformat {'binary_little_endian' if binary else 'ascii'} 1.0\ncomment honest\n"
    head += f"element vertex {len(CORNERS)}\nproperty float x\nproperty float y\nproperty float z\n"
    head += "property float s\nproperty float t\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    head += f"element face {len(FACES)}\nproperty list uchar int vertex_indices\nend_header\n"
    if not binary:
        body = "".join(f"{x} {y} {z} {u} {v} 200 100 50\n" for (x, y, z), (u, v) in zip(CORNERS, UVS, strict=True))
        return (head + body + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES)).encode()
    data = b"".join(struct.pack("<5f3B", *c, *u, 200, 100, 50) for c, u in zip(CORNERS, UVS, strict=True))
    return head.encode() + data + b"".join(struct.pack("<B3i", 3, *f) for f in FACES)


def stl(binary: bool) -> bytes:
    """The honest mesh as STL, in text or binary."""
    if binary:
        facets = b"".join(struct.pack("<12fH", 0, 0, 1, *CORNERS[a], *CORNERS[b], *CORNERS[c], 0) for a, b, c in FACES)
        return b"honest".ljust(80, b"\0") + struct.pack("<I", len(FACES)) + facets
    text = "solid honest\n"
    for face in FACES:
        corners = "".join("      vertex {} {} {}\n".format(*CORNERS[i]) for i in face)
        text += f"  facet normal 0 0 1\n    outer loop\n{corners}    endloop\n  endfacet\n"
    return (text + "endsolid honest\n").encode()


def buffer() -> bytes:
    """What the document's buffer holds: corners, texture coordinates, faces."""
    data = b"".join(struct.pack("<3f", *c) for c in CORNERS) + b"".join(struct.pack("<2f", *c) for c in UVS)
    return data + b"".join(struct.pack("<3H", *f) for f in FACES)


def gltf_document(uri: str | None) -> dict[str, object]:
    """A pyramid under two nodes with a texture, a lamp and a camera; `uri` of its buffer, None in a GLB."""
    vertices, coordinates, faces = 12 * len(CORNERS), 8 * len(UVS), 6 * len(FACES)
    buffer: dict[str, object] = {"byteLength": vertices + coordinates + faces}
    if uri is not None:
        buffer["uri"] = uri
    return {
        "asset": {"version": "2.0", "generator": "honest"},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_emissive_strength"],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 30.0, "color": [1, 1, 0.9]}]}},
        "scene": 0,
        "scenes": [{"nodes": [0, 2, 3]}],
        "nodes": [
            {"name": "top", "children": [1], "translation": [0.5, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1]},
            {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
            {"camera": 0, "translation": [0, 0, 6]},
            {"translation": [0, 3, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}},
        ],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 1.3}}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0, "mode": 4}]}],
        "materials": [{
            "name": "paint", "doubleSided": True, "emissiveFactor": [0.1, 0, 0], "alphaMode": "MASK",
            "alphaCutoff": 0.5,
            "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0.2, "roughnessFactor": 0.6,
                                     "baseColorFactor": [1, 0.9, 0.8, 1]},
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 2.0}},
        }],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [{"wrapS": 10497, "magFilter": 9729}],
        "images": [{"uri": "tex.png"}],
        "buffers": [buffer],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": vertices},
            {"buffer": 0, "byteOffset": vertices, "byteLength": coordinates},
            {"buffer": 0, "byteOffset": vertices + coordinates, "byteLength": faces},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(CORNERS), "type": "VEC3", "min": [-1, -1, 0],
             "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5126, "count": len(UVS), "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 3 * len(FACES), "type": "SCALAR"},
        ],
    }  # fmt: skip


def glb(document: object | None = None, tail: bytes | None = None) -> bytes:
    """A GLB of any JSON document and binary chunk."""
    text = json.dumps(gltf_document(None) if document is None else document).encode()
    text += b" " * (-len(text) % 4)
    data = buffer() if tail is None else tail
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


_HEAD = """<?xml version="1.0" encoding="utf-8"?>
<scene version="3.0.0">
    <default name="res" value="64"/>
    <integrator type="path"><integer name="max_depth" value="6"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="45"/>
        <transform name="to_world"><lookat origin="0, -4, 2" target="0, 0, 0.5" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="$res"/><integer name="height" value="48"/></film>
        <sampler type="independent"><integer name="sample_count" value="4"/></sampler>
    </sensor>
"""
_LAMP = """    <shape type="rectangle">
        <transform name="to_world"><rotate x="1" angle="180"/><translate z="3"/></transform>
        <emitter type="area"><rgb name="radiance" value="8, 7, 6"/></emitter>
    </shape>
</scene>
"""
_PLAIN = """    <bsdf type="twosided" id="paint">
        <bsdf type="diffuse"><rgb name="reflectance" value="0.6 0.5 0.4"/></bsdf>
    </bsdf>
    <bsdf type="roughconductor" id="metal">
        <string name="material" value="Au"/><float name="alpha" value="0.2"/>
    </bsdf>
    <bsdf type="dielectric" id="glass"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1"/></bsdf>
    <shape type="sphere">
        <point name="center" x="0" y="0" z="0.5"/><float name="radius" value="0.5"/><ref id="glass"/>
    </shape>
    <shape type="cube">
        <transform name="to_world"><scale value="0.3"/><translate x="1"/></transform><ref id="metal"/>
    </shape>
    <shape type="disk"><transform name="to_world"><scale x="3" y="3"/></transform><ref id="paint"/></shape>
    <shape type="cylinder"><point name="p0" x="-1" y="0" z="0"/><point name="p1" x="-1" y="0" z="1"/>
        <float name="radius" value="0.2"/>
        <bsdf type="plastic"><spectrum name="diffuse_reflectance" value="0.4"/></bsdf></shape>
    <emitter type="point"><point name="position" x="0" y="-2" z="2"/><rgb name="intensity" value="3"/></emitter>
    <emitter type="spot"><transform name="to_world"><lookat origin="2,0,3" target="0,0,0" up="0,1,0"/></transform>
        <rgb name="intensity" value="5"/><float name="cutoff_angle" value="30"/></emitter>
    <emitter type="constant"><rgb name="radiance" value="0.1"/></emitter>
"""
TEXTURED = """    <bsdf type="diffuse" id="paint"><texture name="reflectance" type="bitmap">
        <string name="filename" value="tex.png"/>
        <transform name="to_uv"><scale x="2" y="2"/></transform></texture></bsdf>
    <bsdf type="diffuse" id="squares"><texture name="reflectance" type="checkerboard"><rgb name="color0" value="0.2"/>
        <rgb name="color1" value="0.8"/></texture></bsdf>
    <shape type="rectangle"><ref id="paint"/></shape>
    <shape type="sphere"><float name="radius" value="0.4"/><ref id="squares"/></shape>
    <emitter type="envmap"><string name="filename" value="{sky}"/><float name="scale" value="0.5"/></emitter>
"""
MESHES = """    <bsdf type="diffuse" id="paint"/>
    <shape type="{kind}"><string name="filename" value="{file}"/>{more}
        <transform name="to_world"><scale value="0.8"/></transform><ref id="paint"/></shape>
"""
_GROUPS = """    <shape type="shapegroup" id="group">
        <shape type="cube"><bsdf type="diffuse"/></shape>
        <shape type="sphere"><float name="radius" value="1.2"/><bsdf type="conductor"/></shape>
    </shape>
    <shape type="instance"><ref id="group"/><transform name="to_world"><translate x="-1"/></transform></shape>
    <shape type="instance"><ref id="group"/><transform name="to_world"><matrix value="1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1"/>
        </transform></shape>
"""
_PART = """<?xml version="1.0" encoding="utf-8"?>
<scene version="3.0.0">
    <bsdf type="diffuse" id="included"><rgb name="reflectance" value="0.3, 0.6, 0.3"/></bsdf>
    <shape type="sphere"><ref id="included"/></shape>
</scene>
"""


def scene(middle: str) -> bytes:
    """A Mitsuba scene with a camera and a lamp, and `middle` between."""
    return (_HEAD + middle + _LAMP).encode()


def seeds() -> list[Seed]:
    """All of them."""
    texture = {"tex.png": png(), "sky.hdr": hdr()}
    made = [Seed("xml", "Mitsuba XML", "scene.xml", {"scene.xml": scene(_PLAIN)}, ("scene.xml",))]
    for kind, sky in (("hdr", hdr()), ("exr", exr())):
        files = {"scene.xml": scene(TEXTURED.format(sky=f"sky.{kind}")), "tex.png": png(), f"sky.{kind}": sky}
        made.append(Seed(f"xml {kind}", f"{kind.upper()} image", "scene.xml", files, (f"sky.{kind}",)))
    made.append(Seed("xml textures", "Mitsuba XML", "scene.xml",
                     {"scene.xml": scene(TEXTURED.format(sky="sky.hdr")), **texture}, ("scene.xml",)))  # fmt: skip
    made.append(Seed("png", "PNG image", "scene.xml", made[-1].files, ("tex.png",)))
    made.append(Seed("xml groups", "Mitsuba XML", "scene.xml", {"scene.xml": scene(_GROUPS)}, ("scene.xml",)))
    include = {"scene.xml": scene('    <include filename="part.xml"/>\n'), "part.xml": _PART.encode()}
    made.append(Seed("include", "Mitsuba XML, include", "scene.xml", include, ("scene.xml", "part.xml")))
    meshes: list[tuple[str, str, bytes, str]] = [
        ("obj", "mesh.obj", OBJ.replace("mtllib mesh.mtl\n", "").encode(), ""),
        ("ply", "mesh.ply", ply(True), ""),
        ("serialized", "mesh.serialized", serialized(), '<integer name="shape_index" value="1"/>'),
    ]
    for kind, name, content, more in meshes:
        files = {"scene.xml": scene(MESHES.format(kind=kind, file=name, more=more)), name: content}
        made.append(Seed(f"xml with {kind}", f"Mitsuba XML with {kind}", "scene.xml", files, (name, name, "scene.xml")))
    for name, content in (("smoke.vol", vol()), ("smoke.npy", npy())):
        files = {"scene.xml": scene(VOLUME.format(file=name)), name: content}
        made.append(Seed(f"volume {name[-3:]}", f"{name[-3:].upper()} volume", "scene.xml", files, (name,)))
    gltf = {"scene.gltf": json.dumps(gltf_document("data.bin")).encode(), "data.bin": buffer(), "tex.png": png()}
    made.append(Seed("gltf", "glTF", "scene.gltf", gltf, ("scene.gltf", "scene.gltf", "scene.gltf", "data.bin")))
    made.append(Seed("glb", "GLB", "scene.glb", {"scene.glb": glb(), "tex.png": png()}, ("scene.glb",)))
    obj = {"mesh.obj": OBJ.encode(), "mesh.mtl": MTL.encode(), "tex.png": png()}
    made.append(Seed("obj", "OBJ", "mesh.obj", obj, ("mesh.obj",)))
    made.append(Seed("mtl", "MTL", "mesh.obj", obj, ("mesh.mtl",)))
    for name, write in _MESH_FILES.items():
        made.append(Seed(name, name.split()[0].upper(), f"mesh.{name[:3]}", {f"mesh.{name[:3]}": write()},
                         (f"mesh.{name[:3]}",)))  # fmt: skip
    return made


_MESH_FILES: dict[str, Callable[[], bytes]] = {
    "ply ascii": lambda: ply(False),
    "ply binary": lambda: ply(True),
    "stl ascii": lambda: stl(False),
    "stl binary": lambda: stl(True),
}
