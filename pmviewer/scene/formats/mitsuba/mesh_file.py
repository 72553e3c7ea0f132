"""Shapes whose triangles stand in a file of their own: `obj`, `ply` and `serialized`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from pmviewer.errors import SceneError
from pmviewer.scene.arrays import primitives
from pmviewer.scene.clean import check_faces
from pmviewer.scene.description import Mesh
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.texture import attributes_read
from pmviewer.scene.formats.mitsuba.transform import Matrix, mirrors
from pmviewer.scene.formats.ply import read_ply
from pmviewer.scene.formats.serialized import read_serialized
from pmviewer.scene.meshes.smoothing import smoothed

MESH_FILES = ("obj", "ply", "serialized")
_KEPT_FACES = 20_000
"""Meshes up to this size are kept while the scene is read, since many shapes may show one file."""


_COLOURS = "vertex_color"
"""The attribute that is read anyhow; a file that has none may have colours of faces."""


class BrokenMesh(SceneError):
    """A mesh file that can't be used. `name` says which, and why."""

    def __init__(self, name: str, error: SceneError, path: Path | None, line: int) -> None:
        super().__init__(f"The mesh {name}: {error.what}", path, line, error.hint)
        self.name = f"{name} ({error.what.rstrip('.')[:160]})"


def mesh_file(p: Properties, to_world: Matrix, flip: bool) -> Mesh:
    """The shape's triangles in world space. Raises SceneError."""
    flat = p.boolean("face_normals", False)
    # OBJ counts v from a picture's lower edge, which the reader has turned round already.
    flip_v = p.boolean("flip_tex_coords", p.type == "obj") != (p.type == "obj")
    limit = p.number("max_smooth_angle", -1.0)
    mesh = _stored(p)
    if flip_v and mesh.uv is not None:
        mesh = replace(mesh, uv=mesh.uv * [1, -1] + [0, 1])
    if limit >= 0 and not flat:
        # Version 0.6: normals of the file are made anew, with edges where faces meet at more than this angle.
        mesh = smoothed(replace(mesh, normals=None), limit)
    if mesh.normals is not None and not flat:
        return primitives.wound_by_normals(primitives.transformed(mesh, to_world, flip))
    # Faces keep the order of their corners, so that a mirrored mesh turns inside out.
    mesh = primitives.transformed(replace(mesh, normals=None), to_world, flip != mirrors(to_world))
    return mesh if flat else primitives.with_smooth_normals(mesh, seams=True)


def _stored(p: Properties) -> Mesh:
    """The mesh as the file has it."""
    name, document = p.string("filename", ""), p.document
    index = p.integer("shape_index", 0) if p.type == "serialized" else 0
    if not name:
        raise document.error(f"{p.element} needs a 'filename'.", p.element)
    path = document.file(name, p.element)
    wanted = _attribute(p) if p.type == "ply" else ""
    attribute = "" if wanted == _COLOURS else wanted
    key = (str(path), f"{p.type} {attribute}", index)
    if key in document.broken_meshes:
        raise document.broken_meshes[key]
    mesh = document.meshes.get(key)
    if mesh is not None:
        return mesh
    try:
        mesh = read_ply(path, attribute) if p.type == "ply" else _read(path, p.type, index)
        check_faces(mesh, path)
        if wanted and mesh.colours is None:
            what = f"{path.name} has no attribute '{wanted[:40]}': what it would colour is white."
            document.warn(what, p.element, kind=f"attribute {path} {wanted}")
    except SceneError as error:
        at = p.element.file or document.diagnostics.path
        document.broken_meshes[key] = BrokenMesh(path.name, error, at, p.element.line)
        raise document.broken_meshes[key] from None
    if len(mesh.faces) <= _KEPT_FACES:
        document.meshes[key] = mesh
    return mesh


def _attribute(p: Properties) -> str:
    """The attribute of the mesh that is read as its colours, "" for what its file has."""
    names = attributes_read(p.element, p.document)
    if len(names) > 1:
        what = (
            f"The BSDFs of {p.element} read several attributes of the mesh: '{names[0][:40]}' stands for all of them."
        )
        p.document.warn(what, p.element)
    return names[0] if names else ""


def _read(path: Path, kind: str, index: int) -> Mesh:
    if kind == "serialized":
        return read_serialized(path, index)
    from pmviewer.scene.formats.meshes import read_single

    return read_single(path)
