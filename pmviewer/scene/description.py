"""A scene as loaders describe it: frozen, validated, independent of how kernels store it.

Lengths are in scene units (metres unless the file says otherwise), radiance in W/(m² sr) per RGB channel, intensity in
W/sr. Directions and winding follow Mitsuba 3: an area light emits, and a one-sided BSDF reflects, on the side that the
geometric normal points to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

RGB = tuple[float, float, float]
Vec3 = tuple[float, float, float]
Matrix = NDArray[np.float64]

BLACK: RGB = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Mesh:
    """Triangles. `vertices` (V, 3) float64 in world space, `faces` (F, 3) int32 counter-clockwise seen from the front,
    `normals` (V, 3) float64 unit shading normals or None for flat shading."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]
    normals: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Sphere:
    """Normals point outwards, or inwards with `flip_normals`."""

    center: Vec3
    radius: float
    flip_normals: bool = False


@dataclass(frozen=True)
class Cylinder:
    """An open tube from `p0` to `p1`. Normals point away from the axis, or towards it with `flip_normals`."""

    p0: Vec3
    p1: Vec3
    radius: float
    flip_normals: bool = False


@dataclass(frozen=True)
class Disk:
    """A flat round disk; it faces `normal` (unit length, flipping already applied)."""

    center: Vec3
    normal: Vec3
    radius: float


@dataclass(frozen=True)
class Parallelogram:
    """corner + u·edge_u + v·edge_v for u, v in [0, 1]; it faces edge_u × edge_v."""

    corner: Vec3
    edge_u: Vec3
    edge_v: Vec3


Geometry = Mesh | Sphere | Cylinder | Disk | Parallelogram


@dataclass(frozen=True)
class Material:
    """A BSDF. `reflectance` scales reflection (albedo of `diffuse`, specular reflectance of `conductor` and
    `dielectric`), `transmittance` scales refraction; `eta` is inside IOR over outside IOR. `two_sided` makes the back
    of an opaque material reflect like its front; without it the back is black."""

    name: str
    kind: Literal["diffuse", "conductor", "dielectric"]
    reflectance: RGB = (0.5, 0.5, 0.5)
    transmittance: RGB = (1.0, 1.0, 1.0)
    eta: float = 1.5
    two_sided: bool = False


@dataclass(frozen=True)
class Shape:
    """Geometry with a material (index into `Scene.materials`) and, when it is a light, its emitted `radiance`."""

    name: str
    geometry: Geometry
    material: int
    radiance: RGB | None = None


@dataclass(frozen=True)
class PointLight:
    """`intensity` in W/sr, equal in all directions."""

    name: str
    position: Vec3
    intensity: RGB


@dataclass(frozen=True)
class ConstantEnvironment:
    """The same `radiance` arriving from everywhere outside."""

    name: str
    radiance: RGB


@dataclass(frozen=True)
class Camera:
    """Perspective camera. `up` need not be orthogonal to the view direction. `fov` in degrees, measured along
    `fov_axis`. The image's x axis runs to the viewer's right, its y axis down."""

    origin: Vec3
    target: Vec3
    up: Vec3
    fov: float
    fov_axis: Literal["x", "y", "diagonal", "smaller", "larger"] = "x"
    near: float = 0.0
    far: float = math.inf
    mirrored: bool = False
    """True when the file's camera frame has the other handedness: the image is then flipped left to right."""


@dataclass(frozen=True)
class Scene:
    """Everything a loader found. `warnings` are complete sentences ("line 12: texture 'bitmap' is ignored …");
    `dropped` counts what was unusable, by reason ("degenerate triangle": 3)."""

    name: str
    path: Path | None
    shapes: tuple[Shape, ...]
    materials: tuple[Material, ...]
    lights: tuple[PointLight | ConstantEnvironment, ...]
    camera: Camera
    width: int
    height: int
    warnings: tuple[str, ...] = ()
    dropped: Mapping[str, int] = field(default_factory=dict)
