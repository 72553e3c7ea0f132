"""One small scene per material, texture and light, as Mitsuba 3 files: both programs render the same file.

Each material is on a sphere, on a turned block and on the rear wall of an open corner, so that it is met from all
directions, directly and by light that came from a diffuse surface. The lights stand over the same corner with diffuse
surfaces. All is large and softly lit: what is compared are formulas, not how well caustics are found.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pmviewer.output.exr import write_exr
from pmviewer.output.png import write_png

GREY = '<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.6 0.5 0.4"/></bsdf></bsdf>'
SOFT = """
  <shape type="rectangle">
    <transform name="to_world">
      <scale x="0.7" y="0.7"/><rotate x="1" angle="90"/><translate y="2.6" z="0.6"/>
    </transform>
    <emitter type="area"><rgb name="radiance" value="5 4 3"/></emitter>
  </shape>
  <emitter type="constant"><rgb name="radiance" value="0.2 0.25 0.3"/></emitter>"""


def _twosided(bsdf: str) -> str:
    return f'<bsdf type="twosided">{bsdf}</bsdf>'


def _rough(kind: str, distribution: str, more: str = '<float name="alpha" value="0.3"/>') -> str:
    return f'<bsdf type="{kind}"><string name="distribution" value="{distribution}"/>{more}</bsdf>'


def _picture(name: str, raw: bool = False, scale: float = 2.0, slot: str = "") -> str:
    return (
        (
            f'<texture {slot} type="bitmap"><string name="filename" value="{name}"/><boolean name="raw" value="{raw}"/>'
            f'<transform name="to_uv"><scale x="{scale}" y="{scale}"/></transform></texture>'
        )
        .replace("True", "true")
        .replace("False", "false")
    )


NO_SHADOWING = '<boolean name="use_shadowing_function" value="false"/>'
"""Mitsuba darkens mapped normals by a shadowing function of its own unless it is told not to; pmviewer has none."""
ANISOTROPIC = '<float name="alpha_u" value="0.15"/><float name="alpha_v" value="0.5"/>'
GOLD = '<string name="material" value="Au"/><float name="alpha" value="0.2"/>'
BASE = '<rgb name="diffuse_reflectance" value="0.2 0.4 0.7"/>'
DIFFUSE = '<bsdf type="diffuse"><rgb name="reflectance" value="0.7 0.6 0.5"/></bsdf>'


def _mapped(kind: str, picture: str, slot: str, inside: str) -> str:
    return _twosided(f'<bsdf type="{kind}">{_picture(picture, raw=True, slot=slot)}{NO_SHADOWING}{inside}</bsdf>')


MATERIALS: Mapping[str, str] = {
    "diffuse": _twosided(DIFFUSE),
    "conductor, gold": _twosided('<bsdf type="conductor"><string name="material" value="Au"/></bsdf>'),
    "roughconductor, GGX": _twosided(_rough("roughconductor", "ggx")),
    "roughconductor, GGX, gold": _twosided(_rough("roughconductor", "ggx", GOLD)),
    "roughconductor, Beckmann": _twosided(_rough("roughconductor", "beckmann")),
    "roughconductor, anisotropic": _twosided(_rough("roughconductor", "ggx", ANISOTROPIC)),
    "dielectric": '<bsdf type="dielectric"><float name="int_ior" value="1.5"/></bsdf>',
    "roughdielectric, GGX": _rough("roughdielectric", "ggx"),
    "roughdielectric, Beckmann": _rough("roughdielectric", "beckmann"),
    "thindielectric": '<bsdf type="thindielectric"><float name="int_ior" value="1.5"/></bsdf>',
    "principledthin, diffuse light through": '<bsdf type="principledthin"><rgb name="base_color" value="0.7 0.8 0.5"/>'
    '<float name="roughness" value="0.6"/><float name="diff_trans" value="1.2"/></bsdf>',
    "plastic": _twosided(f'<bsdf type="plastic">{BASE}</bsdf>'),
    "plastic, nonlinear": _twosided(f'<bsdf type="plastic">{BASE}<boolean name="nonlinear" value="true"/></bsdf>'),
    "roughplastic, GGX": _twosided(_rough("roughplastic", "ggx", BASE + '<float name="alpha" value="0.2"/>')),
    "roughplastic, Beckmann": _twosided(_rough("roughplastic", "beckmann", BASE)),
    "bumpmap": _mapped("bumpmap", "waves.png", "", f'<float name="scale" value="0.015"/>{DIFFUSE}'),
    "normalmap": _mapped("normalmap", "normals.png", 'name="normalmap"', DIFFUSE),
    "normalmap, rough metal": _mapped("normalmap", "normals.png", 'name="normalmap"', _rough("roughconductor", "ggx")),
    "bitmap": _twosided('<bsdf type="diffuse">' + _picture("colours.png", slot='name="reflectance"') + "</bsdf>"),
    "checkerboard": _twosided(
        '<bsdf type="diffuse"><texture name="reflectance" type="checkerboard"><rgb name="color0" value="0.8 0.2 0.1"/>'
        '<rgb name="color1" value="0.1 0.3 0.8"/><transform name="to_uv"><scale x="4" y="3"/></transform></texture>'
        "</bsdf>"
    ),
    "roughness texture": _twosided(
        '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
        + _picture("roughness.png", raw=True, slot='name="alpha"')
        + "</bsdf>"
    ),
    "roughness texture, along alone": _twosided(
        '<bsdf type="roughconductor"><string name="distribution" value="ggx"/>'
        + _picture("roughness.png", raw=True, slot='name="alpha_u"')
        + '<float name="alpha_v" value="0.05"/></bsdf>'
    ),
}
"""Material by the row's name."""

