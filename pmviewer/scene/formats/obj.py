"""Wavefront OBJ: triangles by material. What its statements say is read in `obj_text`, its materials in `mtl`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels.meshes.corners import add_normals, compact, merge
from pmviewer.kernels.meshes.polygons import count_triangles, triangulate
from pmviewer.progress import stage
from pmviewer.scene.arrays.primitives import unit
from pmviewer.scene.description import Mesh, Shape
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.meshfile import DEFAULT_MATERIAL, MeshFile
from pmviewer.scene.formats.mtl import MtlMaterial, read_libraries
from pmviewer.scene.formats.obj_text import MISSING, ObjText, read_text
from pmviewer.scene.formats.open_file import read_regular
from pmviewer.scene.formats.texture_file import linear

Ints = NDArray[np.int32]
Float = NDArray[np.float64]
_OWN = -(1 << 30)
"""Numbers of normals below it stand for those of single triangles, −2 − s for those of the smoothing group s."""
_CURVES = frozenset(("curv", "curv2", "surf", "vp", "cstype", "con", "bsp", "bzp", "cdc", "cdp", "res"))


@dataclass
class _Sections:
    """What holds from a face on: `first` (k,) the faces, and for each the material's and the group's name and the
    smoothing group (0: none)."""

    first: list[int]
    material: list[str | None]
    group: list[str]
    smoothing: list[int]
    libraries: list[tuple[str, int]]


def read_obj(path: Path, diagnostics: Diagnostics) -> MeshFile:
    """The file's triangles, one shape a material; those that emit are apart by group, so that each lamp is a light.

    Raises SceneError for a file without triangles.
    """
    text = _text(path)
    sections = _sections(text, diagnostics)
    materials = read_libraries(path, sections.libraries, diagnostics)
    materials.light_up(m for m in sections.material if m is not None)
    keys: list[tuple[str | None, str]] = []
    numbers: dict[tuple[str | None, str], int] = {}
    of_section = []
    missing: dict[str, None] = {}
    for material, group in zip(sections.material, sections.group):
        if material is not None and material not in materials:
            missing[material] = None
            material = None
        emits = material is not None and materials[material].radiance is not None
        key = (material, group if emits else "")
        if key not in numbers:
            numbers[key] = len(keys)
            keys.append(key)
        of_section.append(numbers[key])
    result = MeshFile()
    wants_uv = [name is not None and materials[name].textured for name, _ in keys]
    meshes = _meshes(text, path, diagnostics, sections, of_section, wants_uv)
    if missing and materials:
        names = ", ".join(f"'{m[:60]}'" for m in list(missing)[:5]) + (" …" if len(missing) > 5 else "")
        diagnostics.warn(f"No material file defines the materials {names}: grey replaces them.")
    for (name, group), mesh in zip(keys, meshes):
        if mesh is None:
            continue
        found = materials[name] if name is not None else MtlMaterial(DEFAULT_MATERIAL)
        shape_name = " ".join(part for part in (group, name) if part) or path.stem
        look = found.with_vertex_colours() if mesh.colours is not None else found.material
        result.shapes.append(Shape(shape_name, mesh, result.material(look), found.radiance, found.emission))
    materials.tell_missing()
    return result


def read_single(path: Path) -> Mesh:
    """All of an OBJ file as one mesh, without materials. It has normals only if all of its corners have them, and
    texture coordinates if any has; the others are (0, 0) then. Raises SceneError."""
    diagnostics = Diagnostics(path)
    text = _text(path)
    if text.corner_vn is not None and not ((text.corner_vn >= 0) & (text.corner_vn < len(text.vn))).all():
        text.corner_vn = None
    one = _Sections([0], [None], [""], [0], [])
    (mesh,) = _meshes(text, path, diagnostics, one, [0], [True])
    assert mesh is not None
    return mesh


def _text(path: Path) -> ObjText:
    data = read_regular(path)
    if not data:
        raise SceneError("The file is empty (0 bytes).", path, hint="Export it again.")
    return read_text(data)


def _sections(text: ObjText, diagnostics: Diagnostics) -> _Sections:
    """What holds for which faces, and the material files that are named."""
    result = _Sections([0], [None], [""], [0], [])
    material: str | None = None
    group, smoothing = "", 0
    strange: dict[str, int] = {}
    for word, argument, line, face in text.statements():
        if word == "usemtl":
            material = argument or None
        elif word in ("g", "o"):
            group = argument
        elif word == "s":
            smoothing = int(argument) & 0xFFFFFF if argument.isascii() and argument.isdigit() else 0
        elif word == "mtllib":
            result.libraries.append((argument, line))
            continue
        else:
            strange.setdefault(word, line)
            continue
        if result.first[-1] == face:
            result.material[-1], result.group[-1], result.smoothing[-1] = material, group, smoothing
        elif (result.material[-1], result.group[-1], result.smoothing[-1]) != (material, group, smoothing):
            result.first.append(face)
            result.material.append(material)
            result.group.append(group)
            result.smoothing.append(smoothing)
    curved = sorted(strange.keys() & _CURVES)
    if curved:
        diagnostics.warn(f"Curves and curved surfaces ({', '.join(curved)}) are left out.", strange[curved[0]])
    if text.ignored:
        diagnostics.warn(f"{text.ignored:,} lines and points are left out: they have no surface.")
    return result


def _meshes(
    text: ObjText, path: Path, diagnostics: Diagnostics, sections: _Sections, part_of: list[int], uv_of: list[bool]
) -> list[Mesh | None]:
    """The triangles of each part, None for those that have none."""
    n_parts = len(uv_of)
    if len(text.v) and np.isnan(text.v[:, 2]).all():
        raise SceneError("The OBJ file's vertices do not have three coordinates each.", path)
    triangles, owner = _triangles(text, path, diagnostics)
    section = np.array([0])
    if len(sections.first) > 1:
        lengths = np.diff([*sections.first, len(text.starts) - 1])
        section = np.repeat(np.arange(len(lengths), dtype=np.int32), lengths)[owner]
    smoothing = np.array(sections.smoothing, np.int32)[section]
    parts = np.array(part_of, np.int32)[section]
    bounds = np.array([0, len(triangles)])
    if n_parts > 1:
        order = np.argsort(parts, kind="stable")
        triangles, parts, smoothing = triangles[order], parts[order], smoothing[order]
        bounds = np.searchsorted(parts, np.arange(n_parts + 1))
    stage("joining the corners")
    corners = triangles.reshape(-1)
    v = text.corners[corners]
    vt = _chosen(text.corner_vt, corners, len(text.vt)) if any(uv_of) else np.empty(0, np.int32)
    vn = _normal_numbers(text, corners, smoothing, parts, bounds)
    if not len(vt) and not len(vn):
        faces, keys = v.reshape(-1, 3), None
    else:
        merged, keys = np.empty(len(v), np.int32), np.empty((len(v), 3), np.int32)
        used = merge(v, vt, vn, np.full(len(text.v), -1, np.int32), np.empty(len(v), np.int32), keys, merged)
        faces, keys = merged.reshape(-1, 3), keys[:used].copy()
    normals = None if keys is None or not len(vn) else _normals(text, v, vn, faces.reshape(-1), keys)
    ids, id_starts = np.empty(faces.size, np.int32), np.zeros(n_parts + 1, np.int64)
    n_vertices = len(text.v) if keys is None else len(keys)
    scratch = np.empty(n_vertices, np.int32), np.full(n_vertices, -1, np.int32)
    compact(faces, bounds.astype(np.int64), *scratch, ids, id_starts)
    meshes: list[Mesh | None] = []
    for p in range(n_parts):
        own = ids[id_starts[p] : id_starts[p + 1]]
        if not len(own):
            meshes.append(None)
            continue
        places = own if keys is None else keys[own, 0]
        part_normals = None if normals is None else normals[own]
        if part_normals is not None and np.isnan(part_normals[:, 0]).all():
            part_normals = None
        uv = None
        if uv_of[p] and keys is not None and len(vt):
            uv = _coordinates(text.vt, keys[own, 1])
        part = np.ascontiguousarray(faces[bounds[p] : bounds[p + 1]])
        meshes.append(Mesh(text.v[places], part, part_normals, uv, _colours(text.colours, places)))
    return meshes


def _triangles(text: ObjText, path: Path, diagnostics: Diagnostics) -> tuple[Ints, Ints]:
    """Triangles (n, 3) as places in the file's list of corners, and the face that each is of."""
    n_faces, n_corners = len(text.starts) - 1, len(text.corners)
    usable = np.ones(n_faces, np.bool_)
    bad = (text.corners < 0) | (text.corners >= len(text.v))
    if bad.any():
        face_of = np.repeat(np.arange(n_faces), np.diff(text.starts))
        usable[face_of[bad]] = False
        count = int(n_faces - usable.sum())
        if count < n_faces:
            diagnostics.dropped["face with a vertex that does not exist"] += count
        else:
            what = f"All {count:,} faces use vertices that do not exist (there are {len(text.v):,})."
            raise SceneError(what, path, hint="The mesh file is damaged: export it again.")
    if n_faces and n_corners == 3 * n_faces and usable.all() and (np.diff(text.starts) == 3).all():
        everything: Ints = np.arange(n_corners, dtype=np.int32)
        return everything.reshape(-1, 3), everything[:n_faces]
    n = count_triangles(text.starts, usable)
    if not n:
        hint = "Is it an OBJ file? Export it with triangles."
        raise SceneError("The OBJ file has no faces.", path, hint=diagnostics.left_out() or hint)
    triangles, owner = np.empty((n, 3), np.int32), np.empty(n, np.int32)
    found = triangulate(text.v, text.corners, text.starts, usable, triangles, owner)
    return triangles[:found], owner[:found]


