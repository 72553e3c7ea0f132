"""Scenes twice, for Mitsuba 3 and as descriptions: surfaces that rays pass, colours at vertices, views."""

from __future__ import annotations

from typing import Any

import numpy as np

from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    Material,
    Mesh,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.scene.texture import Checkerboard

SIZE = (48, 32)
ORIGIN, TARGET, UP = (0.3, -4.5, 2.6), (0.0, 0.0, 0.7), (0.0, 0.0, 1.0)
SKY = (1.0, 0.9, 0.8)

CORNERS = [[-1.0, -1.0, 0.3], [1.2, -0.8, 0.1], [1.0, 1.0, 0.9], [-1.1, 0.9, 0.2], [0.1, 0.0, 1.6]]
FACES = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
COLOURS = [[0.9, 0.1, 0.1], [0.1, 0.8, 0.2], [0.2, 0.2, 0.9], [0.9, 0.9, 0.1], [0.6, 0.6, 0.6]]

CAMERAS = {
    "perspective": Camera(ORIGIN, TARGET, UP, 42.0),
    "orthographic": Camera(ORIGIN, TARGET, UP, 42.0, projection="orthographic", width=3.4),
    "shifted": Camera(ORIGIN, TARGET, UP, 42.0, shift=(0.17, -0.12)),
    "hiding": Camera(ORIGIN, TARGET, UP, 42.0, hides_lights=True),
}
VIEWS = {
    "veils_area": "perspective",
    "veils_sky": "perspective",
    "vertex_colours": "perspective",
    "orthographic": "orthographic",
    "shifted": "shifted",
    "hidden_lights": "hiding",
}


def rectangle(center: Any, u: Any, v: Any) -> Parallelogram:
    """Of half edges u and v around the centre: Mitsuba's rectangle under the matrix that maps x, y to them."""
    c, u, v = (np.array(x, float) for x in (center, u, v))
    corner, edge_u, edge_v = (tuple(float(k) for k in p) for p in (c - u - v, 2 * u, 2 * v))
    return Parallelogram(corner, edge_u, edge_v)  # type: ignore[arg-type]


def matte(name: str, colour: Any, **more: Any) -> Material:
    return Material(name, "diffuse", colour, two_sided=True, **more)


