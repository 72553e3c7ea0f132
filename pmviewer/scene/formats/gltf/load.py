"""glTF 2.0: nodes, cameras, lights and materials from its JSON; trimesh decodes the buffers.

The JSON is read here because trimesh keeps colours in 8 bits and knows neither lights nor material extensions.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from pmviewer.scene.description import Camera, DirectionalLight, Mesh, PointLight, Shape, SpotLight
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.material import GltfMaterials
from pmviewer.scene.formats.gltf.shared import SharedMeshes
from pmviewer.scene.formats.meshfile import DEFAULT_MATERIAL, MeshFile
from pmviewer.scene.formats.mitsuba.transform import Matrix, mirrors, scaling, translation
from pmviewer.scene.primitives import transformed

Json = dict[str, Any]
_LUMENS_PER_WATT = 683.0
_MOST_NODES = 1_000_000
_MOST_ITEMS = 1 << 28
_HARMLESS = ("KHR_materials_", "KHR_lights_punctual", "KHR_texture_", "EXT_texture_")
_UV = "_UV"
_GLB_JSON, _GLB_BIN = 0x4E4F534A, 0x004E4942


def read_gltf(path: Path, diagnostics: Diagnostics) -> MeshFile:
    """The default scene of a .gltf or .glb file. Damaged files raise SceneError or whatever their damage causes."""
    header, binary = _container(path.read_bytes(), diagnostics)
    for extension in header.get("extensionsRequired", []):
        if not str(extension).startswith(_HARMLESS):
            hint = "Export it without compression or quantization."
            raise diagnostics.error(
                f"The file needs the glTF extension {extension}, which is not supported.", hint=hint
            )
    for index, accessor in enumerate(header.get("accessors", [])):
        if not 0 <= int(accessor["count"]) <= _MOST_ITEMS:
            raise diagnostics.error(f"Accessor {index} claims {accessor['count']} items.", hint="The file is damaged.")
    for buffer in header.get("buffers", []):
        uri = str(buffer.get("uri", "data:"))
        if not uri.startswith("data:") and not (path.parent / unquote(uri)).is_file():
            hint = "Copy it beside the .gltf file, or export a .glb, which holds everything."
            raise diagnostics.error(f"The file's buffer {uri[:200]!r} does not exist.", hint=hint)
    for kind in ("skins", "animations"):
        if header.get(kind):
            diagnostics.warn(f"The file's {kind} are ignored.")
    meshes = _decode(header, binary, path)
    result = MeshFile()
    materials = GltfMaterials(header, binary, path, diagnostics)
    nodes = list(_nodes(header, diagnostics))
    shared = SharedMeshes(header, meshes, nodes)
    for node, matrix in nodes:
        instance = shared.instance(node, matrix, result, materials)
        if instance is not None:
            result.instances.append(instance)
        elif "mesh" in node:
            source = header["meshes"][node["mesh"]]
            for j, primitive in enumerate(source.get("primitives", [])):
                mesh = meshes.get(f"{node['mesh']}.{j}")
                if mesh is None:
                    diagnostics.warn("Points, lines and other primitives without triangles are ignored.")
                    continue
                index = primitive.get("material")
                material, radiance, emission = (DEFAULT_MATERIAL, None, None) if index is None else materials.of(index)
                name = str(node.get("name") or source.get("name") or f"mesh {node['mesh']}")
                shape = Shape(name, transformed(mesh, matrix), result.material(material), radiance, emission)
                result.shapes.append(shape)
        if "camera" in node and result.camera is None:
            _camera(header["cameras"][node["camera"]], matrix, result, diagnostics)
        light = node.get("extensions", {}).get("KHR_lights_punctual")
        if light is not None:
            lights = header["extensions"]["KHR_lights_punctual"]["lights"]
            _light(lights[light["light"]], matrix, result, diagnostics)
    return result


def _container(data: bytes, diagnostics: Diagnostics) -> tuple[Json, bytes]:
    """JSON header and binary chunk of either kind of file."""
    binary = b""
    text = data
    if data[:4] == b"glTF":
        if len(data) < 20:
            raise diagnostics.error("The GLB file is cut off.", hint="Export it again.")
        version, length = struct.unpack_from("<II", data, 4)
        if version != 2:
            raise diagnostics.error(f"This is glTF version {version}, expected 2.", hint="Convert it to glTF 2.0.")
        if length > len(data):
            what = f"The GLB file is cut off: {len(data)} of {length} bytes are there."
            raise diagnostics.error(what, hint="Copy or export it again.")
        offset = 12
        text = b""
        while offset + 8 <= length:
            size, kind = struct.unpack_from("<II", data, offset)
            chunk = data[offset + 8 : offset + 8 + size]
            if kind == _GLB_JSON:
                text = chunk
            elif kind == _GLB_BIN and not binary:
                binary = chunk
            offset += 8 + size
    try:
        header = json.loads(text)
    except (ValueError, RecursionError):
        raise diagnostics.error("This is not a glTF file (no readable JSON in it).", hint="Export it again.") from None
    if not isinstance(header, dict) or not str(header.get("asset", {}).get("version", "")).startswith("2"):
        raise diagnostics.error("This is not a glTF 2.0 file.", hint="Convert it to glTF 2.0.")
    return header, binary


def _decode(header: Json, binary: bytes, path: Path) -> dict[str, Mesh]:
    """Meshes by "mesh.primitive", in their own coordinates."""
    from trimesh.exchange.gltf import load_glb, load_gltf
    from trimesh.resolvers import FilePathResolver

    # Each primitive becomes a mesh of a known name, and the rest of the file is kept from trimesh.
    alone: Json = {key: header[key] for key in ("asset", "accessors", "bufferViews", "buffers") if key in header}
    alone["meshes"] = [
        {"name": f"{i}.{j}", "primitives": [_with_uv({k: v for k, v in primitive.items() if k != "material"})]}
        for i, mesh in enumerate(header.get("meshes", []))
        for j, primitive in enumerate(mesh.get("primitives", []))
    ]
    alone["nodes"], alone["scenes"], alone["scene"] = [], [{"nodes": []}], 0
    text = json.dumps(alone).encode()
    resolver = FilePathResolver(str(path))
    if binary:
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(binary)
        chunks = struct.pack("<4sIIII", b"glTF", 2, total, len(text), _GLB_JSON) + text
        chunks += struct.pack("<II", len(binary), _GLB_BIN) + binary
        loaded = load_glb(BytesIO(chunks), resolver=resolver, skip_materials=True)
    else:
        loaded = load_gltf(BytesIO(text), resolver=resolver, skip_materials=True)
    meshes = {}
    for name, kwargs in loaded["geometry"].items():
        if kwargs.get("faces") is None:
            continue
        vertices = np.asarray(kwargs["vertices"], np.float64)
        faces = np.asarray(kwargs["faces"]).reshape(-1, 3).astype(np.int32)
        normals = kwargs.get("vertex_normals")
        whole = normals is not None and np.shape(normals) == vertices.shape
        uv = kwargs.get("vertex_attributes", {}).get(_UV)
        meshes[name] = Mesh(
            vertices, faces, np.asarray(normals, np.float64) if whole else None, _coordinates(uv, len(vertices))
        )
    return meshes


def _with_uv(primitive: Json) -> Json:
    """The primitive with its texture coordinates under a name that trimesh hands through without materials."""
    attributes = dict(primitive.get("attributes", {}))
    if "TEXCOORD_0" in attributes:
        attributes[_UV] = attributes.pop("TEXCOORD_0")
    return {**primitive, "attributes": attributes}


def _coordinates(uv: Any, count: int) -> np.ndarray | None:
    """Texture coordinates (count, 2); whole numbers stand for fractions of their type's range."""
    if uv is None or np.shape(uv) != (count, 2):
        return None
    array = np.asarray(uv)
    if array.dtype.kind == "u":
        return array.astype(np.float64) / np.iinfo(array.dtype).max
    return array.astype(np.float64)


