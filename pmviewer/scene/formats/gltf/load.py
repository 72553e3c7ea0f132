"""glTF 2.0 files as scenes: the default scene at the start of its first animation, or what the user chose."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pmviewer.errors import SceneError
from pmviewer.scene.arrays.primitives import transformed
from pmviewer.scene.description import Mesh, Shape
from pmviewer.scene.diagnostics import Diagnostics
from pmviewer.scene.formats.gltf.accessors import Accessors
from pmviewer.scene.formats.gltf.buffers import Buffers
from pmviewer.scene.formats.gltf.cameras import camera_at
from pmviewer.scene.formats.gltf.document import Document, Json, extension, is_index, name_of, read_document
from pmviewer.scene.formats.gltf.extensions import warn_of_others
from pmviewer.scene.formats.gltf.lights import image_based, punctual
from pmviewer.scene.formats.gltf.material import GltfMaterials, Look, Usage
from pmviewer.scene.formats.gltf.nodes import Nodes, Placed, chosen
from pmviewer.scene.formats.gltf.pose import Pose, joint_matrices, pose_at_start, skinned
from pmviewer.scene.formats.gltf.primitive import Decoded, Primitives, numbers_of
from pmviewer.scene.formats.gltf.shared import SharedMeshes
from pmviewer.scene.formats.meshfile import MeshFile
from pmviewer.scene.formats.mitsuba.transform import Matrix
from pmviewer.scene.meshes.copies import joined_copies

CHOICES = ("scene", "camera", "variant")
"""What a user can choose in a glTF file, by name or number from 0 on."""
MOST_APART = 5000
"""Copies of a mesh that are shapes of their own where they can't be instances; more are joined in one."""
_LIGHTS, _VARIANTS = "KHR_lights_punctual", "KHR_materials_variants"
_SPARE_TRIANGLES, _TRIANGLES_PER_BYTE = 1 << 22, 16
"""Triangles that a file may be written out to: so many, and more by its size (compressed ones take under a byte)."""


