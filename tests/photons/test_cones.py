"""A dome over a stage, a lamp high above it: photons aim more densely at what is small there, and nothing is biased."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.record import DIRECT, unpack
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.projection.cones import start_in_cones
from pmviewer.photons.projection.gain import gain_of
from pmviewer.photons.projection.projection import projection_of
from pmviewer.photons.projection.small import Small, small_of
from pmviewer.scene.arrays.flatten import LUMINANCE, bounding_sphere, flatten
from pmviewer.scene.description import (
    Camera,
    Cylinder,
    Disk,
    Geometry,
    Mesh,
    Parallelogram,
    PointLight,
    Scene,
    Shape,
    Sphere,
)
from pmviewer.settings.access import Photons
from tests.support.denser import at_once, same_power_less_variance
from tests.support.scenes import ball_mesh, box_walls, cube_mesh, diffuse, means_by_method

pytestmark = pytest.mark.usefixtures("every_surface")

FLOOR = Parallelogram((-40.0, 0.0, -40.0), (0.0, 0.0, 80.0), (80.0, 0.0, 0.0))
BACKDROP = Parallelogram((-40.0, 0.0, -40.0), (80.0, 0.0, 0.0), (0.0, 50.0, 0.0))
SHIP = Sphere((2.0, 0.8, 1.0), 0.8)
SMALL = Small(np.array(SHIP.center), 0.8 * math.sqrt(3))
INSIDE_OUT = ball_mesh(90.0, 3)
LAMPS: dict[str, Geometry | None] = {
    "dome": Sphere((0.0, 0.0, 0.0), 90.0, True),
    "dome of triangles": Mesh(INSIDE_OUT.vertices, INSIDE_OUT.faces[:, ::-1].copy()),
    "panel": Parallelogram((-10.0, 30.0, -10.0), (20.0, 0.0, 0.0), (0.0, 5.0, 20.0)),
    "disk": Disk((20.0, 40.0, 0.0), (-0.6, -0.8, 0.0), 8.0),
    "tube": Cylinder((-10.0, 25.0, -20.0), (10.0, 25.0, -20.0), 0.5),
    "ball": Sphere((-20.0, 40.0, 5.0), 4.0),
    "point": None,
}
POSITION = (-15.0, 45.0, 10.0)


def stage(*lamps: str, more: tuple[Shape, ...] = (), floor: Geometry = FLOOR, size: int = 24) -> Scene:
    """A ball on a floor before a backdrop; lamps reflect nothing."""
    shapes = [Shape("floor", floor, 0), Shape("backdrop", BACKDROP, 0), Shape("ship", SHIP, 0), *more]
    lights = []
    for name in lamps:
        geometry = LAMPS[name]
        if geometry is None:
            lights.append(PointLight(name, POSITION, (500.0, 400.0, 300.0)))
        else:
            shapes.append(Shape(name, geometry, 1, (2.0, 1.5, 1.0)))
    camera = Camera((5.5, 1.4, 6.0), (2.0, 0.6, 1.0), (0, 1, 0), 30.0, near=0.0, far=np.inf)
    return Scene(
        "stage", None, tuple(shapes), (diffuse(), diffuse("lamp", (0.0, 0.0, 0.0))), tuple(lights), camera, size, size
    )


def small(scene: Scene) -> Small | None:
    return small_of(scene, bounding_sphere(scene)[1])


def test_what_stands_before_a_backdrop_is_found():
    """On a floor as thin as a board, too, under a dome, and with a lamp above it."""
    scenes = {
        "floor and backdrop": stage("dome"),
        "board": stage("dome", floor=board()),
        "lamp": stage("dome", "panel", "ball"),
    }
    for name, scene in scenes.items():
        found = small(scene)
        assert found is not None, name
        np.testing.assert_allclose(found.center, SMALL.center, atol=1e-9)
        assert found.radius == pytest.approx(SMALL.radius), name


def board() -> Mesh:
    """A closed one, 80 m wide and 10 cm thick."""
    cube = cube_mesh((0.0, -1.0, 0.0))
    return replace(cube, vertices=cube.vertices * (40.0, 0.05, 40.0))


def test_what_a_room_holds_is_not_small():
    """Walls face each other; balls in a group are not each other's floors; and what a ball goes around is in it."""
    opposite = Shape("wall", replace(BACKDROP, corner=(-40.0, 0.0, 40.0)), 0)
    assert small(stage("dome", more=(opposite,))) is None
    room = replace(stage("dome"), shapes=(*box_walls(40.0), Shape("ship", SHIP, 0)))
    assert small(room) is None
    three = tuple(Shape(f"ball {x}", Sphere((x, 0.8, 1.0), 0.8), 0) for x in (0.0, 4.0))
    found = small(stage("dome", more=three))
    assert found is not None
    np.testing.assert_allclose(found.center, (2.0, 0.8, 1.0), atol=1e-9)
    assert found.radius == pytest.approx(math.sqrt(2.8**2 + 2 * 0.8**2))
    around = replace(stage("ball"), shapes=(Shape("around", Sphere((0.0, 0.0, 0.0), 90.0), 0), Shape("ship", SHIP, 0)))
    assert small(around) is None


