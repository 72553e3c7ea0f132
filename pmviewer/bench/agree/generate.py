"""Random scenes. Scene i of seed S is a pure function of (S, i).

Each scene follows a profile, by i in turn. A profile decides for which record of scenes kernels are compiled (rich
materials, more lights, textures, instances: `pmviewer.kernels.scene.scene_dtype`), so that a run needs few variants
however many scenes it has, and no feature is left out. What is known to differ is taken out of most scenes, lest it
hide the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from pmviewer.bench.agree import lights, materials, media, shapes
from pmviewer.bench.agree.draw import Draw
from pmviewer.bench.agree.known import DEVIATIONS
from pmviewer.bench.agree.materials import METALLIC, TRANSPARENT, Materials
from pmviewer.bench.agree.stages import stage
from pmviewer.bench.agree.tree import Node, bsdfs_of


@dataclass(frozen=True)
class Profile:
    """`bsdfs`: types to draw from. `rich`, `more_lights`, `textured`, `instances`: the record's variants. `room`: how
    often the scene is closed. `tilted`: meshes have tilted vertex normals. `ground`: types of what surrounds the rest,
    `bsdfs` if empty. `nested`: glass inside glass, the camera sometimes within.
    `lights`: types to draw from, by `more_lights` if empty. `medium`: something is filled with one."""

    name: str
    bsdfs: tuple[str, ...]
    rich: bool = True
    more_lights: bool = False
    textured: bool = False
    instances: bool = False
    room: float = 0.3
    tilted: bool = False
    ground: tuple[str, ...] = ()
    nested: bool = False
    lights: tuple[str, ...] = ()
    medium: bool = False

    @property
    def kinds(self) -> tuple[str, ...]:
        """Types of lights without a surface."""
        return self.lights or (lights.MORE if self.more_lights else lights.PLAIN)


_GLOSSY = ("roughconductor", "roughplastic", "conductor", "roughdielectric", "plastic")
PROFILES = (
    Profile("plain", materials.PLAIN, rich=False, ground=("diffuse",)),
    Profile("materials", materials.RICH, ground=("diffuse", "diffuse", "roughplastic", "roughconductor")),
    Profile("lights", materials.RICH, more_lights=True, ground=("diffuse", "roughplastic")),
    Profile("textures", materials.RICH, more_lights=True, textured=True),
    Profile("metal only", METALLIC, more_lights=True, room=0.2),
    Profile("tilted normals", materials.RICH, tilted=True, room=0.0),
    Profile("instances", materials.RICH, more_lights=True, textured=True, instances=True),
    Profile("glass only", TRANSPARENT, room=0.1, nested=True),
    Profile("no diffuse", _GLOSSY, more_lights=True, textured=True),
    Profile("nested glass", TRANSPARENT, ground=("diffuse",), nested=True, room=0.4),
    Profile("rooms", materials.RICH, room=1.0, more_lights=True, ground=("diffuse", "diffuse", "roughplastic")),
    Profile("plain lights", materials.PLAIN, rich=False, room=0.5, ground=("diffuse",)),
)
DISPERSING, DISPERSION_SEED = "nested glass", 0xD15
"""The profile in whose scenes every second time the glass splits light, which Mitsuba's RGB variants don't know."""
MEDIA = Profile("media", materials.PLAIN, rich=False, ground=("diffuse",), lights=("constant",), medium=True)
EVERY = 13
"""One in so many scenes has a medium."""
GLOWING_FROM, GLOW_SEED = 10_000, 0x610
"""From this number on to the next all scenes have media that emit; those before it are as they were without any."""
DENSE_FROM, DENSE_SEED = 20_000, 0xDE5
"""From this number on to the next all scenes have dense media, which don't emit."""
PROJECTED_FROM, PROJECTOR_SEED = 30_000, 0x9E0
"""From this number on to the next scenes follow the profiles again, and all have projectors."""
STAGED_FROM, STAGE_SEED = 40_000, 0x57A6E
"""From this number on they do so on wide stages, without projectors."""
SCALES = (1e-3, 1e-2, 0.1, 10.0, 100.0, 1e3)
HALF = 2.0
"""Half the edge of the ground, and of a room."""