def read_gltf(path: Path, diagnostics: Diagnostics, choices: Mapping[str, str] | None = None) -> MeshFile:
    """A .gltf or .glb file. Damaged files raise SceneError, or whatever their damage causes.

    Parameters
    ----------
    choices: which scene, camera and variant to show (`CHOICES`); without a choice it is the file's own scene and look,
        and its first camera.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite in the end is left out
        return _Reader(read_document(path, diagnostics), choices or {}).read()


class _Reader:
    def __init__(self, document: Document, choices: Mapping[str, str]) -> None:
        self._document, self._choices = document, choices
        self._buffers = Buffers(document)
        self._accessors = Accessors(document, self._buffers)
        self._primitives = Primitives(document, self._buffers, self._accessors)
        self._materials = GltfMaterials(document, self._buffers)
        self._variant = self._chosen_variant()
        self._pose: Pose = {}
        self._result = MeshFile()
        self._numbers: dict[int, int] = {}
        self._decoded: dict[int, list[tuple[Decoded, Json]]] = {}
        self._joined: dict[int, list[Matrix]] = {}
        """By mesh, the places of copies that are written out as one shape."""

    def read(self) -> MeshFile:
        document, result = self._document, self._result
        warn_of_others(document)
        scenes = document.rows("scenes")
        scene = chosen(document, "scenes", self._choices.get("scene"))
        self._pose = pose_at_start(document, self._accessors)
        nodes = Nodes(document, self._accessors, self._pose)
        placed = nodes.walk(scene)
        uses = self._uses(placed)
        triangles = {index: self._triangles(index) for index in {p.node["mesh"] for p in placed if "mesh" in p.node}}
        shared = SharedMeshes(uses, triangles, self._own_shapes)
        self._check_size(placed, shared, triangles)
        self._joined = {index: [] for index, count in uses.items() if count > MOST_APART}
        for place in placed:
            self._add_mesh(place, nodes, shared)
            self._add_camera(place)
            self._add_light(place)
        for index, matrices in self._joined.items():
            if matrices:
                result.shapes += [_copies(shape, np.stack(matrices)) for shape in self._own_shapes(index)[1]]
        if scenes:
            row = scenes[scene if scene is not None else document.header.get("scene", 0)]
            sky = image_based(document, self._buffers, row)
            result.lights += [] if sky is None else [sky]
            if len(scenes) > 1 and scene is None:
                document.warn(f"The file has {len(scenes)} scenes; its own choice is shown (-D scene=… shows another).")
        self._choose_camera()
        return result

    def _uses(self, placed: list[Placed]) -> Counter[int]:
        """How often each mesh is shown without a skin and in its own shape, so that copies look the same."""
        uses: Counter[int] = Counter()
        meshes = self._document.rows("meshes")
        for place in placed:
            if "mesh" in place.node:
                if not is_index(place.node["mesh"]) or place.node["mesh"] >= len(meshes):
                    self._document.row("meshes", place.node["mesh"], place.name)  # says what is wrong
                if self._is_own(place):
                    uses[place.node["mesh"]] += len(place.matrices)
        return uses

    def _is_own(self, place: Placed) -> bool:
        """Does the node show its mesh as the mesh alone says?"""
        return (
            "skin" not in place.node
            and "weights" not in place.node
            and not (place.index in self._pose and self._pose[place.index].get("weights"))
        )

    def _triangles(self, index: int) -> int:
        name = f"mesh {index}"
        return sum(self._primitives.triangles(p, name) for p in _primitives_of(self._document.rows("meshes")[index]))

    def _check_size(self, placed: list[Placed], shared: SharedMeshes, triangles: dict[int, int]) -> None:
        """Raises SceneError for more triangles than a file of this size can mean."""
        written = sum(
            triangles[p.node["mesh"]] * (1 if self._is_own(p) and p.node["mesh"] in shared.saving else len(p.matrices))
            for p in placed
            if "mesh" in p.node
        )
        lengths = (row.get("byteLength", 0) for row in self._document.rows("buffers"))
        size = self._document.path.stat().st_size + sum(n for n in lengths if is_index(n))
        if written > _SPARE_TRIANGLES + _TRIANGLES_PER_BYTE * size:
            what = f"The file shows {written} triangles, more than are taken from one of {size} bytes."
            raise self._document.error(what, hint="It is damaged, or has too many copies of its meshes.")

    def _own_shapes(self, index: int) -> tuple[str, list[Shape]]:
        """A mesh's name and its shapes in its own coordinates, at its default morph weights."""
        row = self._document.rows("meshes")[index]
        name = name_of(row, f"mesh {index}")
        if index not in self._decoded:
            self._decoded[index] = list(self._parts(row, index, numbers_of(row.get("weights"))))
        return name, [self._shape(name, d, d.mesh, p) for d, p in self._decoded[index]]

    def _parts(self, row: Json, index: int, weights: list[float]) -> list[tuple[Decoded, Json]]:
        parts = []
        for primitive in _primitives_of(row):
            uv_set = self._materials.uv_set(self._material_of(primitive))
            decoded = self._primitives.decode(primitive, f"mesh {index}", uv_set, weights)
            if decoded is not None:
                parts.append((decoded, primitive))
        return parts

    def _shape(self, name: str, decoded: Decoded, mesh: Mesh, primitive: Json) -> Shape:
        look = self._look(decoded, primitive)
        return Shape(name, mesh, self._number(look), look.radiance, look.emission)

    def _look(self, decoded: Decoded, primitive: Json) -> Look:
        colours, alpha = decoded.mesh.colours, decoded.alpha
        r, g, b = (1.0, 1.0, 1.0) if colours is None else (float(c) for c in colours.mean(axis=0))
        mean = 1.0
        if alpha is not None and len(alpha):
            mean = float(alpha.mean())
            if float(np.ptp(alpha)) > 0.01:
                self._document.warn("Alpha that differs from vertex to vertex counts by its mean over the mesh.")
        return self._materials.of(self._material_of(primitive), Usage(colours is not None, (r, g, b), mean))

    def _number(self, look: Look) -> int:
        """Index of the look's material in the result."""
        key = id(look.material)
        if key not in self._numbers:
            self._numbers[key] = len(self._result.materials)
            self._result.materials.append(look.material)
        return self._numbers[key]

    def _material_of(self, primitive: Json) -> Any:
        """Index of the primitive's material, in the variant that is shown; None for none."""
        mappings = extension(primitive, _VARIANTS).get("mappings")
        if self._variant is not None and isinstance(mappings, list):
            for mapping in mappings:
                if isinstance(mapping, dict) and self._variant in (mapping.get("variants") or ()):
                    return mapping.get("material")
        return primitive.get("material")

    def _chosen_variant(self) -> int | None:
        wanted = self._choices.get("variant")
        variants = self._document.extension(_VARIANTS).get("variants", [])
        names = [str(v.get("name", i)) for i, v in enumerate(variants) if isinstance(v, dict)]
        if wanted is None:
            if len(names) > 1:
                listed = ", ".join(names[:20])
                self._document.warn(f"The file has other looks (-D variant=…): {listed}; its own one is shown.")
            return None
        if wanted in names:
            return names.index(wanted)
        if wanted.isdecimal() and int(wanted) < len(names):
            return int(wanted)
        hint = f"It has {', '.join(names[:20])}." if names else "It has none."
        raise SceneError(f"The file has no variant {wanted[:80]!r}.", self._document.path, hint=hint)

    def _add_mesh(self, place: Placed, nodes: Nodes, shared: SharedMeshes) -> None:
        if "mesh" not in place.node:
            return
        index, result = place.node["mesh"], self._result
        row = self._document.rows("meshes")[index]
        name = str(place.node.get("name") or name_of(row, f"mesh {index}"))[:80]
        if "skin" in place.node:
            self._add_skinned(place, name, row, nodes)
            return
        if not self._is_own(place):
            weights = self._weights(place, row)
            shapes = [self._shape(name, d, d.mesh, p) for d, p in self._parts(row, index, weights)]
            result.shapes += [_moved(shape, name, m) for m in place.matrices for shape in shapes]
            return
        for matrix in place.matrices:
            instance = shared.instance(index, name, matrix)
            if instance is not None:
                result.instances.append(instance)
            elif index in self._joined:
                self._joined[index].append(matrix)
            else:
                result.shapes += [_moved(shape, name, matrix) for shape in self._own_shapes(index)[1]]

    def _weights(self, place: Placed, row: Json) -> list[float]:
        """Weights of the morph targets: the animation's, the node's, or the mesh's."""
        animated = self._pose.get(place.index, {}).get("weights")
        return animated if animated else numbers_of(place.node.get("weights", row.get("weights")))

    def _add_skinned(self, place: Placed, name: str, row: Json, nodes: Nodes) -> None:
        """A skin moves its mesh by its joints alone, wherever the node stands."""
        matrices = joint_matrices(self._document, self._accessors, place.node["skin"], place.name, nodes.all_world())
        for decoded, primitive in self._parts(row, place.node["mesh"], self._weights(place, row)):
            if decoded.joints is None or decoded.weights is None:
                mesh = transformed(decoded.mesh, place.matrix)
            else:
                mesh = skinned(decoded.mesh, decoded.joints, decoded.weights, matrices)
            self._result.shapes.append(self._shape(name, decoded, mesh, primitive))

    def _add_camera(self, place: Placed) -> None:
        if "camera" in place.node:
            row = self._document.row("cameras", place.node["camera"], place.name)
            camera = camera_at(row, place.matrix, place.name, self._document.diagnostics)
            self._result.cameras += [] if camera is None else [camera]

    def _choose_camera(self) -> None:
        """The first camera, or the one that the user wants."""
        cameras, wanted = self._result.cameras, self._choices.get("camera")
        index = 0
        if wanted is not None:
            names = [camera.name for camera in cameras]
            if wanted not in names and not (wanted.isdecimal() and int(wanted) < len(cameras)):
                listed = ", ".join(f"{i} ({name})" for i, name in enumerate(names[:20]))
                hint = f"It has {listed}." if names else "It has none."
                raise SceneError(f"The scene has no camera {wanted[:80]!r}.", self._document.path, hint=hint)
            index = names.index(wanted) if wanted in names else int(wanted)
        elif len(cameras) > 1:
            listed = ", ".join(f"{i} ({camera.name})" for i, camera in enumerate(cameras[:20]))
            self._document.warn(f"The file has several cameras (-D camera=…): {listed}; the first is used.")
        if cameras:
            self._result.camera, self._result.aspect = cameras[index].camera, cameras[index].aspect

    def _add_light(self, place: Placed) -> None:
        number = extension(place.node, _LIGHTS).get("light") if "extensions" in place.node else None
        if number is None:
            return
        lights = self._document.extension(_LIGHTS).get("lights", [])
        known = lights if isinstance(lights, list) else []
        if not is_index(number) or number >= len(known) or not isinstance(known[number], dict):
            self._document.warn(f"{place.name} refers to a light that is not in the file.")
            return
        light = punctual(known[number], place.matrix, self._document.diagnostics)
        self._result.lights += [] if light is None else [light]


def _primitives_of(row: Json) -> list[Json]:
    found = row.get("primitives", [])
    return [p for p in found if isinstance(p, dict)] if isinstance(found, list) else []


def _moved(shape: Shape, name: str, matrix: np.ndarray) -> Shape:
    assert isinstance(shape.geometry, Mesh)
    return Shape(name, transformed(shape.geometry, matrix), shape.material, shape.radiance, shape.emission)


def _copies(shape: Shape, matrices: np.ndarray) -> Shape:
    assert isinstance(shape.geometry, Mesh)
    mesh = joined_copies(shape.geometry, matrices)
    return Shape(shape.name, mesh, shape.material, shape.radiance, shape.emission)