_LOOK = '<transform name="to_world"><lookat origin="0.5, 2.4, 0.8" target="0, 0.2, 0" up="0, 0, 1"/></transform>'
LIGHTS: Mapping[str, str] = {
    "point": '<emitter type="point"><point name="position" x="0.6" y="1.9" z="0.9"/>'
    '<rgb name="intensity" value="6 5 4"/></emitter>',
    "spot": f'<emitter type="spot">{_LOOK}<rgb name="intensity" value="12 9 6"/>'
    '<float name="cutoff_angle" value="30"/><float name="beam_width" value="18"/></emitter>',
    "directional": '<emitter type="directional"><vector name="direction" x="-0.3" y="-1" z="-0.5"/>'
    '<rgb name="irradiance" value="3 2.5 2"/></emitter>',
    "constant": '<emitter type="constant"><rgb name="radiance" value="0.6 0.7 0.9"/></emitter>',
    "envmap": '<emitter type="envmap"><string name="filename" value="sky.exr"/><float name="scale" value="0.5"/>'
    '<transform name="to_world"><rotate x="1" angle="20"/><rotate y="1" angle="70"/></transform></emitter>',
    "area, rectangle": SOFT.split('<emitter type="constant"')[0],
    "area, sphere": '<shape type="sphere"><point name="center" x="0.3" y="2.2" z="0.7"/>'
    '<float name="radius" value="0.3"/><emitter type="area"><rgb name="radiance" value="6 5 4"/></emitter></shape>',
    "area, disk": '<shape type="disk"><transform name="to_world"><scale value="0.5"/><rotate x="1" angle="100"/>'
    '<translate y="2.4" z="0.8"/></transform>'
    '<emitter type="area"><rgb name="radiance" value="6 5 4"/></emitter></shape>',
    "area, textured": '<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/>'
    '<translate y="2.4" z="0.5"/></transform><emitter type="area">'
    + _picture("glow.exr", raw=True, scale=1.0, slot='name="radiance"')
    + "</emitter></shape>",
    "two lights": '<emitter type="point"><point name="position" x="0.6" y="1.9" z="0.9"/>'
    '<rgb name="intensity" value="1 2 4"/></emitter>' + SOFT,
}
"""Emitters by the row's name."""