def scene_of(seed: int, index: int) -> Node:
    """Scene `index` of `seed`."""
    in_media = index % EVERY == EVERY - 1 or GLOWING_FROM <= index < PROJECTED_FROM
    profile = MEDIA if in_media else PROFILES[index % len(PROFILES)]
    if in_media and index >= PROJECTED_FROM:
        profile = replace(MEDIA, bsdfs=("diffuse",))  # Mitsuba's particles know no media, its paths no caustics
    draw = Draw(seed, index)
    closed = draw.chance(profile.room)
    profile = _choose(draw, profile, closed)
    made = Materials(draw, profile.rich, profile.textured)
    scene: Node = {"profile": profile.name, "scale": draw.pick(SCALES) if draw.chance(0.35) else 1.0, "groups": {}}
    scene |= {"closed": closed, "nested": False}
    scene["shapes"] = _surroundings(draw, made, profile, closed)
    surroundings = len(scene["shapes"])
    _fill(draw, made, profile, scene)
    scene["lights"] = []
    _light(draw, made, profile, closed, scene)
    _require(draw, made, profile, scene)
    if profile.medium:
        scene["scale"] = 1.0
        media.fill(draw, scene)
        if DENSE_FROM <= index < PROJECTED_FROM:
            media.thicken(Draw(seed + DENSE_SEED, index), scene)
        elif GLOWING_FROM <= index < DENSE_FROM:
            media.ignite(Draw(seed + GLOW_SEED, index), scene)
    if index >= STAGED_FROM:
        stage(Draw(seed + STAGE_SEED, index), scene, surroundings, HALF)
    elif index >= PROJECTED_FROM:
        lights.project(Draw(seed + PROJECTOR_SEED, index), scene)
    scene["camera"] = _camera(draw, scene["closed"], scene)
    for deviation in DEVIATIONS:
        if deviation.rare and profile.name != "tilted normals" and draw.chance(0.85):
            scene = deviation.without(scene) or scene
    if needs_particles(scene) and draw.chance(0.8):
        _near_lights_alone(scene)
    if profile.name == DISPERSING and index // len(PROFILES) % 2 == 1:
        _disperse(Draw(seed + DISPERSION_SEED, index), scene)
    if needs_particles(scene):
        for shape in scene["shapes"]:
            if "mesh" in shape and "emitter" in shape:
                shape["face_normals"] = True
            emitter = shape.get("emitter", {})
            if _checkered(emitter, "radiance"):  # which Mitsuba's particle tracer can't start from
                emitter["radiance"] = emitter["radiance"]["color1"]
        for light in scene["lights"]:
            if _checkered(light, "irradiance"):
                light["irradiance"] = light["irradiance"]["color1"]
    return scene


def _choose(draw: Draw, profile: Profile, closed: bool) -> Profile:
    """A third of the scenes without lights of one point or direction, a third of rough surfaces: only where both meet
    can't path tracers be compared with photon maps."""
    what = draw.pick(("any", "soft lights", "rough surfaces"))
    if what == "soft lights":
        return replace(profile, lights=("envmap", "constant") if profile.more_lights else ("constant",))
    if what == "rough surfaces":
        rough = tuple(k for k in profile.bsdfs if not materials.is_delta({"type": k}))
        ground = tuple(k for k in profile.ground if not materials.is_delta({"type": k}))
        return replace(profile, bsdfs=rough or profile.bsdfs, ground=ground)
    return profile


def _disperse(draw: Draw, scene: Node) -> None:
    """Give most of the glass of the scene dispersion, some of it at least."""
    glass = [bsdf for bsdf in bsdfs_of(scene) if bsdf["type"] in ("dielectric", "roughdielectric")]
    for i, bsdf in enumerate(glass):
        if i > 0 and draw.chance(0.3):
            continue
        bsdf.pop("int_ior", None)
        if draw.chance(0.5):
            bsdf["glass"] = draw.pick(("BK7", "F2", "SF11", "diamond", "water"))
        else:
            bsdf |= {"int_ior": draw.number(1.2, 2), "abbe": draw.log(10, 80)}


def disperses(scene: Node) -> bool:
    """Whether glass of the scene splits light."""
    return any("glass" in bsdf or "abbe" in bsdf for bsdf in bsdfs_of(scene))


def _checkered(emitter: Node, name: str) -> bool:
    value = emitter.get(name)
    return isinstance(value, dict) and value["type"] == "checkerboard"


def needs_particles(scene: Node) -> bool:
    """Whether there are caustics that no path tracer finds: of lights without a surface, by lobes of one direction.

    Mitsuba's particle tracer finds them. It starts particles on smooth meshes by the cosine to the shading normal, its
    path tracer sees radiance that is constant instead; so in these scenes mesh lights get flat faces.
    """
    unseen = any(light["type"] in lights.DELTA for light in scene["lights"])
    return unseen and any(materials.is_delta(bsdf) for bsdf in bsdfs_of(scene))


def has_distant_lights(scene: Node) -> bool:
    """Whether there are lights at infinity, which Mitsuba's particle tracer shows wrong: between two walls it gives
    nothing of them, and elsewhere up to 2.8 times what Mitsuba's path tracer shows."""
    return any(light["type"] in lights.DISTANT for light in scene["lights"])


