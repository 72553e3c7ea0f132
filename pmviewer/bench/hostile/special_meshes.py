"""glTF, OBJ, PLY and STL files whose numbers promise more than there is, or that go round in circles."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from typing import Any

from pmviewer.bench.hostile.seeds import MTL, OBJ, buffer, glb, gltf_document, ply, png, stl
from pmviewer.bench.hostile.special import Files, Maker, Special

MAINS = {"glTF": "scene.gltf", "GLB": "scene.glb", "PLY": "mesh.ply", "STL": "mesh.stl", "OBJ": "mesh.obj",
         "MTL": "mesh.obj"}  # fmt: skip
MANY = 100_000_000
SPARSE = {
    "count": 1,
    "indices": {"bufferView": 2, "componentType": 5123},
    "values": {"bufferView": 0},
}
DRACO = {"bufferView": 0, "attributes": {"POSITION": 0}}
MESHOPT = {"buffer": 0, "byteOffset": 0, "byteLength": 60, "byteStride": 12, "count": 10**9, "mode": "ATTRIBUTES"}


def specials() -> list[tuple[str, Maker]]:
    """All of this kind."""
    table: list[tuple[str, str, Callable[[], Files]]] = [
        ("accessor of 10^8 without a view", "glTF", partial(_accessor, bufferView=None, count=MANY)),
        ("accessor of 10^12", "glTF", partial(_accessor, count=10**12)),
        ("sparse accessor of 10^8", "glTF", partial(_accessor, bufferView=None, count=MANY, sparse=SPARSE)),
        ("buffer of 10^12 bytes", "glTF", _long_buffer),
        ("nodes in a chain of 20 000", "glTF", partial(_nodes, 20_000, lambda i: [i + 1])),
        ("nodes that double 40 times", "glTF", partial(_nodes, 41, lambda i: [i + 1, i + 1])),
        ("node its own child", "glTF", partial(_nodes, 2, lambda i: [i])),
        ("300 000 nodes", "glTF", partial(_nodes, 300_000, lambda i: list(range(1, 300_000)) if i == 0 else [])),
        ("base64 of 30 MB", "glTF", _base64),
        ("base64 that isn't", "glTF", lambda: _gltf(gltf_document("data:;base64,%%%%"))),
        ("draco without data", "glTF", lambda: _gltf(_compressed("KHR_draco_mesh_compression", "meshes", DRACO))),
        ("meshopt of 10^9", "glTF", lambda: _gltf(_compressed("EXT_meshopt_compression", "bufferViews", MESHOPT))),
        ("GLB of 4 GiB by its header", "GLB", lambda: _glb(glb()[:8] + b"\xff" * 4 + glb()[12:])),
        ("GLB chunk of 4 GiB", "GLB", lambda: _glb(glb()[:12] + b"\xff" * 4 + glb()[16:])),
        ("GLB in itself", "GLB", lambda: _glb(glb(tail=glb()))),
        ("PLY of 10^12 vertices", "PLY", partial(_ply, b"vertex 5", b"vertex 1000000000000")),
        ("PLY of negative vertices", "PLY", partial(_ply, b"vertex 5", b"vertex -5")),
        ("PLY of 200 000 properties", "PLY", partial(_ply, b"property float x\n", b"property float x\n" * 200_000)),
        ("PLY list of 2^32", "PLY", _ply_list),
        ("PLY without end of header", "PLY", _ply_endless),
        ("STL of 2^32 facets", "STL", lambda: {"mesh.stl": stl(True)[:80] + b"\xff" * 4 + stl(True)[84:]}),
        ("STL solid and binary", "STL", lambda: {"mesh.stl": b"solid" + stl(True)[5:]}),
        ("OBJ with a face of 10^6 corners", "OBJ", lambda: _obj(b"f" + b" 1 2 3 4" * 250_000 + b"\n")),
        ("OBJ with far indices", "OBJ", lambda: _obj(b"f 999999999999999999999 2 3\nf -1 -2 -999999999\nf 0 0 0\n")),
        ("OBJ with 100 000 groups", "OBJ", _obj_groups),
        ("OBJ with a line of 20 MB", "OBJ", lambda: _obj(b"#" + b"x" * 20_000_000)),
        ("OBJ that is a picture", "OBJ", lambda: {"mesh.obj": png(64, 64)}),
        ("MTL its own library", "MTL", lambda: {"mesh.obj": OBJ.encode().replace(b"mesh.mtl", b"mesh.obj")}),
    ]  # fmt: skip
    return [(name, partial(_made, format_, files)) for name, format_, files in table]


def _made(format_: str, files: Callable[[], Files]) -> Special:
    return Special(format_, MAINS[format_], files())


def _gltf(document: Any) -> Files:
    return {"scene.gltf": json.dumps(document).encode(), "data.bin": buffer(), "tex.png": png()}


def _glb(content: bytes) -> Files:
    return {"scene.glb": content, "tex.png": png()}


def _accessor(**changes: Any) -> Files:
    document: Any = gltf_document("data.bin")
    accessor = document["accessors"][0] | changes
    document["accessors"][0] = {key: value for key, value in accessor.items() if value is not None}
    return _gltf(document)


def _long_buffer() -> Files:
    document: Any = gltf_document("data.bin")
    document["buffers"][0]["byteLength"] = document["bufferViews"][0]["byteLength"] = 10**12
    return _gltf(document)


def _nodes(count: int, children: Callable[[int], list[int]]) -> Files:
    """Nodes with a mesh each; children beyond the last node are left out."""
    document: Any = gltf_document("data.bin")
    document["nodes"] = [{"mesh": 0, "children": [c for c in children(i) if c < count]} for i in range(count)]
    document["scenes"] = [{"nodes": [0]}]
    return _gltf(document)


def _base64() -> Files:
    return _gltf(gltf_document("data:application/octet-stream;base64," + "A" * 30_000_000))


def _compressed(name: str, where: str, content: Any) -> Any:
    document: Any = gltf_document("data.bin")
    document["extensionsUsed"] = document["extensionsRequired"] = [name]
    holder = document[where][0]
    (holder["primitives"][0] if where == "meshes" else holder)["extensions"] = {name: content}
    return document


def _ply(what: bytes, instead: bytes) -> Files:
    return {"mesh.ply": ply(True).replace(what, instead)}


def _ply_list() -> Files:
    content = ply(True).replace(b"list uchar int", b"list uint int")
    return {"mesh.ply": content[:-78] + b"\xff" * 78}


def _ply_endless() -> Files:
    return {"mesh.ply": b"ply\nformat ascii 1.0\n" + b"comment x\n" * 500_000}


def _obj_groups() -> Files:
    return _obj(b"".join(b"g %d\nusemtl %d\nf 1 2 3\n" % (i, i) for i in range(100_000)))


def _obj(more: bytes) -> Files:
    return {"mesh.obj": OBJ.encode() + more, "mesh.mtl": MTL.encode(), "tex.png": png()}