def scene_file(bsdf: str, lights: str) -> str:
    """The corner with three objects of `bsdf` under `lights`."""
    return f"""<scene version="3.0.0">
  <default name="res" value="64"/>
  <integrator type="path"><integer name="max_depth" value="-1"/><integer name="rr_depth" value="8"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="42"/>
    <transform name="to_world"><lookat origin="0.6, 1.6, 4.2" target="0, 0.75, 0" up="0, 1, 0"/></transform>
    <sampler type="independent"/>
    <film type="hdrfilm"><integer name="width" value="$res"/><integer name="height" value="$res"/>
      <rfilter type="box"/></film>
  </sensor>
  <shape type="rectangle">
    <transform name="to_world"><scale x="1.5" y="1.5"/><rotate x="1" angle="-90"/></transform>{GREY}
  </shape>
  <shape type="rectangle">
    <transform name="to_world">
      <scale x="1.5" y="1.5"/><rotate y="1" angle="90"/><translate x="-1.5" y="1.5"/>
    </transform>{GREY}
  </shape>
  <shape type="rectangle">
    <transform name="to_world"><scale x="1.5" y="0.8"/><translate y="0.8" z="-1.5"/></transform>{bsdf}
  </shape>
  <shape type="sphere"><point name="center" x="-0.5" y="0.65" z="-0.2"/><float name="radius" value="0.6"/>{bsdf}</shape>
  <shape type="cube">
    <transform name="to_world">
      <scale value="0.35"/><rotate x="1" angle="20"/><rotate y="1" angle="30"/><translate x="0.75" y="0.55" z="0.3"/>
    </transform>{bsdf}
  </shape>{lights}
</scene>
"""


def write_pictures(folder: Path) -> None:
    """The textures that the scenes name."""
    v, u = np.mgrid[0:32, 0:64].astype(np.float64) + 0.5
    x, y = 2 * np.pi * u / 64, 2 * np.pi * v / 32
    write_png(folder / "colours.png", _bytes(np.sin(x), np.cos(y), np.sin(x + y)))
    write_png(folder / "waves.png", _bytes(*3 * (np.sin(2 * x) * np.cos(y),)))
    write_png(folder / "roughness.png", _bytes(*3 * (0.3 * np.sin(x) - 0.4,)))
    write_png(folder / "normals.png", _bytes(0.3 * np.sin(x), 0.25 * np.cos(y), np.sqrt(1 - 0.3**2 - 0.25**2) + 0 * x))
    sky = 0.3 + 0.2 * np.cos(y / 2)[..., None] * np.array([0.6, 0.8, 1.0])
    sun = np.exp(-((u - 20) ** 2 + (v - 9) ** 2) / 6)
    write_exr(folder / "sky.exr", {"": (sky + sun[..., None] * np.array([20, 17, 12])).astype(np.float32)}, {})
    glow = np.stack([1 + np.sin(x), 1.5 + np.cos(y), 1 + np.cos(x + y)], axis=-1)
    write_exr(folder / "glow.exr", {"": (2 * glow).astype(np.float32)}, {})


def _bytes(*channels: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Channels from −1 to 1 as (h, w, 3) bytes."""
    image: NDArray[np.uint8] = np.round(127.5 * (1 + np.stack(channels, axis=-1))).clip(0, 255).astype(np.uint8)
    return image


def write_scenes(folder: Path) -> dict[str, Path]:
    """Write all of them and their textures into `folder`: file by name, materials first."""
    write_pictures(folder)
    files = {}
    texts = {f"material: {name}": scene_file(bsdf, SOFT) for name, bsdf in MATERIALS.items()}
    texts |= {f"light: {name}": scene_file(_twosided(DIFFUSE), light) for name, light in LIGHTS.items()}
    for i, (name, text) in enumerate(texts.items()):
        files[name] = folder / f"feature{i:02d}.xml"
        files[name].write_text(text, encoding="utf-8")
    return files
