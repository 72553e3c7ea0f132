"""A scene's tree as a Mitsuba 3 file, with the meshes and pictures that it names."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

from pmviewer.bench.agree.files import grid_file, mesh_file, picture_file
from pmviewer.bench.agree.media import has_media
from pmviewer.bench.agree.tree import TEXTURES, Node, written_out

SIZE = 64
"""Pixels of a picture's edge. A pass costs a millisecond or three whatever its size, and the noise of small discs goes
with camera rays times photons: more pixels and fewer photons give the same noise for a fifth of the time."""
MAX_DEPTH = 256
"""Scatterings of the longest path that either side follows."""
_POINTS = frozenset(("position", "center", "p0", "p1"))
_VECTORS = frozenset(("direction",))


def number(x: float) -> str:
    """The shortest text that reads back as the same number, never "1e-05", which some readers of XML refuse."""
    return repr(float(x)) if "e" not in repr(float(x)) else f"{float(x):.17f}".rstrip("0")


def _numbers(values: list[float]) -> str:
    return ", ".join(number(v) for v in values)


def _xyz(values: list[float]) -> str:
    return " ".join(f'{axis}="{number(v)}"' for axis, v in zip("xyz", values, strict=True))


def _transform(name: str, steps: list[Any]) -> str:
    text = []
    for step in steps:
        if step[0] == "rotate":
            text.append(f'<rotate {_xyz(step[1])} angle="{number(step[2])}"/>')
        elif step[0] == "matrix":
            text.append(f'<matrix value="{_numbers(step[1])}"/>')
        elif step[0] == "lookat":
            origin, target, up = (_numbers(v) for v in step[1:])
            text.append(f'<lookat origin="{origin}" target="{target}" up="{up}"/>')
        else:
            text.append(f"<{step[0]} {_xyz(step[1])}/>")
    return f'<transform name="{name}">{"".join(text)}</transform>'


def _property(name: str, value: Any, folder: Path) -> str:
    if isinstance(value, dict):
        if name == "mesh":
            return f'<string name="filename" value="{mesh_file(value, folder)}"/>'
        if name == "picture":
            return f'<string name="filename" value="{picture_file(value, folder)}"/>'
        if name == "grid":
            return f'<string name="filename" value="{grid_file(value, folder)}"/>'
        if name == "medium":
            return _element("medium", value, folder, "interior")
        if value["type"] == "gridvolume":
            return _element("volume", value, folder, name)
        tag = {"bsdf": "bsdf", "inside": "bsdf", "emitter": "emitter", "phase": "phase"}.get(name, "texture")
        return _element(tag, value, folder, "" if tag != "texture" or name == "height" else name)
    if name == "group":
        return f"<ref id={quoteattr(value)}/>"
    if name in ("to_world", "to_uv"):
        return _transform(name, value)
    if name in _POINTS or name in _VECTORS:
        return f'<{"point" if name in _POINTS else "vector"} name="{name}" {_xyz(value)}/>'
    if isinstance(value, list):
        return f'<rgb name="{name}" value="{_numbers(value)}"/>'
    if isinstance(value, bool):
        return f'<boolean name="{name}" value="{str(value).lower()}"/>'
    if isinstance(value, int):
        return f'<integer name="{name}" value="{value}"/>'
    if isinstance(value, float):
        return f'<float name="{name}" value="{number(value)}"/>'
    return f'<string name="{name}" value={quoteattr(value)}/>'


def _element(tag: str, node: Node, folder: Path, name: str = "", id: str = "") -> str:
    if tag == "texture" and node["type"] not in TEXTURES:
        raise ValueError(f"{node['type']} is no texture")
    label = "".join(f" {key}={quoteattr(v)}" for key, v in (("name", name), ("id", id)) if v)
    inside = "".join(_property(key, value, folder) for key, value in node.items() if key != "type")
    return f'<{tag} type="{node["type"]}"{label}>{inside}</{tag}>'


def _scaled(node: Node, s: float) -> Node:
    """A shape or light with its lengths times s, so that the picture stays the same."""
    if s == 1:
        return node
    node = dict(node)
    if node["type"] == "point":
        node["position"] = [s * x for x in node["position"]]
    if node["type"] in ("point", "spot"):
        node["intensity"] = [s * s * x for x in node["intensity"]]
    if node["type"] == "projector":
        node["scale"] = s * s * node.get("scale", 1.0)
    if node["type"] in ("spot", "projector"):
        node["to_world"] = [_moved(step, s) if step[0] == "lookat" else step for step in node["to_world"]]
    elif node["type"] not in ("point", "directional", "constant", "envmap"):
        node["to_world"] = [*node.get("to_world", []), ["scale", [s, s, s]]]
    return node


def _moved(lookat: list[Any], s: float) -> list[Any]:
    """The same view from s times as far from the origin."""
    return ["lookat", *([s * x for x in v] for v in lookat[1:3]), lookat[3]]


def _camera(camera: Node, s: float, size: int) -> str:
    origin, target = ([s * x for x in camera[key]] for key in ("origin", "target"))
    view = _transform("to_world", [["lookat", origin, target, camera["up"]]])
    near, far = number(1e-4 * s), number(1e4 * s)
    return f"""<sensor type="perspective">{view}
<float name="fov" value="{number(camera["fov"])}"/>
<float name="near_clip" value="{near}"/><float name="far_clip" value="{far}"/>
<sampler type="independent"/><film type="hdrfilm"><integer name="width" value="{size}"/>
<integer name="height" value="{size}"/><rfilter type="box"/></film></sensor>"""


def scene_text(scene: Node, folder: Path, size: int = SIZE) -> str:
    """The scene's file; writes the files that it names into `folder`."""
    s = scene["scale"]
    if not (s > 0 and math.isfinite(s)):
        raise ValueError(f"a scene of scale {s}")
    kind = "volpath" if has_media(scene) else "path"
    integrator = f'<integrator type="{kind}"><integer name="max_depth" value="{MAX_DEPTH + 1}"/></integrator>'
    lines = ['<scene version="3.0.0">', integrator, _camera(scene["camera"], s, size)]
    for name, members in scene["groups"].items():
        inside = "\n ".join(_element("shape", shape, folder) for shape in members)
        lines.append(f'<shape type="shapegroup" id={quoteattr(name)}>\n {inside}\n</shape>')
    lines += [_element("shape", _scaled(shape, s), folder) for shape in scene["shapes"]]
    lines += [_element("emitter", _scaled(light, s), folder) for light in scene["lights"]]
    return "\n".join([*lines, "</scene>", ""])


def write_scene(scene: Node, folder: Path, name: str, size: int = SIZE) -> tuple[Path, Path]:
    """Write the scene as `name`.xml. The second path is the file for Mitsuba, mostly the same one: without groups in
    groups, which it does not know, and at scale 1, since its rays leave surfaces by 9e-5 of a unit at least."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.xml"
    path.write_text(scene_text(scene, folder, size), encoding="utf-8")
    nested = any(shape["type"] == "instance" for group in scene["groups"].values() for shape in group)
    if not nested and scene["scale"] == 1:
        return path, path
    flat = folder / f"{name}_for_mitsuba.xml"
    flat.write_text(scene_text({**written_out(scene), "scale": 1.0}, folder, size), encoding="utf-8")
    return path, flat
