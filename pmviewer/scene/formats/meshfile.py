"""What the readers of mesh formats hand over, before a camera and a light are added where the file has none."""

from __future__ import annotations

from dataclasses import dataclass, field

from pmviewer.scene.description import Camera, Instance, Light, Material, Shape

DEFAULT_MATERIAL = Material("default", "diffuse", (0.7, 0.7, 0.7), two_sided=True)
"""For triangles whose file says nothing about their material."""


@dataclass(frozen=True)
class NamedCamera:
    """A camera of the file; `aspect` is the width over the height of its picture."""

    name: str
    camera: Camera
    aspect: float


@dataclass
class MeshFile:
    """Shapes index into `materials`. `aspect` is the camera's width over height; `cameras` are all that the file has,
    of which `camera` is one."""

    shapes: list[Shape] = field(default_factory=list)
    materials: list[Material] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    instances: list[Instance] = field(default_factory=list)
    cameras: list[NamedCamera] = field(default_factory=list)
    camera: Camera | None = None
    aspect: float = 1.0

    _numbers: dict[Material, int] = field(default_factory=dict, repr=False)

    def material(self, material: Material) -> int:
        """Index of the material, added if it is new. In constant time, for files have thousands."""
        if material not in self._numbers:
            self._numbers[material] = len(self.materials)
            self.materials.append(material)
        return self._numbers[material]
