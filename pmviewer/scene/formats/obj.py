"""Wavefront OBJ with its MTL materials; trimesh decodes the geometry."""

from __future__ import annotations

import re
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.description import RGB, Material, Mesh, Shape
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.meshfile import DEFAULT_MATERIAL, MeshFile
from pmviewer.scene.formats.mtl_maps import load_maps, read_maps
from pmviewer.scene.primitives import fans
from pmviewer.scene.texture import Bitmap, Texture, limited, scaled

_TEXTURES, _BUMP_SCALE = " textures", " bump scale"
"""Beside the file's own keys, which have no spaces."""
_MIRROR_MODELS, _GLASS_MODELS = (3, 5, 8), (4, 6, 7, 9)


def obj_parts(path: Path, skip_materials: bool) -> list[tuple[str, Mesh, str | None]]:
    """Name, mesh and material name of every part of the file."""
    from trimesh.exchange.obj import load_obj
    from trimesh.resolvers import FilePathResolver

    resolver = FilePathResolver(str(path))
    loaded = load_obj(BytesIO(as_utf8(path.read_bytes())), resolver=resolver, skip_materials=skip_materials)
    parts = []
    for name, kwargs in loaded.get("geometry", {}).items():
        vertices = np.asarray(kwargs["vertices"], np.float64)
        if vertices.shape[1:] != (3,):
            raise SceneError("The OBJ file's vertices do not have three coordinates each.", path)
        faces = fans(np.asarray(kwargs["faces"])).astype(np.int32)  # quads come as quads
        normals = kwargs.get("vertex_normals")
        visual = kwargs.get("visual")
        uv = getattr(visual, "uv", None)
        if uv is not None and np.shape(uv)[:1] == vertices.shape[:1] and np.shape(uv)[1] >= 2:
            # The format counts v from a picture's lower edge.
            uv = np.asarray(uv, np.float64)[:, :2] * [1, -1] + [0, 1]
        else:
            uv = None
        mesh = Mesh(vertices, faces, None if normals is None else np.asarray(normals, np.float64), uv)
        parts.append((str(name), mesh, str(visual.material.name) if visual is not None else None))
    return parts


def as_utf8(data: bytes) -> bytes:
    """Text of an older encoding as UTF-8, which is all that trimesh reads without a further package."""
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1").encode("utf-8")
    return data


def joined(meshes: list[Mesh]) -> Mesh:
    """All parts as one mesh; normals and texture coordinates survive only if every part has them."""
    offsets = np.cumsum([0] + [len(m.vertices) for m in meshes[:-1]])
    vertices = np.concatenate([m.vertices for m in meshes])
    faces = np.concatenate([m.faces + o for m, o in zip(meshes, offsets)]).astype(np.int32)
    normals = [m.normals for m in meshes if m.normals is not None]
    uvs = [m.uv for m in meshes if m.uv is not None]
    return Mesh(
        vertices,
        faces,
        np.concatenate(normals) if len(normals) == len(meshes) else None,
        np.concatenate(uvs) if len(uvs) == len(meshes) else None,
    )


def read_obj(path: Path, diagnostics: Diagnostics) -> MeshFile:
    """The file's parts with their materials."""
    materials = _libraries(path, diagnostics)
    result = MeshFile()
    built: dict[str, tuple[Material, RGB | None, Texture | None]] = {}
    for name, mesh, material_name in obj_parts(path, skip_materials=not materials):
        material, radiance, emission = DEFAULT_MATERIAL, None, None
        if material_name in materials:
            if material_name not in built:
                built[material_name] = _material(material_name, materials[material_name], diagnostics)
            material, radiance, emission = built[material_name]
        # trimesh names nameless parts after the file it was given.
        shape_name = path.stem if name in ("geometry", path.name) else name
        result.shapes.append(Shape(shape_name, mesh, result.material(material), radiance, emission))
    return result


