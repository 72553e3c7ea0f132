"""Scenes from mesh files: glTF, OBJ, PLY, STL. Without a camera in the file theirs is a makeshift."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.progress import Cancelled, stage
from pmviewer.scene.arrays.instances import clean_instances, joint_bounds
from pmviewer.scene.clean import check_camera, check_faces, check_size, clean_lights, clean_shapes
from pmviewer.scene.defaults.framing import Up, framed
from pmviewer.scene.description import (
    Camera,
    Material,
    Mesh,
    NamedCamera,
    Scene,
    Shape,
)
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.load import read_gltf
from pmviewer.scene.formats.meshfile import DEFAULT_MATERIAL, MeshFile
from pmviewer.scene.formats.obj import read_obj
from pmviewer.scene.formats.obj import read_single as read_whole_obj
from pmviewer.scene.formats.open_file import found_beside
from pmviewer.scene.formats.ply import read_ply_file
from pmviewer.scene.formats.stl import read_stl
from pmviewer.scene.formats.texture_file import read_picture
from pmviewer.scene.texture import Bitmap

T = TypeVar("T")
SIDE = 512
_UP: Mapping[str, Up] = {".stl": "z", ".glb": "y", ".gltf": "y"}
"""What is up, in formats that have an answer."""


def load_mesh_scene(path: Path, choices: Mapping[str, str] | None = None) -> Scene:
    """The file as a scene. `choices` are what the user wants of a glTF file that offers several scenes, cameras or
    looks. Raises SceneError."""
    ending = path.suffix.lower()
    diagnostics = Diagnostics(path)
    stage(f"reading {path.name}")
    content = _guarded(lambda: _read(path, ending, diagnostics, choices or {}), path)
    groups = dict.fromkeys(instance.group for instance in content.instances)
    for shape in (*content.shapes, *(shape for group in groups for shape in group.shapes)):
        if isinstance(shape.geometry, Mesh):
            check_faces(shape.geometry, path)
    stage("looking for broken triangles")
    shapes = clean_shapes(content.shapes, diagnostics)
    instances = clean_instances(content.instances, diagnostics)
    if not shapes and not instances:
        raise SceneError(
            "The file has no triangle that can be shown.", path, hint=diagnostics.left_out() or "Is it empty?"
        )
    lights = clean_lights(content.lights, diagnostics)
    up = _UP.get(ending)
    box = joint_bounds(shapes, instances)
    cameras = tuple(_named(camera.camera, camera.aspect, camera.name, box, path) for camera in content.cameras)
    if content.camera is None:
        shown = NamedCamera("", framed((), up or "y", box), SIDE, SIDE)
    else:
        shown = _named(content.camera, content.aspect, "", box, path)
    return Scene(
        name=path.stem,
        path=path,
        shapes=shapes,
        materials=_visible(content.materials, shapes, diagnostics) if ending == ".obj" else tuple(content.materials),
        lights=lights,
        camera=shown.camera,
        width=shown.width,
        height=shown.height,
        warnings=diagnostics.warnings(),
        dropped=dict(diagnostics.dropped),
        instances=instances,
        cameras=cameras,
        up=up,
    )


def _visible(materials: Sequence[Material], shapes: Sequence[Shape], diagnostics: Diagnostics) -> tuple[Material, ...]:
    """The materials, opaque where all of the file would be invisible: an opacity of 0 everywhere is a mistake, of
    programs that mean its opposite."""
    used = {shape.material for shape in shapes}
    if not used or not all(_invisible(materials[i]) for i in used):
        return tuple(materials)
    diagnostics.warn("All surfaces of the file are wholly transparent (opacity 0): they are shown opaque.")
    return tuple(replace(m, opacity=1.0) if _invisible(m) else m for m in materials)


def _invisible(material: Material) -> bool:
    return material.opacity <= 0 and "opacity" not in material.textures


def _named(camera: Camera, aspect: float, name: str, box: tuple[np.ndarray, np.ndarray], path: Path) -> NamedCamera:
    width = round(SIDE * aspect) if math.isfinite(aspect) else 0
    check_camera(camera, path)
    check_size(width, SIDE, path)
    return NamedCamera(name, _aimed(camera, box), width, SIDE)


def read_single(path: Path) -> Mesh:
    """All of an OBJ file as one mesh, without materials. Raises SceneError."""
    return _guarded(lambda: read_whole_obj(path), path)


def _guarded(read: Callable[[], T], path: Path) -> T:
    """Run a reader of untrusted data: whatever it stumbles over becomes one SceneError."""
    try:
        if path.stat().st_size == 0:
            raise SceneError("The file is empty (0 bytes).", path, hint="Export it again.")
        return read()
    except (SceneError, Cancelled, MemoryError):
        raise
    except OSError as error:
        raise SceneError(f"The file can't be read: {error.strerror or error}.", path) from None
    except Exception as error:  # the decoders raise anything from KeyError to AssertionError on damaged files
        kind = path.suffix.lstrip(".").upper()
        hint = "It is damaged, or is not what its ending says: export it again."
        raise SceneError(f"The {kind} file can't be decoded.", path, hint=hint) from error


def _read(path: Path, ending: str, diagnostics: Diagnostics, choices: Mapping[str, str]) -> MeshFile:
    if ending in (".glb", ".gltf"):
        return read_gltf(path, diagnostics, choices)
    if ending == ".obj":
        return read_obj(path, diagnostics)
    if ending == ".stl":
        solids = read_stl(path, diagnostics)
        return MeshFile([Shape(name, mesh, 0) for name, mesh in solids], [_look_of(solids[0][1])])
    return _ply_scene(path, diagnostics)


def _ply_scene(path: Path, diagnostics: Diagnostics) -> MeshFile:
    """The mesh of a PLY file with its colours, and the picture that scanning programs name in a comment."""
    ply = read_ply_file(path)
    for note in ply.notes:
        diagnostics.warn(note)
    material = _look_of(ply.mesh)
    if ply.picture and ply.mesh.uv is not None:
        picture = found_beside(path.parent, ply.picture)
        try:
            pixels, sentence = read_picture(picture, picture.name, raw=False)
        except SceneError as error:
            diagnostics.warn(f"{error.what} The surface is shown without it.")
        else:
            if sentence:
                diagnostics.warn(sentence)
            # Such files count v from a picture's lower edge.
            texture = Bitmap(pixels, to_uv=(1.0, 0.0, 0.0, 0.0, -1.0, 1.0), name=picture.name)
            material = replace(material, reflectance=texture.mean, textures={"reflectance": texture})
    return MeshFile([Shape(path.stem, ply.mesh, 0)], [material])


def _look_of(mesh: Mesh) -> Material:
    """Of a file without materials: grey, or the colours of the mesh."""
    if mesh.colours is None:
        return DEFAULT_MATERIAL
    return replace(DEFAULT_MATERIAL, vertex_colours=True, reflectance=(1.0, 1.0, 1.0))


def _aimed(camera: Camera, box: tuple[np.ndarray, np.ndarray]) -> Camera:
    """The file's camera with its orbit point as far away as the middle of the scene's bounds."""
    low, high = box
    eye, target = np.array(camera.origin), np.array(camera.target)
    distance = float(((low + high) / 2 - eye) @ (target - eye))
    x, y, z = (float(c) for c in eye + (target - eye) * (distance if distance > 1e-6 else 1.0))
    return replace(camera, target=(x, y, z))
