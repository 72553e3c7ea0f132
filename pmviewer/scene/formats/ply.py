"""PLY meshes, text and binary. Own reader: every bundled scene needs it at start and must not wait for imports."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.kernels.meshes.polygons import count_triangles, triangulate
from pmviewer.kernels.meshes.rows import strips
from pmviewer.scene.description import Mesh
from pmviewer.scene.formats.open_file import read_regular
from pmviewer.scene.formats.ply_table import Column, Columns, ListColumn, read_columns, read_header

Ints = NDArray[np.int32]
Float = NDArray[np.float64]
_COORDINATES = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
_COLOURS = (
    ("red", "green", "blue"),
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("color_0", "color_1", "color_2"),  # as Mitsuba 3 writes them
)
_RGB = ("r", "g", "b")
_FACE_LISTS = ("vertex_indices", "vertex_index")
_FACE_ELEMENTS = ("face", "faces", "polygon", "triangle")


@dataclass(frozen=True)
class PlyFile:
    """The mesh, the picture that a comment names ("" for none), whether texture coordinates count v from a picture's
    lower edge, and sentences about what was left out."""

    mesh: Mesh
    picture: str = ""
    notes: tuple[str, ...] = ()


def read_ply(path: Path, attribute: str = "") -> Mesh:
    """The file's triangles (polygons are cut), with its normals, texture coordinates and colours if it has them.

    Colours of one byte are decoded from sRGB, others are taken as linear. Where vertices and faces have some, those of
    the vertices count. With an `attribute` in Mitsuba's words ("face_color", "vertex_temperature" …) its values are the
    colours, and there are none where the file lacks it. Raises SceneError for anything unreadable; indices are checked
    by `clean`.
    """
    return read_ply_file(path, attribute).mesh


def read_ply_file(path: Path, attribute: str = "") -> PlyFile:
    """`read_ply` with what the file says besides. Raises SceneError."""
    data = read_regular(path, "The mesh")
    if not data:
        raise SceneError("The PLY file is empty (0 bytes).", path, hint="Export the mesh again.")
    header = read_header(data, path)
    columns = read_columns(data, header, path)
    vertex = {name: c for name, c in columns.get("vertex", {}).items() if not isinstance(c, ListColumn)}
    if not {"x", "y", "z"} <= vertex.keys():
        vertex = {name.lower(): column for name, column in vertex.items()}
    if any(element.name == "vertex" and not element.count for element in header.elements):
        raise SceneError("The PLY file has no vertices.", path, hint="Export it with its mesh.")
    if not {"x", "y", "z"} <= vertex.keys():
        raise SceneError("The PLY file has no vertex positions x, y, z.", path)
    notes = []
    vertices = _stack(vertex, ("x", "y", "z"))
    faces, owner, face = _faces(columns, vertices, path)
    has_normals = {"nx", "ny", "nz"} <= vertex.keys()
    pair = next((names for names in _COORDINATES if set(names) <= vertex.keys()), None)
    mesh = Mesh(
        vertices,
        faces,
        _stack(vertex, ("nx", "ny", "nz")) if has_normals else None,
        None if pair is None else _stack(vertex, pair),
        _values(vertex, attribute, "vertex_"),
    )
    wedges = face.get("texcoord")
    if isinstance(wedges, ListColumn) and mesh.uv is None and owner is None and len(wedges.items) == 6 * len(faces):
        mesh = replace(_apart(mesh), uv=wedges.items.reshape(-1, 2).astype(np.float64))
    of_faces = _values({name: c for name, c in face.items() if not isinstance(c, ListColumn)}, attribute, "face_")
    if of_faces is not None and mesh.colours is None:
        each = of_faces if owner is None else of_faces[owner]
        mesh = replace(_apart(mesh), colours=np.repeat(each, 3, axis=0))
    alpha = vertex.get("alpha")
    if alpha is not None and mesh.colours is not None and (alpha < (255 if alpha.dtype.kind == "u" else 1)).any():
        notes.append("The transparency of the vertices' colours (alpha) is ignored: they are shown opaque.")
    pictures = [c.split(None, 1)[1].strip() for c in header.comments if c.lower().startswith("texturefile ")]
    return PlyFile(mesh, pictures[0] if pictures else "", tuple(notes))


def _stack(columns: dict[str, NDArray], names: tuple[str, ...]) -> Float:
    out = np.empty((len(columns[names[0]]), len(names)))
    with np.errstate(invalid="ignore"):  # of NaNs that signal
        for i, name in enumerate(names):
            out[:, i] = columns[name]
    return out


def _colours(columns: dict[str, NDArray]) -> Float | None:
    """(n, 3) linear RGB of an element, None if it has no colours."""
    names = next((names for names in _COLOURS if set(names) <= columns.keys()), None)
    if names is None:
        return None
    kind = columns[names[0]].dtype
    values = _stack(columns, names)
    whole = {"u1": 255.0, "u2": 65535.0}.get(kind.str[1:])
    if whole is None and kind.kind == "f" and values.max(initial=0.0) > 1.5 and (values == np.round(values)).all():
        whole = 255.0  # the bytes of a text, or of a program that writes floats only
    if whole is None:
        return values
    from pmviewer.scene.formats.texture_file import linear

    return linear(np.clip(values / whole, 0, 1).astype(np.float32)).astype(np.float64)


def _values(columns: dict[str, NDArray], attribute: str, of: str) -> Float | None:
    """(n, 3) values of an attribute of vertices or faces, which `of` ("vertex_", "face_") says; their colours where no
    attribute is asked for. None if there are none.

    As Mitsuba 3 names them: the columns of `face_w` are w_0, w_1, w_2 or w_x …, one or three of them; w_r, w_g, w_b are
    `face_w_color`."""
    if not attribute:
        return _colours(columns)
    if not attribute.startswith(of):
        return None
    name = attribute.removeprefix(of)
    colours = _colours(columns) if name == "color" else None
    if colours is not None:
        return colours
    own = [c for c in columns if "_" in c and c.rpartition("_")[0] == name and c.rpartition("_")[2] not in _RGB]
    if name.endswith("_color"):
        own += [c for c in columns if c in [f"{name.removesuffix('_color')}_{k}" for k in _RGB]]
    return np.repeat(_stack(columns, tuple(own)), 3 // len(own), axis=1) if len(own) in (1, 3) else None


def _apart(mesh: Mesh) -> Mesh:
    """The mesh with corners of its own for each triangle."""
    index = mesh.faces.reshape(-1)
    index = np.where((index >= 0) & (index < len(mesh.vertices)), index, 0)
    own = [None if a is None else a[index] for a in (mesh.normals, mesh.uv, mesh.colours)]
    faces = np.arange(len(index), dtype=np.int32).reshape(-1, 3)
    bad = ((mesh.faces < 0) | (mesh.faces >= len(mesh.vertices))).any(axis=1)
    faces[bad] = -1
    return Mesh(mesh.vertices[index], faces, *own)


def _faces(columns: dict[str, Columns], vertices: Float, path: Path) -> tuple[Ints, Ints | None, Columns]:
    """Triangles (n, 3), the face of each (None: its own number), and the element's other columns."""
    face = next((columns[name] for name in _FACE_ELEMENTS if name in columns), {})
    lists = _list_of(face)
    if lists is None:
        strip = _list_of(columns.get("tristrips", {}))
        if strip is None:
            what = f"The PLY file has no faces: it is a cloud of {len(vertices):,} points."
            if "range_grid" in columns:
                what = "The PLY file is a raw range scan: a grid of points without faces."
            raise SceneError(what, path, hint="Open it in a program that makes a surface of it, such as MeshLab.")
        out = np.empty((len(strip.items), 3), np.int32)
        indices = _indices(strip.items)
        return out[: strips(indices, strip.starts, out)].copy(), None, {}
    corners = _indices(lists.items)
    sizes = np.diff(lists.starts)
    if (sizes == 3).all():
        return corners.reshape(-1, 3), None, face
    usable = np.ones(len(sizes), np.bool_)
    bad = (corners < 0) | (corners >= len(vertices))
    if bad.any():
        which = int(np.searchsorted(lists.starts, np.flatnonzero(bad)[0], "right")) - 1
        what = f"Face {which} uses a vertex that does not exist (there are {len(vertices)})."
        raise SceneError(what, path, hint="The mesh file is damaged: export it again.")
    n = count_triangles(lists.starts, usable)
    places, owner = np.empty((n, 3), np.int32), np.empty(n, np.int32)
    triangulate(vertices, corners, lists.starts, usable, places, owner)
    return corners[places], owner, face


def _list_of(columns: Columns) -> ListColumn | None:
    """The list of vertices, by its usual names or the only one of whole numbers."""
    named: list[Column] = [columns[name] for name in _FACE_LISTS if name in columns]
    others = [c for name, c in columns.items() if "ind" in name.lower() or "vert" in name.lower()]
    return next((c for c in (*named, *others) if isinstance(c, ListColumn)), None)


def _indices(items: NDArray[np.number]) -> Ints:
    """As int32; what is beyond, or no number, becomes −1 and not a valid index."""
    if items.dtype.str[1:] == "i4":
        return np.ascontiguousarray(items, np.int32)
    with np.errstate(invalid="ignore"):
        return np.where((items >= 0) & (items < 2**31), items, -1).astype(np.int32)
