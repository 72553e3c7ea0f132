"""glTF meshes that several nodes show: instances of one group where that saves memory."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from pmviewer.scene.description import Group, Instance, Mesh, Shape
from pmviewer.scene.formats.gltf.material import GltfMaterials
from pmviewer.scene.formats.meshfile import DEFAULT_MATERIAL, MeshFile
from pmviewer.scene.formats.mitsuba.transform import Matrix
from pmviewer.scene.instances import first_singular

Json = dict[str, Any]
FEWEST_SAVED = 20_000
"""Triangles that instances must save: below that, written out, they take few megabytes."""


class SharedMeshes:
    """Which meshes of the file are worth sharing, and the groups made of them so far.

    Parameters
    ----------
    meshes: by "mesh.primitive", in their own coordinates.
    nodes: every node with its world matrix.
    """

    def __init__(self, header: Json, meshes: Mapping[str, Mesh], nodes: Sequence[tuple[Json, Matrix]]) -> None:
        self._header, self._meshes = header, meshes
        uses = Counter(node["mesh"] for node, _ in nodes if "mesh" in node)
        self._worth = {index for index, count in uses.items() if (count - 1) * self._triangles(index) >= FEWEST_SAVED}
        self._groups: dict[int, Group | None] = {}

    def _primitives(self, index: int) -> list[tuple[Mesh | None, Json]]:
        primitives = self._header["meshes"][index].get("primitives", [])
        return [(self._meshes.get(f"{index}.{j}"), primitive) for j, primitive in enumerate(primitives)]

    def _triangles(self, index: int) -> int:
        return sum(len(mesh.faces) for mesh, _ in self._primitives(index) if mesh is not None)

    def instance(self, node: Json, matrix: Matrix, result: MeshFile, materials: GltfMaterials) -> Instance | None:
        """The node's mesh as an instance; None when it is to be written out: if that saves too little, if the mesh
        shines or has parts that are no triangles, or if the node squeezes it flat."""
        index = node.get("mesh")
        if index is None or index not in self._worth:
            return None
        if index not in self._groups:
            self._groups[index] = self._group(index, result, materials)
        group = self._groups[index]
        if group is None:
            return None
        instance = Instance(str(node.get("name") or group.name), group, matrix)
        return instance if first_singular([instance]) is None else None

    def _group(self, index: int, result: MeshFile, materials: GltfMaterials) -> Group | None:
        name = str(self._header["meshes"][index].get("name") or f"mesh {index}")
        shapes = []
        for mesh, primitive in self._primitives(index):
            of = primitive.get("material")
            material, radiance, _ = (DEFAULT_MATERIAL, None, None) if of is None else materials.of(of)
            if mesh is None or (radiance is not None and max(radiance) > 0):
                return None
            shapes.append(Shape(name, mesh, result.material(material)))
        return Group(name, tuple(shapes))
