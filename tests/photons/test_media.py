"""Photons in media: which are stored, and where their energy goes."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.maps.record import unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.roulette import RULES
from pmviewer.scene.arrays.flatten import flatten
from pmviewer.scene.description import Medium
from pmviewer.settings.access import Photons
from tests.render.test_media import SKY, cube_of, mixed_scene

pytestmark = pytest.mark.usefixtures("any_light_in_media")


def serially(tasks):
    return [task() for task in tasks]


def traced(scene, N=20_000, **settings):
    flat = flatten(scene)
    return flat, trace_pass(flat, Photons(sequence="independent", **settings), 3, 0, N, True, serially)


def test_the_volume_map_holds_photons_that_were_scattered_before():
    """In the medium, with a path class that says by what; light straight from the lights is not among them."""
    _, maps = traced(mixed_scene())
    photons = unpack(maps.volume, maps.volume_unit)
    assert len(maps.volume) > 1000
    assert photons["bounces"].min() >= 1
    inside = np.abs(photons["position"]).max(axis=1) <= 1.0001
    assert inside.all()
    assert set(photons["path_class"]) == {1, 2, 3}  # after scattering, over glass alone, and both


@pytest.mark.parametrize("roulette", RULES)
def test_the_ledger_balances_in_media(roulette):
    _flat, maps = traced(mixed_scene(), roulette=roulette)
    assert maps.energy[1:].sum() == pytest.approx(maps.energy[0], rel=1e-5)
    assert maps.dropped == 0


def test_absorption_in_a_medium_is_what_the_walk_of_photons_says():
    """Of a black medium under a white sky: a ray through the cube is absorbed by 1 − exp(−σ s), so that what escapes
    is the mean of exp(−σ s) over photons; here against numpy's own rays."""
    sigma = 0.7
    flat, maps = traced(cube_of(Medium("ink", (sigma,) * 3, (0, 0, 0)), SKY), 100_000)
    rng = np.random.default_rng(5)
    d = rng.normal(size=(400_000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    a = np.cross(d, rng.normal(size=d.shape))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    r, phi = flat.radius * np.sqrt(rng.random(len(d))), 2 * np.pi * rng.random(len(d))
    p = (r * np.cos(phi))[:, None] * a + (r * np.sin(phi))[:, None] * np.cross(d, a)
    low, high = (-1 - p) / d, (1 - p) / d
    way = np.maximum(np.maximum(low, high).min(axis=1) - np.minimum(low, high).max(axis=1), 0)
    assert maps.energy[2] / maps.energy[0] == pytest.approx(np.exp(-sigma * way).mean(), rel=5e-3)
    assert len(maps.volume) == 0
