"""Small scenes as dataclasses, for tests whose result is known without a reference image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import trimesh

from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    Cylinder,
    Disk,
    Material,
    Mesh,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.settings.access import Settings, with_values

GREY = 0.5


def diffuse(name="grey", albedo=(GREY,) * 3, two_sided=True):
    return Material(name, "diffuse", albedo, two_sided=two_sided)


MIRROR = Material("mirror", "conductor", (1.0, 1.0, 1.0), two_sided=True)
GLASS = Material("glass", "dielectric", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), eta=1.5)


def closed_sphere(radius=1.0, size=32):
    """Emits 0.5 and reflects half: radiance 1 everywhere, in every direction."""
    camera = Camera((0, 0, 0), (0, 0, radius), (0, 1, 0), 60.0, near=0.0, far=np.inf)
    shape = Shape("sphere", Sphere((0, 0, 0), radius, True), 0, (0.5,) * 3)
    return Scene("closed sphere", None, (shape,), (diffuse(),), (), camera, size, size)


def box_walls(s=1.0, materials=(0,) * 6):
    """The six sides of [-s, s]³, facing inwards: -x, +x, floor, ceiling, back (-z), front."""

    def side(corner, u, v):
        return Parallelogram(*(tuple(s * np.array(x, float)) for x in (corner, u, v)))

    sides = {
        "left": side((-1, -1, -1), (0, 2, 0), (0, 0, 2)),
        "right": side((1, -1, -1), (0, 0, 2), (0, 2, 0)),
        "floor": side((-1, -1, -1), (0, 0, 2), (2, 0, 0)),
        "ceiling": side((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
        "back": side((-1, -1, -1), (2, 0, 0), (0, 2, 0)),
        "front": side((-1, -1, 1), (0, 2, 0), (2, 0, 0)),
    }
    return tuple(Shape(name, g, m) for (name, g), m in zip(sides.items(), materials, strict=True))


def panel(s=1.0, half=0.4, y=0.9, radiance=(5.0,) * 3, material=0):
    """A square light below the ceiling, facing down."""
    h = half * s
    shape = Parallelogram((-h, y * s, -h), (2 * h, 0, 0), (0, 0, 2 * h))
    return Shape("panel", shape, material, radiance)


def box_camera(s=1.0):
    return Camera((0, 0, 0.95 * s), (0, 0, 0), (0, 1, 0), 75.0, near=0.0, far=np.inf)


def diffuse_box(s=1.0, albedo=GREY, size=48):
    """A closed box, every surface of the same albedo: the flux arriving on surfaces is Φ/(1 − albedo)."""
    shapes = (*box_walls(s), panel(s))
    return Scene("diffuse box", None, shapes, (diffuse(albedo=(albedo,) * 3),), (), box_camera(s), size, size)


def cornell_box(s=1.0, size=48, light=0.4):
    """Coloured walls, a glass ball, a mirror ball, a light of some size; nothing leaves it."""
    materials = (
        diffuse("white", (0.7, 0.7, 0.7)),
        diffuse("red", (0.6, 0.1, 0.1)),
        diffuse("green", (0.1, 0.5, 0.1)),
        replace(MIRROR, reflectance=(0.9, 0.9, 0.9)),
        GLASS,
    )
    balls = (
        Shape("mirror ball", Sphere((-0.45 * s, -0.6 * s, -0.4 * s), 0.38 * s), 3),
        Shape("glass ball", Sphere((0.45 * s, -0.6 * s, 0.1 * s), 0.38 * s), 4),
    )
    shapes = (*box_walls(s, (1, 2, 0, 0, 0, 0)), panel(s, light), *balls)
    return Scene("cornell box", None, shapes, materials, (), box_camera(s), size, size)


def ball_in_environment(material, radiance=(1.0, 1.0, 1.0), size=24):
    """One ball in a constant environment: for white BSDFs the image is the environment's radiance everywhere."""
    camera = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 45.0, near=0.0, far=np.inf)
    ball = Shape("ball", Sphere((0, 0, 0), 1.0), 0)
    return Scene("ball", None, (ball,), (material,), (ConstantEnvironment("sky", radiance),), camera, size, size)


