"""Scenes far from the origin, moved to it: float32 coordinates have no digits left for what is small and far away.

At a distance of D scene radii the coordinates' spacing is D·2⁻²⁴ of the radius, and rays start D·2⁻¹⁷ of it off a
surface. Up to `FAR` that is a ten-thousandth of the scene. Descriptions are float64, so the move itself loses nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.arrays.flatten import bounding_sphere
from pmviewer.scene.description import (
    Cylinder,
    Disk,
    Geometry,
    Light,
    Mesh,
    Parallelogram,
    PointLight,
    ProjectorLight,
    Scene,
    Sphere,
    SpotLight,
    Vec3,
)

FAR = 16.0
"""Distance of the scene's middle from the origin, in radii of the bounding sphere, from which it is moved."""
FAR_CAMERA = 2.0**13
"""Distance of the camera from the middle, in radii, from which rays are a thousandth of the scene apart or more."""


def recentred(scene: Scene) -> Scene:
    """The scene around the origin, with a sentence in its warnings, if it is far from it; else the scene itself."""
    if not scene.all_shapes:
        return scene
    center, radius = bounding_sphere(scene)
    if not _is_far(center, radius):
        return _with_camera_warning(scene, center, radius)
    distance = float(np.linalg.norm(center))
    by = -center
    x, y, z = center
    sentence = (
        f"The scene lies {distance / radius:.0f} times its radius from the origin and is moved there, to keep its "
        f"details: coordinates shown and set count from ({x:.9g}, {y:.9g}, {z:.9g})."
    )
    instances = []
    for instance in scene.instances:
        to_world = instance.to_world.copy()
        to_world[:3, 3] += by
        instances.append(replace(instance, to_world=to_world))
    camera = scene.camera
    moved = replace(
        scene,
        shapes=tuple(replace(s, geometry=_moved(s.geometry, by)) for s in scene.shapes),
        lights=tuple(_moved_light(light, by) for light in scene.lights),
        instances=tuple(instances),
        camera=replace(camera, origin=_plus(camera.origin, by), target=_plus(camera.target, by)),
        warnings=(*scene.warnings, sentence),
    )
    return _with_camera_warning(moved, np.zeros(3), radius)


def lies_far(scene: Scene) -> bool:
    """Would it be moved to the origin?"""
    return bool(scene.all_shapes) and _is_far(*bounding_sphere(scene))


def _is_far(center: NDArray[np.float64], radius: float) -> bool:
    return FAR * radius < float(np.linalg.norm(center)) < np.inf


def _with_camera_warning(scene: Scene, center: NDArray[np.float64], radius: float) -> Scene:
    distance = float(np.linalg.norm(np.subtract(scene.camera.origin, center))) / radius
    if not distance > FAR_CAMERA:
        return scene
    nearer = "Bring it nearer and widen its field of view."
    if scene.camera.projection == "orthographic":
        nearer = "Bring it nearer: that does not change an orthographic picture."
    sentence = (
        f"The camera is {distance:.1e} scene radii away: its rays are some {distance * 2**-23:.1e} of the scene apart "
        f"at best, and the picture is as coarse. {nearer}"
    )
    return replace(scene, warnings=(*scene.warnings, sentence))


def _plus(point: Vec3, by: NDArray[np.float64]) -> Vec3:
    return float(point[0] + by[0]), float(point[1] + by[1]), float(point[2] + by[2])


def _moved(g: Geometry, by: NDArray[np.float64]) -> Geometry:
    if isinstance(g, Mesh):
        return replace(g, vertices=g.vertices + by)
    if isinstance(g, Parallelogram):
        return replace(g, corner=_plus(g.corner, by))
    if isinstance(g, Cylinder):
        return replace(g, p0=_plus(g.p0, by), p1=_plus(g.p1, by))
    assert isinstance(g, Sphere | Disk)
    return replace(g, center=_plus(g.center, by))


def _moved_light(light: Light, by: NDArray[np.float64]) -> Light:
    if isinstance(light, PointLight | SpotLight | ProjectorLight):
        return replace(light, position=_plus(light.position, by))
    return light
