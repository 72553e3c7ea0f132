"""Far from what is small on a stage photons aim there again when a floor scatters them: all arrives as it should, on
better known terms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.maps.record import DIRECT, unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.light_pass.scatter import AIMED
from pmviewer.photons.projection.projection import MOST_FACTOR, projection_of
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.scene.description import Material, Mesh, Sphere
from pmviewer.settings.access import Photons
from tests.photons.test_cones import FLOOR, stage
from tests.support.denser import at_once
from tests.support.scenes import diffuse

pytestmark = pytest.mark.usefixtures("every_surface")

BALL = Sphere((2.0, 3.0, 1.0), 3.0)
FLOORS = {
    "diffuse": diffuse(),
    "rough plastic": Material("coat", "rough plastic", (0.5, 0.4, 0.3), alpha=(0.3, 0.3)),
}


def hilly():
    """A floor of two triangles, whose normals say that it is a hill."""
    corners = np.array([(-40.0, 0, -40), (-40, 0, 40), (40, 0, 40), (40, 0, -40)])
    normals = corners + (0.0, 60.0, 0.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(corners, np.array([(0, 1, 2), (0, 2, 3)]), normals=normals)


def large(*lamps, floor=FLOOR, material=None):
    """The stage with a ball that half a hundred photons of a million find by chance."""
    scene = stage(*lamps, floor=floor)
    shapes = tuple(replace(s, geometry=BALL) if s.name == "ship" else s for s in scene.shapes)
    return replace(scene, shapes=shapes, materials=(material or scene.materials[0], *scene.materials[1:]))


def arrived(flat, projection, seed, N=1_000_000, **settings):
    """Luminance (n,) of photons that arrive at the ball over other surfaces, and the pass."""
    given = Photons(q=1.0, sequence="independent", glossy=0.1, **settings)
    maps = trace_pass(flat, given, seed, 0, N, False, at_once, projection=projection)
    stored = unpack(maps.global_, maps.global_unit)
    away = np.linalg.norm(stored["position"] - BALL.center, axis=1)
    near = (away < BALL.radius + 0.01) & (stored["path_class"] != DIRECT)
    return stored["Phi"][near].astype(float) @ LUMINANCE, maps


def compared(scene, times, **settings):
    """z-test of what arrives with and without; how much less it varies than from photons that aim at the start alone;
    the energy balances."""
    flat = flatten(scene)
    usual, _ = arrived(flat, None, 1, 4_000_000, **settings)
    once = projection_of(flat)
    once.records["most_factor"] = 0.0
    started, _ = arrived(flat, once, 2, **settings)
    aimed, maps = arrived(flat, projection_of(flat), 3, **settings)
    z = (aimed.sum() - usual.sum()) / math.sqrt(2 * ((usual**2).sum() + (aimed**2).sum()))
    saved = (started**2).sum() / (aimed**2).sum()
    powers = f"{usual.sum():.4f}, {started.sum():.4f} and {aimed.sum():.4f} W"
    print(
        f"{powers} of {len(usual)}, {len(started)}, {len(aimed)} photons, z {z:+.2f}, {saved:.1f} times less variance"
    )
    assert len(usual) > 100
    assert abs(z) < 4
    assert saved > times
    assert maps.energy[0] == pytest.approx(flat.total_luminance, rel=1e-6)
    assert maps.energy[1:].sum() == pytest.approx(maps.energy[0], rel=1e-5)
    assert maps.dropped == 0
    return flat, maps


@pytest.mark.slow
@pytest.mark.parametrize("name", FLOORS)
def test_light_over_the_floor_arrives_as_it_should(name):
    compared(large("dome", material=FLOORS[name]), 4.0)


@pytest.mark.slow
def test_light_over_a_floor_with_smooth_normals():
    compared(large("dome", floor=hilly()), 4.0)


@pytest.mark.slow
def test_light_arrives_so_by_copies_of_photons():
    """By the roulette that stores photons of equal power as so many."""
    compared(large("dome", "panel"), 4.0, roulette="equal")


def test_power_never_grows_beyond_what_photons_can_store():
    """Of white floors that face a lamp hardly a photon is absorbed, and each bounce may add a third."""
    white = diffuse("white", (0.98,) * 3)
    flat = flatten(large("dome", material=white))
    made = projection_of(flat)
    _, maps = arrived(flat, made, 4, max_bounces=64)
    power = unpack(maps.global_, maps.global_unit)["Phi"].astype(float) @ LUMINANCE
    most = power.max() / (made.surface_power / 1_000_000)
    print(f"{most:.0f} times the power of photons that aim, gain {made.gain:.0f}")
    assert most <= MOST_FACTOR / (1 - AIMED) * made.gain * 1.02