def cube_mesh(center=(0.0, 0.0, 0.0), half=1.0):
    """A cube of twelve triangles, facing outwards."""
    box = trimesh.creation.box((2 * half,) * 3)
    return Mesh(np.asarray(box.vertices, float) + center, np.asarray(box.faces, np.int32))


def ball_mesh(radius=1.0, subdivisions=4):
    """A tessellated ball without smooth normals."""
    ball = trimesh.creation.icosphere(subdivisions, radius)
    return Mesh(np.asarray(ball.vertices, float), np.asarray(ball.faces, np.int32))


LIGHTS = {
    "parallelogram": Parallelogram((-0.5, 2.0, -0.4), (1.2, 0.0, 0.3), (0.1, 0.0, 0.9)),
    "disk": Disk((0.2, 2.0, 0.1), (0.0, -1.0, 0.0), 0.6),
    "sphere": Sphere((0.3, 1.5, -0.2), 0.5),
    "sphere inside": Sphere((0.2, 0.1, 0.1), 4.0, True),
    "cylinder": Cylinder((-0.7, 1.4, 0.1), (0.6, 1.7, 0.2), 0.3),
    "cylinder inside": Cylinder((0.1, -2.0, 0.0), (0.0, 3.0, 0.1), 1.5, True),
    "mesh": cube_mesh((0.1, 1.8, 0.2), 0.4),
    "point": PointLight("point", (0.3, 1.2, -0.4), (2.0, 3.0, 1.0)),
    "environment": ConstantEnvironment("environment", (0.8, 0.9, 1.1)),
}


def light_scene(*names, radiance=(2.0, 1.5, 1.0), floor=True):
    """A small floor at the origin with the named lights of `LIGHTS`; area lights reflect nothing."""
    square = Parallelogram((-0.1, 0.0, -0.1), (0.0, 0.0, 0.2), (0.2, 0.0, 0.0))
    shapes, lights = [Shape("floor", square, 0)] if floor else [], []
    for name in names:
        light = LIGHTS[name]
        if isinstance(light, PointLight | ConstantEnvironment):
            lights.append(light)
        else:
            shapes.append(Shape(name, light, 1, radiance))
    materials = (diffuse(), diffuse("black", (0.0, 0.0, 0.0)))
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40.0, near=0.0, far=np.inf)
    return Scene("lights", None, tuple(shapes), materials, tuple(lights), camera, 8, 8)


def settings_of(**groups):
    """`settings_of(render={"method": "path"}, photons={"N": 1000})`."""
    values = {f"{group}.{name}": value for group, chosen in groups.items() for name, value in chosen.items()}
    return with_values(Settings(), values)


def rendered(scene, settings, passes, threads=1):
    """A Renderer after that many passes, on threads of its own."""
    opened = scene if isinstance(scene, OpenScene) else open_scene(scene)
    pool = WorkPool(threads)
    try:
        renderer = Renderer(opened, settings, pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
    finally:
        pool.close()
    return renderer


def means_by_method(scene, path_passes):
    """The picture's mean by the path tracer and by both methods with photons, whose noise of 40,000 a pass is a percent
    or two where they start more densely for what is small."""
    means = {}
    for name, passes, groups in (
        ("path", path_passes, {}),
        ("progressive", 32, {"estimate": {"radius": 1e-3}}),
        ("gather", 32, {"estimate": {"radius": 1e-3}}),
    ):
        settings = settings_of(render={"method": name}, photons={"N": 40_000}, **groups)
        image = rendered(scene, settings, passes).frame(1).image("beauty")
        means[name] = float(image.astype(np.float64).mean())
    print(means)
    return means