def _near_lights_alone(scene: Node) -> None:
    """Take lights at infinity out where others are left, so that particles can be compared."""
    near = [light for light in scene["lights"] if light["type"] not in lights.DISTANT]
    if near or any("emitter" in shape for shape in scene["shapes"]):
        scene["lights"] = near


def _surroundings(draw: Draw, made: Materials, profile: Profile, closed: bool) -> list[Node]:
    """A room, ground with or without a wall, or nothing."""
    kinds = profile.ground or tuple(k for k in profile.bsdfs if k not in TRANSPARENT)
    if not kinds:
        return []
    if closed:
        walls: Node = {"type": "cube", "to_world": [["scale", [HALF, HALF, 1.25]], ["translate", [0.0, 0.0, 1.25]]]}
        return [walls | {"flip_normals": draw.chance(0.5), "bsdf": _both(made.of(draw.pick(kinds)))}]
    ground: Node = {
        "type": "rectangle",
        "to_world": [["scale", [HALF, HALF, 1.0]]],
        "bsdf": _both(made.of(draw.pick(kinds))),
    }
    if profile.tilted:
        ground["type"] = draw.pick(("obj", "ply"))
        ground["mesh"] = shapes.mesh(draw, ground["type"], ("quad", "sheet"), draw.number(3, shapes.TILT), False)
    found = [ground]
    if draw.chance(0.5):
        turned = [["scale", [HALF, 1.2, 1.0]], ["rotate", [1.0, 0.0, 0.0], 90.0], ["translate", [0.0, HALF, 1.2]]]
        found.append({"type": "rectangle", "to_world": turned, "bsdf": _both(made.of(draw.pick(kinds)))})
    return found


def _both(bsdf: Node) -> Node:
    """With both sides, so that no room is black."""
    return bsdf if bsdf["type"] == "twosided" or _clear(bsdf) else {"type": "twosided", "inside": bsdf}


def _clear(bsdf: Node) -> bool:
    while "inside" in bsdf:
        bsdf = bsdf["inside"]
    return bsdf["type"] in TRANSPARENT


def _fill(draw: Draw, made: Materials, profile: Profile, scene: Node) -> None:
    """Objects on the ground, some of them partly under it, in each other, or instances."""
    for n in range(draw.integer(1, 4)):
        kind = draw.pick(shapes.KINDS)
        bsdf = made.of(draw.pick(profile.bsdfs))
        if profile.tilted:
            kind = draw.pick(("obj", "ply"))
        if profile.nested and draw.chance(0.7):
            kind = draw.pick(("sphere", "cube", "obj"))
        place = ["translate", [draw.number(-0.9, 0.9), draw.number(-0.9, 0.9), draw.number(0.2, 0.9)]]
        size = draw.number(0.3, 0.6)
        if profile.instances and draw.chance(0.7):
            scene["shapes"] += _instances(draw, made, profile, scene, n)
            continue
        node = shapes.shape(draw, kind, size, profile.tilted, profile.textured, closed=_clear(bsdf))
        node["to_world"].append(place)
        if draw.chance(0.15):
            node["flip_normals"] = True
        scene["shapes"].append(node | {"bsdf": bsdf})
        if profile.nested and kind in ("sphere", "cube") and draw.chance(0.6):
            inner = {**node, "to_world": [["scale", 3 * [draw.number(0.3, 0.7)]], *node["to_world"]]}
            scene["shapes"].append(inner | {"bsdf": made.of(draw.pick(profile.bsdfs))})
            scene["nested"] = True


def _instances(draw: Draw, made: Materials, profile: Profile, scene: Node, n: int) -> list[Node]:
    """One or two copies of a new group, at times of a group that shows another one."""
    group = f"g{n}"
    members = []
    for _ in range(draw.integer(1, 2)):
        bsdf = made.of(draw.pick(profile.bsdfs))
        node = shapes.shape(draw, draw.pick(shapes.KINDS), draw.number(0.4, 0.8), closed=_clear(bsdf), uv=True)
        node["to_world"].append(["translate", draw.within(0.4)])
        members.append(node | {"bsdf": bsdf})
    scene["groups"][group] = members
    if draw.chance(0.4):
        outer = f"{group}_outer"
        scene["groups"][outer] = [_instance(draw, group, 0.6, 0.4) for _ in range(draw.integer(1, 2))]
        if draw.chance(0.5):
            scene["groups"][outer].append(members[0] | {"to_world": shapes.steps(draw, False) + [["scale", 3 * [0.3]]]})
        group = outer
    found = []
    for _ in range(draw.integer(1, 2)):
        copy = _instance(draw, group, draw.number(0.4, 0.8), 0.0)
        copy["to_world"].append(["translate", [draw.number(-0.9, 0.9), draw.number(-0.9, 0.9), draw.number(0.3, 0.9)]])
        found.append(copy)
    return found


