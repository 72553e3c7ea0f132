"""What a file leaves out: a camera that sees the scene, and light to see it by."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SceneError
from pmviewer.scene.arrays.covered_emission import without_unseen_lights
from pmviewer.scene.arrays.instances import joint_bounds
from pmviewer.scene.arrays.media import media_emitting
from pmviewer.scene.clean import check_camera
from pmviewer.scene.defaults.framing import Up
from pmviewer.scene.defaults.light_reach import lights_enough
from pmviewer.scene.defaults.light_rigs import Rig, headlight, overcast_sky, sunlight
from pmviewer.scene.defaults.picture_rating import picture_rays
from pmviewer.scene.defaults.proxy import Proxy, proxy_of
from pmviewer.scene.defaults.studio import Studio, has_ground, has_level_bottom, room_light, studio_of
from pmviewer.scene.defaults.viewpoint import Viewpoint, chosen_viewpoint, enclosure, sees
from pmviewer.scene.description import Camera, Environment, Light, Scene

Float = NDArray[np.float64]
ROOM = 0.7
"""Share of the directions from a place with a surface in them, from which on it is lit as a room is: from inside."""
NO_LIGHT = "The file has no light"
TOO_LITTLE = "The file's lights bring next to nothing to what the camera sees"


def completed(scene: Scene, rig: Rig = "auto") -> Scene:
    """The scene as read from its file with a camera, if the file has none, and with the lights of that rig.

    auto: the file's lights; what it needs where they bring next to nothing. file: the file's alone. Any other rig
    replaces all of the file's lights but surfaces that glow. Raises SceneError for `file` if there are none.
    """
    scene = without_unseen_lights(scene)
    own = bool(scene.lights) or any(s.radiance and max(s.radiance) > 0 for s in scene.shapes)
    own = own or media_emitting(scene) > 0
    if rig == "file" and not own:
        hint = "Choose another value of light.rig: auto adds light."
        raise SceneError("The file has no light, and light.rig asks for the file's alone.", scene.path, hint=hint)
    framed = not scene.cameras
    as_is = own and _is_rendering(scene)
    if not framed and (rig == "file" or (rig == "auto" and as_is)):
        return scene
    proxy = proxy_of(scene)
    if proxy is None:
        return scene
    up = upright(scene, proxy)
    if framed:
        view = chosen_viewpoint(proxy, up)
        check_camera(view.camera, scene.path)
        scene = replace(scene, camera=view.camera)
    else:
        view = _of_camera(proxy, scene.camera)
    if rig == "file":
        return scene
    if rig == "auto":
        if as_is or (own and lights_enough(scene, proxy, _opaque(scene), scene.camera)):
            return scene
        return _with_studio(scene, proxy, view, up, TOO_LITTLE if own else NO_LIGHT)
    if rig == "studio":
        return _with_studio(replace(scene, lights=()), proxy, view, up, None)
    lights: tuple[Light, ...]
    if rig == "overcast":
        lights = (overcast_sky(up),)
    elif rig == "sun":
        lights = sunlight(up, scene.camera)
    else:
        lights = (headlight(scene.camera, _distance(proxy, scene.camera)),)
    return replace(scene, lights=lights)


def _with_studio(scene: Scene, proxy: Proxy, view: Viewpoint, up: Up, why: str | None) -> Scene:
    """Shapes and lights of a studio added, or of a room's lamp; `why` begins the sentence that says so."""
    first = len(scene.materials)
    box = joint_bounds(scene.shapes, scene.instances)
    if view.inside or (view.enclosed >= ROOM and _looks_into(proxy, scene.camera, view.place)):
        studio = room_light(proxy, view, up, first)
        added = "a light under the ceiling" + (" and a sky were" if studio.sky else " was")
    else:
        floor = not has_ground(proxy, box, up)
        studio = studio_of(box, up, first, np.asarray(scene.camera.origin), floor=floor)
        added = "a soft light above it, a dim sky and a floor were" if floor else "a soft light and a dim sky were"
    warnings = scene.warnings if why is None else (*scene.warnings, f"{why}: {added} added.")
    return replace(
        scene,
        shapes=(*scene.shapes, *studio.shapes),
        materials=(*scene.materials, *studio.materials),
        lights=_with_sky(scene.lights, studio),
        warnings=warnings,
    )


def _looks_into(proxy: Proxy, camera: Camera, place: Float) -> bool:
    """Does most of what the camera sees lie in sight of the place? A hole in the side of a block is no room."""
    rays = picture_rays(camera, 24)
    hits = proxy.closest(np.broadcast_to(camera.origin, rays.shape), rays)
    if not hits.met.any():
        return False
    found = np.asarray(camera.origin) + (hits.distance[:, None] * rays)[hits.met]
    way = place - found
    distance = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    return float(proxy.occluded(found, way / distance[:, None], distance).mean()) <= 0.5


def _with_sky(lights: tuple[Light, ...], studio: Studio) -> tuple[Light, ...]:
    if studio.sky is None or any(isinstance(light, Environment) for light in lights):
        return lights
    return (*lights, studio.sky)


def _opaque(scene: Scene) -> Proxy | None:
    opaque = [not material.transparent and material.opacity > 0.5 for material in scene.materials]
    return proxy_of(scene, np.array([opaque[shape.material] for shape in scene.all_shapes]))


def _of_camera(proxy: Proxy, camera: Camera) -> Viewpoint:
    """Does the file's camera stand in a room, or look into one?"""
    eye, target = np.asarray(camera.origin, float), np.asarray(camera.target, float)
    around = enclosure(proxy, eye)
    if around >= ROOM:
        return Viewpoint(camera, True, eye, around)
    return Viewpoint(camera, False, target, enclosure(proxy, target) if sees(proxy, camera, target) else 0.0)


def _distance(proxy: Proxy, camera: Camera) -> float:
    """Median distance of what the camera sees."""
    rays = picture_rays(camera, 16)
    hits = proxy.closest(np.broadcast_to(camera.origin, rays.shape), rays)
    if hits.met.any():
        return float(np.median(hits.distance[hits.met]))
    return max(math.dist(camera.origin, camera.target), 1e-6 * proxy.radius)


def _is_rendering(scene: Scene) -> bool:
    """Is the file made to be rendered by its own lights alone, as Mitsuba's are? Others are made for viewers too."""
    return scene.path is not None and scene.path.suffix.lower() == ".xml"


def upright(scene: Scene, proxy: Proxy) -> Up:
    """The vertical axis: the format's. Where that has none: the one that the file's camera is upright along; y, or z
    where the scene stands on a flat ground at the lower end of its z axis and has none at that of its y axis, and is
    less than half as deep as it is wide."""
    if scene.up is not None:
        return scene.up
    if scene.cameras:
        along = np.abs(scene.camera.up)
        return "z" if along[2] > along[1] else "y"
    low, high = proxy.corners.min(axis=(0, 1)), proxy.corners.max(axis=(0, 1))
    size = high - low
    flat = size[2] < 0.5 * max(size[0], size[1])
    box = low, high
    return "z" if flat and has_level_bottom(proxy, box, "z") and not has_level_bottom(proxy, box, "y") else "y"