def _nodes(header: Json, diagnostics: Diagnostics) -> Iterator[tuple[Json, Matrix]]:
    """Every node of the default scene with its world matrix."""
    nodes = header.get("nodes", [])
    scenes = header.get("scenes")
    roots = scenes[header.get("scene", 0)].get("nodes", []) if scenes else range(len(nodes))
    stack: list[tuple[int, Matrix, frozenset[int]]] = [(i, np.eye(4), frozenset()) for i in reversed(roots)]
    count = 0
    while stack:
        index, parent, above = stack.pop()
        count += 1
        if index in above or count > _MOST_NODES:
            raise diagnostics.error("The file's nodes contain each other in a circle.", hint="The file is damaged.")
        node = nodes[index]
        matrix = parent @ _local(node)
        yield node, matrix
        inside = above | {index}
        stack += [(child, matrix, inside) for child in reversed(node.get("children", []))]


def _local(node: Json) -> Matrix:
    if "matrix" in node:
        return np.reshape(np.array(node["matrix"], np.float64), (4, 4)).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    length = math.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = (c / length for c in (x, y, z, w))
    turn = np.eye(4)
    turn[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return translation(*node.get("translation", (0, 0, 0))) @ turn @ scaling(*node.get("scale", (1, 1, 1)))


def _camera(camera: Json, matrix: Matrix, result: MeshFile, diagnostics: Diagnostics) -> None:
    """A glTF camera looks along its −z axis; the field of view is vertical."""
    if camera.get("type") != "perspective":
        diagnostics.warn(f"A camera of type '{camera.get('type')}' is ignored.")
        return
    lens = camera["perspective"]
    eye, up, forward = matrix[:3, 3], matrix[:3, 1], -matrix[:3, 2]
    target = eye + forward / np.linalg.norm(forward)
    result.aspect = float(lens.get("aspectRatio", 1.0))
    result.camera = Camera(
        origin=(float(eye[0]), float(eye[1]), float(eye[2])),
        target=(float(target[0]), float(target[1]), float(target[2])),
        up=(float(up[0]), float(up[1]), float(up[2])),
        fov=math.degrees(float(lens["yfov"])),
        fov_axis="y",
        near=float(lens.get("znear", 0.0)),
        far=float(lens.get("zfar", math.inf)),
        mirrored=mirrors(matrix),
    )


def _light(light: Json, matrix: Matrix, result: MeshFile, diagnostics: Diagnostics) -> None:
    """KHR_lights_punctual: candela become W/sr, and lux W/m², at the luminous efficacy that exporters use. Spots and
    directional lights shine along −z."""
    kind = light.get("type")
    if kind not in ("point", "spot", "directional"):
        diagnostics.warn(f"A light of type '{kind}' is not supported and was ignored.")
        return
    intensity = float(light.get("intensity", 1.0)) / _LUMENS_PER_WATT
    r, g, b = (float(c) * intensity for c in light.get("color", (1, 1, 1)))
    name = str(light.get("name") or f"{kind} light")
    x, y, z = (float(c) for c in matrix[:3, 3])
    if kind == "point":
        result.lights.append(PointLight(name, (x, y, z), (r, g, b)))
        return
    forward = -matrix[:3, 2]
    length = float(np.linalg.norm(forward))
    if not 0 < length < math.inf:
        diagnostics.warn(f"The {kind} light '{name}' has no direction and was ignored.")
        return
    dx, dy, dz = (float(c) for c in forward / length)
    if kind == "directional":
        result.lights.append(DirectionalLight(name, (dx, dy, dz), (r, g, b)))
        return
    cone = light.get("spot", {})
    inner = math.degrees(float(cone.get("innerConeAngle", 0.0)))
    outer = math.degrees(float(cone.get("outerConeAngle", math.pi / 4)))
    if not 0 <= inner < outer <= 90 * (1 + 1e-6):
        what = f"The spot light '{name}' has an inner angle of {inner:g}° and an outer one of {outer:g}°."
        raise diagnostics.error(what, hint="0 ≤ inner < outer ≤ 90 is what glTF allows.")
    diagnostics.warn("The intensity of spot lights falls linearly between their inner and outer angle.")
    result.lights.append(SpotLight(name, (x, y, z), (dx, dy, dz), (r, g, b), outer, inner))
