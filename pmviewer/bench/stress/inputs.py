"""Files that make no sense, or hardly any: each is answered with a sentence, and what is left of it is finite."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from pmviewer.bench.stress.lab import Case, Lab, Outcome
from pmviewer.errors import SceneError
from pmviewer.output.exr import write_exr
from pmviewer.scene.load import load_scene

SENSOR = (
    '<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">'
    '<lookat origin="0 0 4" target="0 0 0" up="0 1 0"/></transform></sensor>'
)
SKY = '<emitter type="constant"/>'
BALL = '<shape type="sphere"/>'


def _grey(more: str) -> str:
    return f'<shape type="sphere"><bsdf type="diffuse">{more}</bsdf></shape>'


def _bsdf(kind: str, more: str) -> str:
    return f'<shape type="sphere"><bsdf type="{kind}">{more}</bsdf></shape>'


_PICTURE = '<texture name="reflectance" type="bitmap"><string name="filename" value="picture.exr"/></texture>'
_RAW = '<texture name="normal" type="bitmap"><string name="filename" value="picture.exr"/></texture>'
_MESH = '<shape type="{kind}"><string name="filename" value="mesh.{kind}"/></shape>'

NONSENSE: dict[str, str] = {
    "no shapes": SENSOR + SKY,
    "no lights": SENSOR + BALL,
    "nothing at all": "",
    "a sensor alone": SENSOR,
    "light of no power": SENSOR + BALL + '<emitter type="point"><rgb name="intensity" value="0"/></emitter>',
    "negative light": SENSOR + BALL + '<emitter type="constant"><rgb name="radiance" value="-1"/></emitter>',
    "light NaN": SENSOR + BALL + '<emitter type="constant"><rgb name="radiance" value="nan"/></emitter>',
    "light infinite": SENSOR + BALL + '<emitter type="constant"><rgb name="radiance" value="inf"/></emitter>',
    "light 1e31": SENSOR + BALL + '<emitter type="constant"><rgb name="radiance" value="1e31"/></emitter>',
    "albedo 2": SENSOR + SKY + _grey('<rgb name="reflectance" value="2"/>'),
    "albedo -1": SENSOR + SKY + _grey('<rgb name="reflectance" value="-1"/>'),
    "ior 0": SENSOR + SKY + _bsdf("dielectric", '<float name="int_ior" value="0"/>'),
    "ior -1.5": SENSOR + SKY + _bsdf("dielectric", '<float name="int_ior" value="-1.5"/>'),
    "Abbe number 0": SENSOR + SKY + _bsdf("dielectric", '<float name="abbe" value="0"/>'),
    "Abbe number NaN": SENSOR + SKY + _bsdf("dielectric", '<float name="abbe" value="nan"/>'),
    "glass that nobody makes": SENSOR + SKY + _bsdf("dielectric", '<string name="glass" value="jelly"/>'),
    "Cauchy's B far below 0": SENSOR
    + SKY
    + _bsdf("dielectric", '<float name="cauchy_a" value="1.5"/><float name="cauchy_b" value="-0.2"/>'),
    "Sellmeier's poles in the visible": SENSOR
    + SKY
    + _bsdf("dielectric", '<string name="sellmeier_b" value="1 1"/><string name="sellmeier_c" value="0.2 0.3"/>'),
    "roughness -1": SENSOR + SKY + _bsdf("roughconductor", '<float name="alpha" value="-1"/>'),
    "roughness 1e9": SENSOR + SKY + _bsdf("roughconductor", '<float name="alpha" value="1e9"/>'),
    "ball of radius 0": SENSOR + SKY + '<shape type="sphere"><float name="radius" value="0"/></shape>',
    "scaled by 0": SENSOR
    + SKY
    + '<shape type="cube"><transform name="to_world"><scale value="0"/></transform></shape>',
    "scaled by 1e30": SENSOR
    + SKY
    + '<shape type="cube"><transform name="to_world"><scale value="1e30"/></transform></shape>',
    "texture with NaN, infinite and negative pixels": SENSOR + SKY + _grey(_PICTURE),
    "sky with NaN, infinite and negative pixels": SENSOR
    + BALL
    + '<emitter type="envmap"><string name="filename" value="picture.exr"/></emitter>',
    "light texture with NaN, infinite and negative pixels": SENSOR
    + BALL
    + '<shape type="rectangle"><emitter type="area">'
    + _PICTURE.replace("reflectance", "radiance")
    + "</emitter></shape>",
    "normal map with NaN, infinite and negative pixels": SENSOR
    + SKY
    + f'<shape type="sphere"><bsdf type="normalmap">{_RAW}<bsdf type="diffuse"/></bsdf></shape>',
    "obj without faces": SENSOR + SKY + _MESH.format(kind="obj"),
    "ply without faces": SENSOR + SKY + _MESH.format(kind="ply"),
    "empty group shown by an instance": SENSOR
    + SKY
    + '<shape type="shapegroup" id="g"/><shape type="instance"><ref id="g"/></shape>',
    "camera at its target": SENSOR.replace('target="0 0 0"', 'target="0 0 4"') + SKY + BALL,
    "camera NaN": SENSOR.replace('origin="0 0 4"', 'origin="0 nan 4"') + SKY + BALL,
    "fov 180": SENSOR.replace('value="40"', 'value="180"') + SKY + BALL,
    "picture of no pixels": SENSOR.replace(
        "</sensor>", '<film type="hdrfilm"><integer name="width" value="0"/></film></sensor>'
    )
    + SKY
    + BALL,
}
"""What is within `<scene>` by name."""

SENSE: dict[str, str] = {
    "no camera": SKY + BALL,
    "a ball in nothing but sky": SENSOR + SKY + BALL,
}
"""Unusual, but right without a word."""


def inputs() -> list[Case]:
    """Each file, read as a user's would be."""
    said = [Case("input", name, "", partial(_file, body=body), nonsense=True) for name, body in NONSENSE.items()]
    return said + [Case("input", name, "", partial(_file, body=body)) for name, body in SENSE.items()]


def _file(lab: Lab, body: str) -> Outcome:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "scene.xml").write_text(f'<scene version="3.0.0">{body}</scene>', "utf-8")
        (place / "mesh.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "utf-8")
        header = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
        (place / "mesh.ply").write_text(header + "element face 0\nproperty list uchar int vertex_indices\nend_header\n")
        if "picture.exr" in body:
            pixels = np.full((4, 8, 3), 0.5, np.float32)
            pixels[1, 2], pixels[2, 5], pixels[0, 0], pixels[3, 3] = np.nan, np.inf, -3.0, -np.inf
            write_exr(place / "picture.exr", {"": pixels})
        try:
            scene = load_scene(place / "scene.xml")
        except SceneError as error:  # without the name of a folder that is gone
            raise SceneError(error.what, "scene.xml", error.line, error.hint) from None
        return lab.measure(scene, None, seeds=2, photons__N=2000)
