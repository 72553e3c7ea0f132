"""What is in a scene, by the names that the bench's table uses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pmviewer.bench.agree.generate import needs_particles
from pmviewer.bench.agree.lights import DELTA
from pmviewer.bench.agree.materials import METALLIC, TRANSPARENT
from pmviewer.bench.agree.media import DENSE
from pmviewer.bench.agree.tree import MAPS, TEXTURES, Node, bsdfs_of, emitters_of, nodes, shapes_of

GROUPS = ("shape", "transform", "bsdf", "texture", "light", "medium", "scene", "camera", "profile")


def features(scene: Node) -> set[str]:
    """Names like "bsdf: conductor"; each begins with one of `GROUPS`."""
    return {
        *_shapes(scene),
        *_transforms(scene),
        *_materials(scene),
        *_lights(scene),
        *_media(scene),
        *_whole(scene),
        f"camera: {scene['camera']['place']}",
        f"profile: {scene['profile']}",
    }


def _shapes(scene: Node) -> Iterator[str]:
    for shape in shapes_of(scene):
        yield f"shape: {shape['type']}"
        if shape.get("flip_normals"):
            yield "shape: flipped normals"
        if shape.get("face_normals"):
            yield "shape: face normals"
        if "mesh" in shape:
            yield f"shape: {shape['mesh']['kind']} mesh"
            if shape["mesh"]["tilt"] and not shape.get("face_normals"):
                yield "shape: tilted vertex normals"
            if not shape["mesh"]["normals"]:
                yield "shape: mesh without normals"


def _transforms(scene: Node) -> Iterator[str]:
    for shape in shapes_of(scene):
        steps = shape.get("to_world", [])
        scales = [step[1] for step in steps if step[0] == "scale"]
        if np.prod([np.prod(s) for s in scales]) < 0:
            yield "transform: mirrored"
        if any(len({abs(x) for x in s}) > 1 for s in scales):
            yield "transform: uneven"
        if any(step[0] == "matrix" for step in steps):
            yield "transform: sheared"
        lengths = [np.linalg.norm(step[1]) for step in steps if step[0] == "rotate"]
        if any(abs(length - 1) > 1e-3 for length in lengths):
            yield "transform: axis not of unit length"
    if any(shape["type"] == "instance" for members in scene["groups"].values() for shape in members):
        yield "transform: groups in groups"


def _materials(scene: Node) -> Iterator[str]:
    for node in nodes(scene):
        kind = node["type"]
        if kind in TEXTURES:
            yield f"texture: {kind}"
            if kind == "bitmap":
                yield f"texture: {node['filter_type']}"
                yield f"texture: {node['wrap_mode']}"
        if kind in MAPS or kind == "twosided":
            yield f"bsdf: {kind}"
        if isinstance(node.get("alpha"), dict):
            yield "texture: roughness"
        if "alpha_u" in node:
            yield "bsdf: anisotropic"
    for bsdf in bsdfs_of(scene):
        yield f"bsdf: {bsdf['type']}"
        if "glass" in bsdf or "abbe" in bsdf:
            yield "bsdf: dispersion"
        if "distribution" in bsdf:
            yield f"bsdf: {bsdf['distribution']}"


def _lights(scene: Node) -> Iterator[str]:
    for light in scene["lights"]:
        yield f"light: {light['type']}"
    for shape in scene["shapes"]:
        if "emitter" in shape:
            yield f"light: area on {shape['type']}"
            if isinstance(shape["emitter"]["radiance"], dict):
                yield "light: textured area"
            moved = [step for step in shape["to_world"] if step[0] == "translate"]
            if moved and moved[-1][1][2] <= 0.4:
                yield "light: touches or crosses"
    if len(emitters_of(scene)) > 1:
        yield "light: several"
    if needs_particles(scene):
        yield "light: caustics that paths don't find"
    if not any(light["type"] in DELTA for light in scene["lights"]):
        yield "light: area and environment alone"


def _media(scene: Node) -> Iterator[str]:
    for medium in (shape["medium"] for shape in shapes_of(scene) if "medium" in shape):
        yield f"medium: {medium['type']}"
        if medium["scale"] >= DENSE:
            yield "medium: dense"
        if isinstance(medium["sigma_t"], dict) and medium["sigma_t"]["grid"]["channels"] == 3:
            yield "medium: coloured lattice"
        if isinstance(medium["albedo"], dict):
            yield "medium: lattice of albedo"
        if "phase" in medium:
            yield "medium: hg"
        if "emission" in medium:
            yield f"medium: emission{' in a lattice' if isinstance(medium['emission'], dict) else ''}"


def _whole(scene: Node) -> Iterator[str]:
    kinds = {bsdf["type"] for bsdf in bsdfs_of(scene)}
    if kinds <= {*METALLIC}:
        yield "scene: metal alone"
    if kinds <= {*TRANSPARENT}:
        yield "scene: glass alone"
    if not any("diffuse" in kind or "plastic" in kind for kind in kinds):
        yield "scene: nothing diffuse"
    yield "scene: closed" if scene["closed"] else "scene: open"
    if "stage" in scene:
        yield f"scene: wide stage under a {scene['stage']}"
    if scene["nested"]:
        yield "scene: nested glass"
    if scene["scale"] < 1:
        yield "scene: small scale"
    if scene["scale"] > 1:
        yield "scene: large scale"
