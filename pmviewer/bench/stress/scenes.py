"""Scenes whose pictures are known without rendering, and some that path tracing tells."""

from __future__ import annotations

import numpy as np

from pmviewer.scene.description import (
    RGB,
    Camera,
    Light,
    Material,
    Mesh,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
    Vec3,
)

MIRROR = Material("mirror", "conductor", (1.0, 1.0, 1.0), two_sided=True)
GLASS = Material("glass", "dielectric", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), eta=1.5)


def grey(albedo: float = 0.5) -> Material:
    """Diffuse on both sides, of this reflectance in all channels."""
    return Material("grey", "diffuse", (albedo,) * 3, two_sided=True)


def furnace(
    size: float = 1.0,
    at: Vec3 = (0.0, 0.0, 0.0),
    albedo: float = 0.5,
    emission: float = 0.5,
    extra: tuple[Shape, ...] = (),
    materials: tuple[Material, ...] = (),
) -> Scene:
    """The inside of a sphere that emits everywhere: radiance emission / (1 − albedo) in every direction, whatever
    stands in it, if that absorbs nothing. `extra` shapes use `materials` from 1 on."""
    wall = Shape("sphere", Sphere(at, size, True), 0, (emission,) * 3)
    camera = Camera(at, (at[0], at[1], at[2] + size), (0, 1, 0), 60.0)
    return Scene("furnace", None, (wall, *extra), (grey(albedo), *materials), (), camera, 16, 16)


def ball(material: int, size: float = 1.0, at: Vec3 = (0.0, 0.0, 0.0)) -> Shape:
    """A ball in the furnace that the camera sees in the middle of its picture."""
    return Shape("ball", Sphere((at[0], at[1], at[2] + 0.55 * size), 0.2 * size), material)


def box_walls(s: float = 1.0, material: int = 0) -> tuple[Shape, ...]:
    """The six sides of [−s, s]³, facing inwards."""
    sides = (
        ((-1, -1, -1), (0, 2, 0), (0, 0, 2)),
        ((1, -1, -1), (0, 0, 2), (0, 2, 0)),
        ((-1, -1, -1), (0, 0, 2), (2, 0, 0)),
        ((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
        ((-1, -1, -1), (2, 0, 0), (0, 2, 0)),
        ((-1, -1, 1), (0, 2, 0), (2, 0, 0)),
    )
    return tuple(Shape(f"side {i}", parallelogram(*side, s), material) for i, side in enumerate(sides))


def parallelogram(corner: Vec3, u: Vec3, v: Vec3, s: float = 1.0) -> Parallelogram:
    """From its corner along `u` and `v`, all scaled by `s` about the origin."""
    (a, b, c) = (tuple(s * float(x) for x in vector) for vector in (corner, u, v))
    return Parallelogram(a, b, c)  # type: ignore[arg-type]


def panel(y: float = 0.9, radiance: float = 5.0, s: float = 1.0, material: int = 0) -> Shape:
    """A square light of side 0.8 that faces down."""
    return Shape("panel", parallelogram((-0.4, y, -0.4), (0.8, 0, 0), (0, 0, 0.8), s), material, (radiance,) * 3)


def room(
    s: float = 1.0,
    albedo: float = 0.5,
    radiance: float = 5.0,
    extra: tuple[Shape, ...] = (),
    materials: tuple[Material, ...] = (),
    light: Shape | None = None,
) -> Scene:
    """A closed box with a light below its ceiling; `extra` shapes use `materials` from 1 on."""
    camera = Camera((0, 0, 0.95 * s), (0, -0.2 * s, 0), (0, 1, 0), 75.0)
    shapes = (*box_walls(s), light or panel(radiance=radiance, s=s), *extra)
    return Scene("room", None, shapes, (grey(albedo), *materials), (), camera, 16, 16)


def open_floor(
    lights: tuple[Light, ...] = (),
    extra: tuple[Shape, ...] = (),
    material: Material | None = None,
    materials: tuple[Material, ...] = (),
    half: float = 1.0,
) -> Scene:
    """A square floor seen from above under some lights; nothing comes back to it."""
    floor = Shape("floor", Parallelogram((-half, 0, -half), (0, 0, 2 * half), (2 * half, 0, 0)), 0)
    camera = Camera((0, 2, 0), (0, 0, 0), (0, 0, 1), 40.0)
    return Scene("floor", None, (floor, *extra), (material or grey(), *materials), lights, camera, 16, 16)


def point(position: Vec3 = (0.0, 1.0, 0.0), intensity: RGB = (1.0, 1.0, 1.0)) -> PointLight:
    """A point light of this radiant intensity in W/sr."""
    return PointLight("point", position, intensity)


def tiled(corner: Vec3, u: Vec3, v: Vec3, nu: int, nv: int) -> Mesh:
    """A parallelogram cut into 2·nu·nv triangles."""
    a, b = np.meshgrid(np.linspace(0, 1, nu + 1), np.linspace(0, 1, nv + 1), indexing="ij")
    vertices = np.array(corner, float) + a.reshape(-1, 1) * np.array(u, float) + b.reshape(-1, 1) * np.array(v, float)
    first = (np.arange(nu)[:, None] * (nv + 1) + np.arange(nv)).reshape(-1).astype(np.int32)
    one, two = first + nv + 1, first + nv + 2
    faces = np.concatenate([np.stack([first, one, two], 1), np.stack([first, two, first + 1], 1)]).astype(np.int32)
    return Mesh(vertices, faces)
