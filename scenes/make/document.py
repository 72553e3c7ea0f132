"""A scene as text: Mitsuba 3's XML, the PLY meshes beside it, and scene.toml."""

from __future__ import annotations

import json
import shutil
import struct
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from make.mesh import Mesh, write_ply

Colour = tuple[float, float, float]


@dataclass
class MadeScene:
    """What a generator returns. `bsdfs` and `shapes` are XML elements; `meshes` maps file stems to geometry; `defaults`
    are the scene's own parameters beside spp, integrator, max_depth, rr_depth and res. `media` are XML elements, too,
    `around` is the id of the one that the camera stands in, and `grids` maps file stems to numbers (nz, ny, nx) or
    (nz, ny, nx, 3)."""

    title: str
    description: str
    shows: str
    origin: Colour
    target: Colour
    fov: float
    bsdfs: list[str]
    shapes: list[str]
    meshes: dict[str, Mesh] = field(default_factory=dict)
    defaults: dict[str, str] = field(default_factory=dict)
    aspect: tuple[int, int] = (256, 256)
    max_depth: int = -1
    media: tuple[str, ...] = ()
    around: str = ""
    grids: dict[str, NDArray[np.float32]] = field(default_factory=dict)


def numbers(*values: float) -> str:
    """Values as the file has them: the shortest text, at most nine digits."""
    return " ".join(f"{v + 0.0:.9g}" for v in values)


def rgb(name: str, *values: float) -> str:
    """<rgb> of one grey or three values."""
    return f'<rgb name="{name}" value="{numbers(*values)}"/>'


def number(name: str, value: float) -> str:
    return f'<float name="{name}" value="{numbers(value)}"/>'


def bsdf(kind: str, identifier: str, *values: str, two_sided: bool = False) -> str:
    """A named BSDF of these property elements."""
    inner = "".join(values)
    if two_sided:
        return f'<bsdf type="twosided" id="{identifier}"><bsdf type="{kind}">{inner}</bsdf></bsdf>'
    return f'<bsdf type="{kind}" id="{identifier}">{inner}</bsdf>'


def diffuse(identifier: str, *reflectance: float) -> str:
    """A diffuse surface that reflects on both sides."""
    return bsdf("diffuse", identifier, rgb("reflectance", *reflectance), two_sided=True)


def dielectric(identifier: str, inside: float, outside: float = 1.0, absorption: Colour | None = None) -> str:
    """A smooth boundary; its normals point to `outside`. `absorption` per metre, within."""
    extra = () if absorption is None else (rgb("absorption", *absorption),)
    return bsdf("dielectric", identifier, number("int_ior", inside), number("ext_ior", outside), *extra)


def fog(identifier: str, sigma_t: float, albedo: Colour, g: float = 0.0) -> str:
    """A homogeneous medium, its extinction per metre."""
    phase = f'<phase type="hg">{number("g", g)}</phase>' if g else ""
    values = number("sigma_t", sigma_t) + rgb("albedo", *albedo)
    return f'<medium type="homogeneous" id="{identifier}">{values}{phase}</medium>'


def grid(name: str, stem: str, low: Colour, high: Colour) -> str:
    """Numbers of `grids/stem.vol` in a box."""
    place = f'<scale value="{numbers(*(b - a for a, b in zip(low, high))).replace(" ", ", ")}"/>'
    place += f'<translate value="{numbers(*low).replace(" ", ", ")}"/>'
    file = f'<string name="filename" value="grids/{stem}.vol"/><transform name="to_world">{place}</transform>'
    return f'<volume type="gridvolume" name="{name}">{file}</volume>'


def smoke(identifier: str, stem: str, low: Colour, high: Colour, sigma: float, albedo: Colour) -> str:
    """A medium of the density in `grids/stem.vol`, `sigma` its extinction per metre where that is 1."""
    values = grid("sigma_t", stem, low, high) + number("scale", sigma)
    values += f'<volume type="constvolume" name="albedo">{rgb("value", *albedo)}</volume>'
    return f'<medium type="heterogeneous" id="{identifier}">{values}</medium>'


def flame(identifier: str, soot: str, light: str, box: tuple[Colour, Colour], sigma: float, albedo: Colour) -> str:
    """`smoke` that emits the radiance per metre in `grids/light.vol`, which is the program's own."""
    values = grid("sigma_t", soot, *box) + grid("emission", light, *box) + number("scale", sigma)
    values += f'<volume type="constvolume" name="albedo">{rgb("value", *albedo)}</volume>'
    return f'<medium type="heterogeneous" id="{identifier}">{values}</medium>'


def boundary(low: Colour, high: Colour, inside: str) -> str:
    """A box that nothing shows but the medium in it."""
    size = ", ".join(numbers((b - a) / 2) for a, b in zip(low, high))
    middle = ", ".join(numbers((b + a) / 2) for a, b in zip(low, high))
    place = f'<transform name="to_world"><scale value="{size}"/><translate value="{middle}"/></transform>'
    return f'<shape type="cube">{place}<bsdf type="null"/><ref name="interior" id="{inside}"/></shape>'


BLACK = bsdf("diffuse", "black", rgb("reflectance", 0.0))


def mesh(stem: str, material: str, flat: bool = False, transform: str = "") -> str:
    """A shape of `meshes/stem.ply`."""
    faces = '<boolean name="face_normals" value="true"/>' if flat else ""
    place = f'<transform name="to_world">{transform}</transform>' if transform else ""
    file = f'<string name="filename" value="meshes/{stem}.ply"/>'
    return f'<shape type="ply">{file}{faces}{place}<ref id="{material}"/></shape>'