@kernel
def _starts(scenes, projections, light, places, directions, origins, ways, factors):
    scene, projection = scenes[0], projections[0]
    for i in range(len(places)):
        position, direction = (places[i, 0], places[i, 1]), (directions[i, 0], directions[i, 1])
        p, d, _, factors[i] = start_in_cones(scene, projection, light, position, direction)
        origins[i, 0], origins[i, 1], origins[i, 2] = p
        ways[i, 0], ways[i, 1], ways[i, 2] = d


def shares(name: str, radius: float) -> float:
    """Of the lamp's light, what meets a ball of that radius around what is small: in a convex dome lines through it are
    as dense as everywhere; a point on a lamp sees a ball as the cosine times the squared ratio of radius and
    distance."""
    geometry = LAMPS[name]
    if geometry is None:
        return (1 - math.sqrt(1 - (radius / math.dist(POSITION, SHIP.center)) ** 2)) / 2
    if isinstance(geometry, Mesh):
        a, b, c = geometry.vertices[geometry.faces].transpose(1, 0, 2)
        return 4 * math.pi * radius**2 / (np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
    if name == "dome":
        return (radius / 90.0) ** 2
    rng = np.random.default_rng(8)
    u, v = rng.random((2, 400_000))
    if isinstance(geometry, Parallelogram):
        points = geometry.corner + u[:, None] * geometry.edge_u + v[:, None] * geometry.edge_v
        normals = np.cross(geometry.edge_u, geometry.edge_v)[None]
    elif isinstance(geometry, Disk):
        across = np.array([[0.8, -0.6, 0.0], [0.0, 0.0, 1.0]])
        turned = np.stack([np.cos(2 * math.pi * v), np.sin(2 * math.pi * v)], 1) * np.sqrt(u)[:, None]
        points, normals = geometry.center + geometry.radius * turned @ across, np.array([geometry.normal])
    elif isinstance(geometry, Cylinder):
        normals = np.stack([0 * u, np.cos(2 * math.pi * v), np.sin(2 * math.pi * v)], 1)
        points = geometry.p0 + u[:, None] * np.subtract(geometry.p1, geometry.p0) + geometry.radius * normals
    else:
        normals = rng.standard_normal((400_000, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        points = geometry.center + geometry.radius * normals
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    away = np.subtract(SHIP.center, points)
    distance = np.linalg.norm(away, axis=1)
    return float(((radius / distance) ** 2 * np.maximum((away * normals).sum(1) / distance, 0.0)).mean())


@pytest.mark.parametrize("name", list(LAMPS))
def test_power_arrives_as_it_should_and_photons_densely(name):
    """Through balls around what is small goes the power that goes there without; of photons so many more than that as
    is reckoned."""
    flat, n = flatten(stage(name)), 400_000
    projection = projection_of(flat)
    assert [m.mode for m in projection.surfaces] == ["cones"]
    rng = np.random.default_rng(4)
    places, directions = rng.random((2, n, 2), np.float32)
    origins, ways, factors = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    _starts(flat.record, projection.records, 0, places, directions, origins, ways, factors)
    away = SMALL.center - origins
    along = (away * ways).sum(1)
    miss = np.sqrt(np.maximum((away**2).sum(1) - along**2, 0.0))
    for radius in (SMALL.radius, 2.5 * SMALL.radius, 6 * SMALL.radius):
        inside = (miss <= radius) & (along > 0)
        share, error = shares(name, radius), math.sqrt((factors[inside] ** 2).sum()) / n
        print(f"{name}, {radius:.2f}: {factors[inside].sum() / n:.6f} ± {error:.6f} of the power, {share:.6f} expected")
        # A lamp's far side sees a part of a large ball alone, which the formula for whole ones leaves out.
        slack = 0.02 * share if name in ("tube", "ball") else 0.0
        assert factors[inside].sum() / n == pytest.approx(share, abs=4 * error + slack)
    assert factors.sum() / n == pytest.approx(1.0, abs=4 * factors.std() / math.sqrt(n))
    assert factors.max() <= 4.0001
    near = ((miss <= SMALL.radius) & (along > 0) & (factors > 0)).mean() / shares(name, SMALL.radius)
    reckoned = gain_of(LAMPS[name], np.array(POSITION), SMALL)
    print(f"{near:.1f} times as many photons, {reckoned:.1f} reckoned")
    assert 0.9 * reckoned < near < 1.5 * reckoned


def test_a_lamp_that_shines_elsewhere_aims_at_nothing():
    assert gain_of(Disk((20.0, 40.0, 0.0), (0.6, 0.8, 0.0), 8.0), None, SMALL) == 1.0
    assert gain_of(Sphere(SHIP.center, 0.5), None, SMALL) == 1.0


@pytest.mark.parametrize("lamps", [("dome",), ("dome", "point"), ("panel", "tube")], ids="+".join)
def test_power_of_the_maps_is_the_same_and_better_known(lamps):
    """z-test of the power that photons bring the ship from the lamps, and how much less it varies; the energy
    balances."""
    flat = flatten(stage(*lamps))

    def power_of(maps):
        stored = unpack(maps.global_, maps.global_unit)
        near = (np.linalg.norm(stored["position"] - SMALL.center, axis=1) < 0.81) & (stored["path_class"] == DIRECT)
        return stored["Phi"][near].astype(float) @ LUMINANCE

    same_power_less_variance(flat, projection_of(flat), power_of, stored=3, times=15)


def test_a_dome_ten_million_times_as_large():
    """Cones narrower than float32 tells directions apart miss photons that aim at them, which then count for too much
    (1.037 times at 5 m): the power that goes by what is small is right there, too."""
    scene, n = stage("dome"), 2_000_000
    vast = tuple(replace(s, geometry=Sphere((0, 0, 0), 1e7, True)) if s.name == "dome" else s for s in scene.shapes)
    flat = flatten(replace(scene, shapes=vast))
    projection = projection_of(flat)
    rng = np.random.default_rng(5)
    places, directions = rng.random((2, n, 2), np.float32)
    origins, ways, factors = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
    _starts(flat.record, projection.records, 0, places, directions, origins, ways, factors)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    away = SMALL.center - origins
    miss = np.linalg.norm(np.cross(away, ways), axis=1)
    for radius in (5.0, 20.0, 100.0):
        inside = miss <= radius
        share, error = (radius / 1e7) ** 2, math.sqrt((factors[inside] ** 2).sum()) / n
        print(f"{radius:g}: {factors[inside].sum() / n:.4g} ± {error:.2g} of the power, {share:.4g} expected")
        assert factors[inside].sum() / n == pytest.approx(share, abs=3 * error + 0.01 * share)


def test_lamps_whose_light_is_wasted_get_no_more_photons_than_they_bring():
    """A panel near the ship has a thousandth of the dome's power and is as bright there: its photons are as many, and
    all that arrive have about the same power."""
    panel = Parallelogram((0.5, 4.0, -0.5), (3.0, 0.0, 0.0), (0.0, 0.0, 3.0))
    scene = stage("dome", more=(Shape("panel", panel, 0, (8.0, 8.0, 8.0)),))
    flat = flatten(scene)
    maps = trace_pass(flat, Photons(q=1.0), 3, 0, 200_000, False, at_once, projection=projection_of(flat))
    stored = unpack(maps.global_, maps.global_unit)
    near = (np.linalg.norm(stored["position"] - SMALL.center, axis=1) < 0.81) & (stored["path_class"] == DIRECT)
    power = stored["Phi"][near].astype(float) @ LUMINANCE
    alone = flat.light_power @ LUMINANCE / flat.total_luminance
    of_panel = stored["light"][near] == 0
    mean = [power[of_panel].mean(), power[~of_panel].mean()]
    print(f"{of_panel.sum()} photons of the panel and {(~of_panel).sum()} of the dome, {mean} W; shares of the {alone}")
    assert alone[0] < 2e-3
    assert of_panel.mean() > 0.2
    assert 0.5 < mean[0] / mean[1] < 2


@pytest.mark.slow
def test_all_methods_show_the_same_stage():
    means = means_by_method(stage("dome", "point"), 1024)
    assert means["progressive"] == pytest.approx(means["path"], rel=0.02)
    assert means["gather"] == pytest.approx(means["path"], rel=0.02)