def _chosen(index: Ints | None, corners: Ints, n: int) -> Ints:
    """The corners' indices, MISSING for those that have none or one that is not there; empty if none has one."""
    if index is None or not n:
        return np.empty(0, np.int32)
    chosen = index[corners]
    return np.where((chosen >= 0) & (chosen < n), chosen, np.int32(MISSING))


def _normal_numbers(text: ObjText, corners: Ints, smoothing: Ints, parts: Ints, bounds: NDArray[np.int64]) -> Ints:
    """For each corner the number of its normal in the file, that of its smoothing group, or, in a part where others
    have one, that of its triangle. Empty where all triangles are flat."""
    numbers = _chosen(text.corner_vn, corners, len(text.vn))
    n = len(corners) // 3
    groups = np.broadcast_to(smoothing, n)
    if not len(numbers):
        if not smoothing.any():
            return numbers
        numbers = np.full(len(corners), MISSING, np.int32)
    missing = numbers == MISSING
    if not missing.any():
        return numbers
    triangle = np.repeat(np.arange(n, dtype=np.int32), 3)
    smooth = missing & (groups[triangle] > 0)
    numbers[smooth] = -2 - groups[triangle[smooth]]
    flat = numbers == MISSING
    if flat.any():
        has_others = np.zeros(len(bounds) - 1, np.bool_)
        of_triangle = np.broadcast_to(parts, n)
        has_others[of_triangle[triangle[~flat]]] = True
        own = flat & has_others[of_triangle[triangle]]
        numbers[own] = _OWN - triangle[own]
    return numbers