def sphere(center: Colour, radius: float, material: str, radiance: Colour | None = None) -> str:
    """A sphere, a light if it has a radiance."""
    place = f'<point name="center" value="{numbers(*center)}"/>{number("radius", radius)}'
    return f'<shape type="sphere">{place}<ref id="{material}"/>{_emitter(radiance)}</shape>'


def cylinder(p0: Colour, p1: Colour, radius: float, material: str) -> str:
    place = f'<point name="p0" value="{numbers(*p0)}"/><point name="p1" value="{numbers(*p1)}"/>'
    return f'<shape type="cylinder">{place}{number("radius", radius)}<ref id="{material}"/></shape>'


def disk(center: Colour, radius: float, material: str, radiance: Colour | None = None) -> str:
    """A horizontal disk that faces up."""
    matrix = numbers(radius, 0, 0, center[0], 0, 0, radius, center[1], 0, -radius, 0, center[2], 0, 0, 0, 1)
    transform = f'<transform name="to_world"><matrix value="{matrix}"/></transform>'
    return f'<shape type="disk">{transform}<ref id="{material}"/>{_emitter(radiance)}</shape>'


def panel(center: Colour, u: Colour, v: Colour, material: str, radiance: Colour | None = None) -> str:
    """A rectangle center ± u ± v that faces u × v."""
    n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
    length = sum(c * c for c in n) ** 0.5
    rows = [numbers(u[i], v[i], n[i] / length, center[i]) for i in range(3)]
    transform = f'<transform name="to_world"><matrix value="{" ".join(rows)} 0 0 0 1"/></transform>'
    return f'<shape type="rectangle">{transform}<ref id="{material}"/>{_emitter(radiance)}</shape>'


def lamp(center: Colour, target: Colour, half: tuple[float, float], radiance: Colour) -> str:
    """A black rectangle of these half sizes that shines towards a point; its first side is horizontal."""
    forward = np.subtract(target, center)
    u = np.cross(forward, (0.0, 1.0, 0.0)) if forward[0] or forward[2] else np.array([1.0, 0.0, 0.0])
    u *= half[0] / np.linalg.norm(u)
    v = np.cross(forward, u)
    v *= half[1] / np.linalg.norm(v)
    return panel(center, tuple(u.tolist()), tuple(v.tolist()), "black", radiance)


def write_vol(path: Path, values: NDArray[np.float32]) -> None:
    """Mitsuba's volume file, version 3; the values (nz, ny, nx) or (nz, ny, nx, 3) fill the unit cube."""
    values = values[..., None] if values.ndim == 3 else values
    nz, ny, nx, channels = values.shape
    path.parent.mkdir(exist_ok=True)
    head = struct.pack("<3sB5i6f", b"VOL", 3, 1, nx, ny, nz, channels, 0, 0, 0, 1, 1, 1)
    path.write_bytes(head + values.astype("<f4").tobytes())


def _emitter(radiance: Colour | None) -> str:
    return "" if radiance is None else f'<emitter type="area">{rgb("radiance", *radiance)}</emitter>'


def _xml(scene: MadeScene) -> str:
    width, height = scene.aspect
    defaults = {
        "spp": "64",
        "integrator": "volpath" if scene.media else "path",
        "max_depth": str(scene.max_depth),
        "rr_depth": "8",
    }
    if width == height:
        defaults["res"] = str(width)
        size = ("$res", "$res")
    else:
        defaults |= {"width": str(width), "height": str(height)}
        size = ("$width", "$height")
    defaults |= scene.defaults
    origin, target = (", ".join(numbers(c) for c in p) for p in (scene.origin, scene.target))
    lines = [
        '<scene version="3.0.0">',
        *(f'  <default name="{name}" value="{value}"/>' for name, value in defaults.items()),
        '  <integrator type="$integrator"><integer name="max_depth" value="$max_depth"/>'
        '<integer name="rr_depth" value="$rr_depth"/></integrator>',
        *(f"  {element}" for element in scene.media),
        '  <sensor type="perspective">',
        f'    {number("fov", scene.fov)}<string name="fov_axis" value="x"/>'
        '<float name="near_clip" value="0.001"/><float name="far_clip" value="1000"/>',
        f'    <transform name="to_world"><lookat origin="{origin}" target="{target}" up="0, 1, 0"/></transform>',
        '    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>',
        f'    <film type="hdrfilm"><integer name="width" value="{size[0]}"/><integer name="height" value="{size[1]}"/>'
        '<string name="pixel_format" value="rgb"/><string name="component_format" value="float32"/>'
        '<rfilter type="box"/></film>',
        *([f'    <ref id="{scene.around}"/>'] if scene.around else []),
        "  </sensor>",
        *(f"  {element}" for element in (*scene.bsdfs, *scene.shapes)),
        "</scene>",
    ]
    return "\n".join(lines) + "\n"


def write_scene(folder: Path, scene: MadeScene) -> Path:
    """Write scene.xml, scene.toml and the meshes into the folder; what else lies there stays, but old meshes go."""
    meshes = folder / "meshes"
    shutil.rmtree(meshes, ignore_errors=True)
    folder.mkdir(parents=True, exist_ok=True)
    if scene.meshes:
        meshes.mkdir()
    for stem, geometry in scene.meshes.items():
        write_ply(meshes / f"{stem}.ply", geometry)
    for stem, values in scene.grids.items():
        write_vol(folder / "grids" / f"{stem}.vol", values)
    (folder / "scene.xml").write_bytes(_xml(scene).encode("utf-8"))
    texts = {"title": scene.title, "description": scene.description, "shows": scene.shows}
    lines = [f"{key} = {json.dumps(text, ensure_ascii=False)}\n" for key, text in texts.items()]
    (folder / "scene.toml").write_bytes("".join(lines).encode("utf-8"))
    return folder