FIELDS = Checkerboard((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (8.0, 0, 0, 0, 4.0, 0))
THIN_FIELDS = Checkerboard((1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (3.0, 0, 0, 0, 5.0, 0))

PARTS: dict[str, tuple[Any, Material]] = {
    "floor": (rectangle((0, 0, 0), (3, 0, 0), (0, 3, 0)), matte("floor", (0.6, 0.6, 0.6))),
    "veil": (rectangle((-0.9, 0, 1.2), (0.8, 0, 0.1), (0, 0.8, 0)), matte("veil", (0.8, 0.3, 0.2), opacity=0.3)),
    "ball": (
        Sphere((0.8, -0.2, 0.8), 0.6),
        matte("ball", (0.2, 0.4, 0.8), opacity=0.5, textures={"opacity": FIELDS}),
    ),
    "screen": (
        rectangle((0, 1.2, 1.0), (1.5, 0, 0), (0, 0, 0.9)),
        matte("screen", (0.7, 0.7, 0.3), opacity=0.75, textures={"opacity": THIN_FIELDS}),
    ),
}
SOLIDS = {"floor": "floor", "veil": "floor", "ball": "floor", "screen": "floor"}
LIGHT = rectangle((0.2, -0.3, 3.0), (1.2, 0, 0), (0, -1.2, 0))
RADIANCE = (3.0, 2.7, 2.2)
LAMPS = {
    "lamp": Sphere((-0.1, -3.4, 2.2), 0.1),
    "panel": rectangle((0.35, -3.4, 2.15), (0.12, 0, 0), (0, -0.05, -0.12)),
}
"""Before all else that the camera sees; Mitsuba's has a near plane behind them, for what it finds behind emitters that
it hides is not where it is (3.9.1)."""
LAMP_RADIANCE, NEAR = (150.0, 135.0, 110.0), 1.6


def description(name: str) -> Scene:
    """The scene as loaders would describe it."""
    camera = CAMERAS[VIEWS[name]]
    sky = (ConstantEnvironment("sky", SKY),)
    if name == "vertex_colours":
        mesh = Mesh(np.array(CORNERS), np.array(FACES, np.int32), colours=np.array(COLOURS))
        floor = PARTS["floor"]
        shapes = (Shape("floor", floor[0], 0), Shape("tent", mesh, 1))
        materials = (floor[1], matte("tent", (1.0, 1.0, 1.0), vertex_colours=True))
        return Scene(name, None, shapes, materials, sky, camera, *SIZE)
    materials = tuple(material for _, material in PARTS.values())
    if not name.startswith("veils"):
        materials = tuple(Material(m.name, m.kind, m.reflectance, two_sided=True) for m in materials)
    shapes = tuple(Shape(part, geometry, i) for i, (part, (geometry, _)) in enumerate(PARTS.items()))
    if name == "veils_area":
        shapes, sky = (*shapes, Shape("light", LIGHT, 0, RADIANCE)), ()
    if name == "hidden_lights":
        shapes = (*shapes, *(Shape(lamp, geometry, 0, LAMP_RADIANCE) for lamp, geometry in LAMPS.items()))
        sky = ()
    return Scene(name, None, shapes, materials, sky, camera, *SIZE)


def for_mitsuba(name: str, mi: Any) -> dict[str, Any]:
    """The same as a dictionary for `mitsuba.load_dict`."""
    transform = mi.ScalarTransform4f
    camera = CAMERAS[VIEWS[name]]
    view = transform().look_at(list(camera.origin), list(camera.target), list(camera.up))
    film = {"type": "hdrfilm", "width": SIZE[0], "height": SIZE[1], "rfilter": {"type": "box"}}
    sensor: dict[str, Any] = {"type": "perspective", "fov": camera.fov, "to_world": view, "film": film}
    if camera.projection == "orthographic":
        half = camera.width / 2
        sensor = {"type": "orthographic", "to_world": view @ transform().scale([half, half, 1]), "film": film}
    if any(camera.shift):
        sensor |= {"principal_point_offset_x": camera.shift[0], "principal_point_offset_y": camera.shift[1]}
    # Mitsuba's `path` multiplies light samples on masked surfaces by the opacity twice (3.9.1); its `volpath` does not.
    integrator = {"type": "volpath", "max_depth": -1, "rr_depth": 12}
    if camera.hides_lights:
        sensor["near_clip"] = NEAR
    found: dict[str, Any] = {"type": "scene", "integrator": integrator, "sensor": sensor}

    def matte_of(material: Material) -> dict[str, Any]:
        inside = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(material.reflectance)}}
        bsdf: dict[str, Any] = {"type": "twosided", "inside": inside}
        if not name.startswith("veils") or not material.passable:
            return bsdf
        opacity: Any = material.opacity
        if "opacity" in material.textures:
            texture = material.textures["opacity"]
            # As a number, unlike as a colour, Mitsuba's checkerboard has its fields the other way round (3.9.1).
            opacity = {
                "type": "checkerboard",
                "color0": {"type": "rgb", "value": list(texture.color1)},
                "color1": {"type": "rgb", "value": list(texture.color0)},
                "to_uv": transform().scale([texture.to_uv[0], texture.to_uv[4], 1]),
            }
        return {"type": "mask", "opacity": opacity, "inside": bsdf}

    def shape_of(geometry: Any) -> dict[str, Any]:
        if isinstance(geometry, Sphere):
            return {"type": "sphere", "center": list(geometry.center), "radius": geometry.radius}
        corner, u, v = (np.array(x) for x in (geometry.corner, geometry.edge_u, geometry.edge_v))
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1] = u / 2, v / 2
        matrix[:3, 2] = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        matrix[:3, 3] = corner + u / 2 + v / 2
        return {"type": "rectangle", "to_world": transform(matrix)}

    parts = ["floor"] if name == "vertex_colours" else list(PARTS)
    for part in parts:
        geometry, material = PARTS[part]
        found[part] = {**shape_of(geometry), "bsdf": matte_of(material)}
    if name == "hidden_lights":
        shining = {"type": "area", "radiance": {"type": "rgb", "value": list(LAMP_RADIANCE)}}
        for lamp, geometry in LAMPS.items():
            found[lamp] = {**shape_of(geometry), "emitter": shining, "bsdf": matte_of(PARTS["floor"][1])}
    elif name == "veils_area":
        light = {"type": "area", "radiance": {"type": "rgb", "value": list(RADIANCE)}}
        found["light"] = {**shape_of(LIGHT), "emitter": light, "bsdf": matte_of(PARTS["floor"][1])}
    else:
        found["sky"] = {"type": "constant", "radiance": {"type": "rgb", "value": list(SKY)}}
    if name == "vertex_colours":
        colour = {"type": "mesh_attribute", "name": "vertex_color"}
        bsdf = mi.load_dict({"type": "twosided", "inside": {"type": "diffuse", "reflectance": colour}})
        properties = mi.Properties()
        properties["bsdf"] = bsdf
        properties["face_normals"] = True
        mesh = mi.Mesh("tent", len(CORNERS), len(FACES), has_vertex_normals=False, props=properties)
        mesh.add_attribute("vertex_color", 3, np.array(COLOURS, np.float32).ravel())
        values = mi.traverse(mesh)
        values["vertex_positions"] = np.array(CORNERS, np.float32).ravel()
        values["faces"] = np.array(FACES, np.uint32).ravel()
        values.update()
        found["tent"] = mesh
    return found