def _instance(draw: Draw, group: str, size: float, aside: float) -> Node:
    """A copy: turned, and as every shape in it may be, mirrored, uneven and sheared."""
    to_world: list[Any] = [["scale", [size, size, size]], *shapes.steps(draw, True)]
    return {"type": "instance", "group": group, "to_world": [*to_world, ["translate", draw.within(aside)]]}


def _light(draw: Draw, made: Materials, profile: Profile, closed: bool, scene: Node) -> None:
    """One to three lights. In a closed room they are inside."""
    above = 2.2 if closed else 2.8
    kinds = tuple(k for k in profile.kinds if not closed or k in ("point", "spot"))
    for _ in range(draw.pick((1, 1, 2, 3))):
        if not kinds or draw.chance(0.45):
            scene["shapes"].append(lights.area(draw, made, above, profile.textured and draw.chance(0.4)))
            continue
        kind = draw.pick(kinds)
        if kind in ("constant", "envmap") and any(light["type"] in ("constant", "envmap") for light in scene["lights"]):
            continue
        scene["lights"].append(lights.bare(draw, kind, above))
    if not scene["lights"] and not any("emitter" in shape for shape in scene["shapes"]):
        scene["shapes"].append(lights.area(draw, made, above, False, "rectangle"))


def _require(draw: Draw, made: Materials, profile: Profile, scene: Node) -> None:
    """What makes the scene's record the profile's: without it there would be more variants of kernels."""
    if profile.more_lights and not any(x["type"] in ("spot", "directional", "envmap") for x in scene["lights"]):
        scene["lights"] = [light for light in scene["lights"] if light["type"] != "constant"]
        scene["lights"].append(lights.bare(draw, "envmap" if "spot" not in profile.kinds else "spot", 2.2))
    post: Node = {"type": "disk", "to_world": [["scale", 3 * [0.15]], ["translate", [1.2, 0.9, 0.02]]]}
    if profile.rich:
        kind = draw.pick([k for k in profile.bsdfs if k != "diffuse"])
        scene["shapes"].append(post | {"bsdf": _rich(made.of(kind))})
    if profile.textured:
        kind = next(k for k in ("diffuse", "roughplastic", "roughconductor") if k in profile.bsdfs)
        bsdf = {"type": kind, "reflectance" if kind == "diffuse" else "specular_reflectance": made.texture()}
        moved = {"type": "rectangle", "to_world": [["scale", 3 * [0.2]], ["translate", [-1.2, 0.9, 0.03]]]}
        scene["shapes"].append(moved | {"bsdf": {"type": "twosided", "inside": bsdf}})
    if profile.instances and not any(shape["type"] == "instance" for shape in scene["shapes"]):
        scene["shapes"] += _instances(draw, made, profile, scene, 9)


def _rich(bsdf: Node) -> Node:
    """The BSDF with a parameter that plain scenes don't have."""
    inner = bsdf
    while "inside" in inner:
        inner = inner["inside"]
    if inner["type"] == "dielectric":
        inner["type"] = "thindielectric"
    if inner["type"] == "conductor" and not ("material" in inner or "eta" in inner):
        inner["material"] = "Cu"
    return bsdf


def _camera(draw: Draw, closed: bool, scene: Node) -> Node:
    """Outside, near a wall, or inside of glass where there is a glass ball."""
    glass = [s for s in scene["shapes"] if s["type"] == "sphere" and "emitter" not in s and _clear(s["bsdf"])]
    angle = draw.number(-0.9, 0.9) - math.pi / 2
    distance = 1.7 if closed else draw.number(2.5, 4)
    origin = [round(distance * math.cos(angle), 4), round(distance * math.sin(angle), 4), draw.number(0.5, 2.1)]
    place = "outside"
    if glass and not media.has_media(scene) and draw.chance(0.35):
        place = "in glass"
        moved = [step[1] for step in glass[0]["to_world"] if step[0] == "translate"]
        centre = glass[0].get("center", [0.0, 0.0, 0.0]) if not moved else moved[-1]
        origin = [round(c + draw.number(-0.05, 0.05), 4) for c in centre]
    elif draw.chance(0.2):
        place = "near a wall"
        origin = [0.3, -HALF + 0.01, 1.0] if closed else [0.3, -1.5, 0.02]
    target = [draw.number(-0.3, 0.3), draw.number(-0.3, 0.3), draw.number(0.2, 0.6)]
    if place == "in glass":
        target = [origin[0] + 0.1, origin[1] + 1.0, origin[2] - draw.number(-0.2, 0.5)]
    return {"origin": origin, "target": target, "up": [0.0, 0.1, 1.0], "fov": draw.number(35, 70), "place": place}