def _libraries(path: Path, diagnostics: Diagnostics) -> dict[str, dict[str, Any]]:
    """Materials of all MTL files that the OBJ names."""
    from trimesh.exchange.obj import parse_mtl
    from trimesh.resolvers import FilePathResolver

    materials: dict[str, dict[str, Any]] = {}
    text = path.read_bytes().decode("utf-8", "replace")
    for match in re.finditer(r"^[ \t]*mtllib[ \t]+(.+?)[ \t\r]*$", text, re.MULTILINE):
        library = path.parent / match[1]
        line = text.count("\n", 0, match.start()) + 1
        if not library.is_file():
            diagnostics.warn(f"The material file {match[1]!r} does not exist: grey replaces its materials.", line)
            continue
        content = as_utf8(library.read_bytes())
        maps, ignored = read_maps(content.decode("utf-8"))
        if ignored:
            diagnostics.warn(f"The textures {', '.join(sorted(ignored))} are ignored.")
        # Pictures are read here, so trimesh need not know of them.
        plain = re.sub(rb"(?im)^[ \t]*map_kd[ \t].*$", b"", content)
        for name, m in parse_mtl(plain, resolver=FilePathResolver(str(library))).items():
            m[_TEXTURES] = load_maps(maps.get(" ".join(name.split()), {}), library, diagnostics)
            if "bump" in maps.get(name, {}):
                m[_BUMP_SCALE] = maps[name]["bump"].factor
            materials[name] = m
    return materials


def _numbers(m: dict[str, Any], key: str, default: float) -> RGB:
    """Three numbers of an MTL statement; one number counts for all channels."""
    value = m.get(key)
    if value is None:
        return (default, default, default)
    numbers = [float(x) for x in (value if isinstance(value, list) else [value])]
    r, g, b = numbers[:3] if len(numbers) >= 3 else numbers[:1] * 3
    return (max(0.0, r), max(0.0, g), max(0.0, b))


def _material(name: str, m: dict[str, Any], diagnostics: Diagnostics) -> tuple[Material, RGB | None, Texture | None]:
    """Kd, Ks, Ke, Ni, the illumination model and the maps as a material, the radiance it emits and its texture."""
    kd, ks, ke = _numbers(m, "kd", 0.7), _numbers(m, "ks", 0.0), _numbers(m, "ke", 0.0)
    model = int(_numbers(m, "illum", 2)[0])
    maps: dict[str, Bitmap] = m[_TEXTURES]
    textures: dict[str, Texture] = {}
    if model in _GLASS_MODELS:
        tint = _numbers(m, "tf", 1.0)
        material = Material(name, "dielectric", (1.0, 1.0, 1.0), _capped(tint), eta=max(1.0, _numbers(m, "ni", 1.5)[0]))
    elif model in _MIRROR_MODELS and max(ks) >= 0.5 and max(ks) > max(kd):
        ks, colour = _textured(ks, maps.get("ks"), 1.0)
        if colour is not None:
            textures["reflectance"] = colour
        material = Material(name, "conductor", _capped(ks), two_sided=True)
    else:
        if _numbers(m, "d", 1.0)[0] < 1:
            diagnostics.warn("Transparency (d) is ignored except in the glass models (illum 4, 6, 7, 9).")
        kd, colour = _textured(kd, maps.get("kd"), 1.0)
        if colour is not None:
            textures["reflectance"] = colour
        material = Material(name, "diffuse", _capped(kd), two_sided=True)
    if "bump" in maps:
        textures["bump"] = maps["bump"]
    if "norm" in maps:
        textures["normal"] = maps["norm"]
    ke, emission = _textured(ke, maps.get("ke"), None)
    material = replace(material, textures=textures, bump_scale=float(m.get(_BUMP_SCALE, 1.0)))
    return (material, ke, emission) if max(ke) > 0 else (material, None, None)


def _textured(colour: RGB, bitmap: Bitmap | None, most: float | None) -> tuple[RGB, Texture | None]:
    """The colour times a map's mean, and the map times the colour; a black colour leaves the map as it is."""
    if bitmap is None:
        return colour, None
    texture, _ = limited(scaled(bitmap, colour if any(colour) else (1.0, 1.0, 1.0)), most)
    return texture.mean, texture


def _capped(colour: RGB) -> RGB:
    r, g, b = (min(1.0, c) for c in colour)
    return (r, g, b)
