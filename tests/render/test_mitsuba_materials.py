"""Principled materials and blends against Mitsuba's pictures: a ball on a square under different lights.

The expectation was rendered by Mitsuba 3 (tests/render/mitsuba_materials/record.py): the mean of each channel, with its
standard error.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    Material,
    Parallelogram,
    PointLight,
    Principled,
    Scene,
    Shape,
    Sphere,
)
from tests.support.scenes import settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

FILE = Path(__file__).with_name("mitsuba_materials") / "expected.json"
SCENES = {row["name"]: row for row in json.loads(FILE.read_text("utf-8"))["scenes"]}
SIZE = 48
LAMP = Parallelogram((-3.0, 3.0, -3.0), (6.0, 0.0, 0.0), (0.0, 0.0, 6.0))
OF_PRINCIPLED = ("metallic", "spec_trans", "spec_tint", "sheen", "sheen_tint", "flatness", "clearcoat")


def material_of(values, name="m"):
    """A material by Mitsuba's plugin and its parameters."""
    kind = values["type"]
    if kind == "blendbsdf":
        parts = (material_of(values["first"], "first"), material_of(values["second"], "second"))
        return Material(name, "blend", parts=parts, weight=values["weight"])
    if kind == "dielectric":
        return Material(name, "dielectric", (1.0,) * 3, (1.0,) * 3, eta=values["int_ior"])
    if kind == "diffuse":
        return Material(name, "diffuse", tuple(values["reflectance"]["value"]))
    if kind != "principled":
        smooth = {"conductor": "conductor", "roughconductor": "rough conductor"}[kind]
        return Material(
            name, smooth, tuple(values["specular_reflectance"]["value"]), alpha=(values.get("alpha", 0.1),) * 2
        )
    aspect = np.sqrt(1 - 0.9 * values["anisotropic"])
    alpha = values["roughness"] ** 2
    eta = 2 / (1 - np.sqrt(0.08 * values["specular"])) - 1
    numbers = {key: values[key] for key in (*OF_PRINCIPLED, "clearcoat_gloss") if key in values}
    colour, pair = tuple(values["base_color"]["value"]), (float(alpha / aspect), float(alpha * aspect))
    return Material(name, "principled", colour, eta=float(eta), alpha=pair, principled=Principled(**numbers))


def scene_of(row):
    black = Material("black", "diffuse", (0.0,) * 3)
    # Texture coordinates as of Mitsuba's rectangle: u along x, which anisotropy follows.
    square = Parallelogram((-3.0, 0.0, 3.0), (6.0, 0.0, 0.0), (0.0, 0.0, -6.0))
    shapes = [Shape("ball", Sphere((0.0, 1.0, 0.0), 1.0), 0), Shape("square", square, 0)]
    lights = {
        "constant": ConstantEnvironment("sky", (0.8, 0.9, 1.1)),
        "point": PointLight("point", (2.0, 3.0, 2.0), (30.0, 25.0, 20.0)),
    }
    if row["light"] == "area":
        shapes.append(Shape("lamp", LAMP, 1, (1.5, 1.25, 1.0)))
    camera = Camera((0.0, 1.5, 5.0), (0.0, 0.6, 0.0), (0.0, 1.0, 0.0), 40.0, near=1e-3)
    found = tuple(light for name, light in lights.items() if name == row["light"])
    return Scene("ball", None, tuple(shapes), (material_of(row["material"]), black), found, camera, SIZE, SIZE)


def channel_runs(row, method, passes):
    """(passes, 3) means of the picture's channels, pass by pass."""
    values = {"render": {"method": method, "max_depth": 32}, "photons": {"N": 16_000}, "estimate": {"radius": 0.01}}
    pool = WorkPool(2)
    renderer = Renderer(open_scene(scene_of(row)), settings_of(**values), pool, StageStore(0))
    totals = []
    for _ in range(passes):
        renderer.step()
        totals.append(renderer.film.sums[:, :15].reshape(-1, 5, 3).sum(1).mean(0))
    pool.close()
    assert sum(renderer.tally.dropped.values()) == 0
    return np.diff(np.array(totals), prepend=0, axis=0)


def check(name, method, passes):
    row = SCENES[name]
    ours = channel_runs(row, method, passes)
    mean, error = np.array(row["mean"]), np.hypot(ours.std(0) / np.sqrt(passes), row["error"])
    print(f"{name}, {method}: ratio {ours.mean(0) / mean}, noise {error / mean}")
    assert np.all(np.abs(ours.mean(0) - mean) < 0.01 * mean + 3 * error)
    assert np.all(error < 0.025 * mean)


@pytest.mark.parametrize("name", SCENES)
def test_path_tracer_shows_mitsubas_picture(name):
    check(name, "path", 32)


@pytest.mark.extensive
@pytest.mark.parametrize(
    ("name", "method"),
    [("principled 0, area", "progressive"), ("principled 1, constant", "gather"), ("principled 6, area", "progressive"),
     ("diffuse and glass, area", "progressive"), ("nested, area", "progressive")],
)  # fmt: skip
def test_photon_methods_show_it_too(name, method):
    check(name, method, 48)
