"""Light from outside, on a wide floor with something small on it: photons start more densely for that, and nothing is
biased."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.stages.projection import projection_for
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.record import unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.projection.projection import projection_of
from pmviewer.photons.projection.scales import gain, scales, start_at_scales
from pmviewer.photons.projection.small import small_of
from pmviewer.scene.arrays.flatten import LUMINANCE, bounding_sphere, flatten
from pmviewer.scene.description import (
    Camera,
    ConstantEnvironment,
    DirectionalLight,
    Disk,
    Geometry,
    Group,
    Instance,
    Mesh,
    Parallelogram,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.settings.access import Photons
from tests.support.scenes import ball_mesh, box_walls, cube_mesh, diffuse, means_by_method, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

WIDE = 40.0
SKY, SUN = ConstantEnvironment("sky", (1.0, 1.0, 1.0)), DirectionalLight("sun", (0.6, -0.8, 0.0), (2.0, 2.0, 2.0))
FLOORS: dict[str, Geometry] = {
    "sheet": Parallelogram((-WIDE, 0.0, -WIDE), (0.0, 0.0, 2 * WIDE), (2 * WIDE, 0.0, 0.0)),
    "disk": Disk((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), WIDE),
    "mesh": Mesh(
        np.array([[-WIDE, 0, -WIDE], [WIDE, 0, -WIDE], [WIDE, 0, WIDE], [-WIDE, 0, WIDE]]),
        np.array([[0, 2, 1], [0, 3, 2]]),
    ),
    "planet": Sphere((0.0, -1000.0, 0.0), 1000.0),
}


def yard(floor="sheet", lights=(SKY,), size=24) -> Scene:
    """A floor, and on it two walls and a roof of half a metre to a metre, which the camera looks under."""
    walls = [
        Parallelogram((2.5, 0.0, 3.0), (1.0, 0.0, 0.0), (0.0, 0.6, 0.0)),
        Parallelogram((2.5, 0.0, 3.0), (0.0, 0.0, 1.0), (0.0, 0.6, 0.0)),
        Parallelogram((2.5, 0.6, 3.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    ]
    shapes = (Shape("floor", FLOORS[floor], 0), *(Shape(f"wall {i}", wall, 0) for i, wall in enumerate(walls)))
    camera = Camera((4.5, 0.4, 4.8), (2.8, 0.25, 3.3), (0, 1, 0), 30.0, near=0.0, far=np.inf)
    return Scene("yard", None, shapes, (diffuse(),), tuple(lights), camera, size, size)


@pytest.mark.parametrize("floor", list(FLOORS))
def test_what_stands_on_a_floor_is_found(floor):
    scene = yard(floor)
    found = small_of(scene, bounding_sphere(scene)[1])
    assert found is not None
    np.testing.assert_allclose(found.center, (3.0, 0.3, 3.5), atol=1e-9)
    assert found.radius == pytest.approx(math.sqrt(1 + 1 + 0.36) / 2)


def small(scene):
    return small_of(scene, bounding_sphere(scene)[1])


def test_rooms_and_landscapes_hold_nothing_small():
    """A lamp in a room is not all there is to see; of a landscape no part is; and without a floor there is none."""
    lamp = Shape("lamp", Sphere((0.0, 0.5, 0.0), 0.05), 0)
    assert small(replace(yard(), shapes=(*box_walls(), lamp))) is None
    n = 30
    x, z = np.meshgrid(np.linspace(-WIDE, WIDE, n), np.linspace(-WIDE, WIDE, n))
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + n], 1), np.stack([corner + 1, corner + n + 1, corner + n], 1)]
    )
    hills = Mesh(np.stack([x.ravel(), np.sin(x.ravel()), z.ravel()], 1), faces)
    assert small(replace(yard(), shapes=(Shape("hills", hills, 0), lamp))) is None
    assert small(replace(yard(), shapes=(lamp,))) is None
    assert small(replace(yard(), shapes=(Shape("floor", FLOORS["sheet"], 0),))) is None
    pieces = [Parallelogram((0.0, 4.0 * y, 0.0), (0.1, 0.0, 0.0), (0.0, 4.0, 0.0)) for y in range(25)]
    mast = [Shape(f"mast {i}", piece, 0) for i, piece in enumerate(pieces)]
    assert small(replace(yard(), shapes=(*yard().shapes, *mast))) is None


def test_instances_are_part_of_what_stands_there():
    group = Group("cube", (Shape("cube", cube_mesh(half=0.5), 0),))
    places = [np.array([[1.0, 0, 0, x], [0, 1, 0, 0.5], [0, 0, 1, 0], [0, 0, 0, 1]]) for x in (-2.0, 2.0)]
    scene = replace(
        yard(), shapes=yard().shapes[:1], instances=tuple(Instance(f"{i}", group, m) for i, m in enumerate(places))
    )
    found = small(scene)
    assert found is not None
    np.testing.assert_allclose(found.center, (0.0, 0.5, 0.0), atol=1e-6)
    assert found.radius == pytest.approx(math.sqrt(5**2 + 1 + 1) / 2, rel=1e-5)


@kernel
def _starts(scenes, projections, direction, numbers, places, factors):
    scene, projection = scenes[0], projections[0]
    d = (direction[0], direction[1], direction[2])
    for i in range(len(numbers)):
        p, factors[i] = start_at_scales(scene, projection, d, (numbers[i, 0], numbers[i, 1]))
        places[i, 0], places[i, 1], places[i, 2] = p


@pytest.mark.parametrize("direction", [(0.0, -1.0, 0.0), (0.6, -0.64, 0.48)])
def test_power_arrives_evenly_and_photons_densely(direction):
    """Of rings around what is small, each gets the share of the power that it has of the disc's area; and those within
    the smallest disc are the share of the photons that `gain` says, at least."""
    flat = flatten(yard())
    found, projection = small(yard()), projection_of(flat)
    assert [m.mode for m in projection.surfaces] == ["scales"]
    rng = np.random.default_rng(3)
    n = 400_000
    numbers, places, factors = rng.random((n, 2), np.float32), np.empty((n, 3)), np.empty(n)
    _starts(flat.record, projection.records, np.array(direction, np.float32), numbers, places, factors)
    R, d = flat.radius, np.array(direction)
    across = places - flat.center
    np.testing.assert_allclose(across @ d, -R, rtol=1e-4)
    across -= (across @ d)[:, None] * d
    away = found.center - flat.center
    away -= (away @ d) * d
    assert np.all(np.linalg.norm(across[factors > 0], axis=1) <= R * 1.0001)
    off = np.linalg.norm(across - away, axis=1)
    edges = [0.0, found.radius, 2.5 * found.radius, 10 * found.radius, 0.9 * (R - np.linalg.norm(away))]
    for low, high in pairwise(edges):
        inside = (off >= low) & (off < high)
        share = (high**2 - low**2) / R**2
        error = math.sqrt((factors[inside] ** 2).sum()) / n
        print(f"ring {low:.2f} … {high:.2f}: {factors[inside].sum() / n:.6f} of the power, {share:.6f} of the area")
        assert factors[inside].sum() / n == pytest.approx(share, abs=4 * error)
    assert factors.sum() / n == pytest.approx(1.0, abs=4 * factors.std() / math.sqrt(n))
    assert factors.max() <= 4.0001
    within = (off < found.radius).mean()
    assert within >= 0.97 * gain(found.radius, R) * (found.radius / R) ** 2
    assert scales(found.radius, R) == math.ceil(math.log2(R / found.radius))


@pytest.mark.parametrize("light", [SKY, SUN], ids=["sky", "sun"])
def test_power_of_the_maps_is_the_same_and_better_known(light):
    """z-test of the power that photons leave on what is small, and how much less it varies."""
    flat = flatten(yard(lights=(light,)))
    sums, squares, counts = [], [], []
    for projection, seed in ((None, 1), (projection_of(flat), 2)):
        maps = trace_pass(
            flat,
            Photons(q=1.0, sequence="independent"),
            seed,
            0,
            400_000,
            False,
            lambda t: [f() for f in t],
            projection=projection,
        )
        stored = unpack(maps.global_, maps.global_unit)
        near = (np.abs(stored["position"] - (3.0, 0.3, 3.5)) < (0.51, 0.31, 0.51)).all(axis=1)
        power = stored["Phi"][near].astype(float) @ LUMINANCE
        sums.append(power.sum())
        squares.append((power**2).sum())
        counts.append(near.sum())
    z = (sums[0] - sums[1]) / math.sqrt(3 * sum(squares))
    saved = squares[0] / squares[1]
    print(f"{sums[0]:.4f} and {sums[1]:.4f} W of {counts} photons, z {z:+.2f}, {saved:.0f} times less variance")
    assert abs(z) < 4
    assert saved > 20


@pytest.mark.slow
@pytest.mark.parametrize("lights", [(SKY,), (SUN, SKY)], ids=["sky", "sun and sky"])
def test_all_methods_show_the_same_yard(lights):
    """Photons being few, their noise is a percent or two; without scales it is ten."""
    means = means_by_method(yard(lights=lights), 512)
    assert means["progressive"] == pytest.approx(means["path"], rel=0.04)
    assert means["gather"] == pytest.approx(means["path"], rel=0.04)


def test_it_is_automatic():
    """By default, and where asked for; not where nothing stands on a floor."""
    scene = open_scene(yard())
    for asked in ("auto", "on"):
        maps = projection_for(scene, settings_of(photons={"projection": asked}))
        assert maps is not None
        assert maps.surfaces[0].mode == "scales"
    assert projection_for(scene, settings_of(photons={"projection": "off"})) is None
    ball = replace(yard(), shapes=(Shape("ball", ball_mesh(1.0, 2), 0),))
    maps = projection_for(open_scene(ball), settings_of())
    assert maps is None or maps.surfaces[0].mode != "scales"
