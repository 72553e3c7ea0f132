"""A room that two projectors light: all methods show the same, by light samples and by photons."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.photons.projection.projection import projection_of
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import ProjectorLight, Scene
from tests.support.scenes import box_camera, box_walls, diffuse, rendered, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

DOWN = np.array([[-1.0, 0, 0], [0, 0, -1], [0, -1, 0]])
"""Looks down, its top towards −z."""
METHODS = {"path": {}, "progressive": {"estimate": {"radius": 0.01}}, "gather": {"estimate": {"radius": 0.02}}}
PASSES = {"path": 72, "progressive": 12, "gather": 12}
"""So many that a run knows the mean to half a percent; radii are small, since they darken corners."""


def room(size: int = 48) -> Scene:
    """The walls are alike; one projector lights the floor in colour, the other one the wall behind."""
    rng = np.random.default_rng(5)
    lines = np.linspace(0, 1, 5)
    lights = (
        ProjectorLight("down", (0.1, 0.8, 0.0), DOWN, (0.4, 0.3), pixels(rng, (3.0, 1.0, 0.5)), lines, lines),
        ProjectorLight("back", (0, 0, 0.5), np.diag([1.0, 1, -1]), (0.3, 0.4), pixels(rng, (0.5, 1, 3)), lines, lines),
    )
    return Scene("room", None, box_walls(), (diffuse(albedo=(0.5,) * 3),), lights, box_camera(), size, size)


def pixels(rng: np.random.Generator, colour: tuple[float, float, float]) -> np.ndarray:
    return (rng.uniform(0, 2, (5, 5, 1)) ** 2 * np.array(colour)).astype(np.float32)


@pytest.mark.slow
def test_all_methods_show_the_same_room() -> None:
    means = {}
    for name, groups in METHODS.items():
        settings = settings_of(render={"method": name}, photons={"N": 16_000}, **groups)
        image = rendered(room(), settings, PASSES[name]).frame(1).image("beauty")
        means[name] = image.astype(np.float64).mean(axis=(0, 1))
        print(name, means[name])
    assert means["path"].min() > 0
    assert means["progressive"] == pytest.approx(means["path"], rel=0.015)
    assert means["gather"] == pytest.approx(means["path"], rel=0.015)


def test_projection_maps_let_all_of_its_photons_go() -> None:
    maps = projection_of(flatten(room()))
    assert [each.mode for each in maps.surfaces] == ["whole", "whole"]
    assert maps.surface_power == pytest.approx(flatten(room()).total_luminance)