def _normals(text: ObjText, v: Ints, vn: Ints, vertex: Ints, keys: Ints) -> Float:
    """The normal of each vertex, NaN in parts that are flat. `v`, `vn` and `vertex` are the corners' positions,
    normals and vertices, `keys` (vertices, 3) the vertices' triples."""
    result = np.full((len(keys), 3), np.nan)
    given = keys[:, 2] >= 0
    result[given] = text.vn[keys[given, 2]]
    made = keys[:, 2] < MISSING
    if not made.any():
        return result
    # Vertices that differ in their texture coordinates alone share a normal.
    _, shared = np.unique(keys[made][:, [0, 2]], axis=0, return_inverse=True)
    group = np.full(len(keys), -1, np.int64)
    group[made] = shared.reshape(-1)
    sums = np.zeros((int(group.max()) + 1, 3))
    add_normals(text.v, v, group[vertex], sums)
    result[made] = unit(sums)[group[made]]
    return result


def _coordinates(vt: Float, index: Ints) -> Float:
    """(n, 2); the format counts v from a picture's lower edge."""
    uv = np.zeros((len(index), 2))
    given = index >= 0
    uv[given] = vt[index[given]] * [1, -1] + [0, 1]
    return uv


def _colours(colours: Float | None, places: Ints) -> Float | None:
    """Linear colours of a part's vertices, white where one has none; None if none has one. Programs write what they
    show, encoded as sRGB, from 0 to 1, some from 0 to 255."""
    if colours is None:
        return None
    own = colours[places]
    known = ~np.isnan(own)
    if not known.any():
        return None
    own = np.where(known, own, 1.0)
    encoded = own / 255 if own.max() > 1.5 else own
    return linear(np.clip(encoded, 0.0, 1.0).astype(np.float32)).astype(np.float64)
