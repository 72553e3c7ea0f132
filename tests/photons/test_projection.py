"""Projection maps (T7): conservative, unbiased, and worth it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.auto.measured import Numbers
from pmviewer.engine.opened import open_scene
from pmviewer.engine.stages.projection import projection_for
from pmviewer.kernels.compile.jit import kernel
from pmviewer.kernels.random import INDEPENDENT
from pmviewer.maps.record import CAUSTIC, INDIRECT_CAUSTIC, unpack
from pmviewer.photons.light_pass import plan as passplan
from pmviewer.photons.light_pass.ledger import E_ABSORBED, E_EMITTED, E_ESCAPED, E_TERMINATED
from pmviewer.photons.light_pass.light_pass import trace_pass
from pmviewer.photons.projection.bounds import MOST_OF_MESHES, MOST_SPHERES, enclosing, spheres_of
from pmviewer.photons.projection.projected import concentric_from_polar
from pmviewer.photons.projection.projection import projection_of
from pmviewer.scene.arrays.flatten import LUMINANCE, flatten
from pmviewer.scene.description import Cylinder, Disk, Parallelogram, PointLight, Shape, Sphere
from pmviewer.settings.access import Photons
from tests.support.device import from_python
from tests.support.light_probe import LEANING, MORE, emit
from tests.support.scenes import GLASS, LIGHTS, MIRROR, ball_mesh, diffuse, diffuse_box, light_scene, settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

BALL = Sphere((-0.2, 0.25, 0.15), 0.12)
ALL = {**LIGHTS, **MORE, "leaning mesh": LEANING}


def lit(name, ball=BALL):
    """A floor with a small glass ball under one light."""
    light = ALL[name]
    scene = light_scene()
    floor = Shape("floor", Parallelogram((-1.0, 0.0, -1.0), (0.0, 0.0, 2.0), (2.0, 0.0, 0.0)), 0)
    shapes, lights = [floor, Shape("ball", ball, 2)], ()
    if isinstance(light, Disk | Sphere | Parallelogram) or name in (
        "cylinder",
        "cylinder inside",
        "mesh",
        "leaning mesh",
    ):
        shapes.append(Shape(name, light, 1, (2.0, 1.5, 1.0)))
    else:
        lights = (light,)
    return replace(scene, shapes=tuple(shapes), lights=lights, materials=(*scene.materials, GLASS))


def serially(tasks):
    return [task() for task in tasks]


def trace(flat, projection, N=60_000, q=0.2, seed=1, **settings):
    return trace_pass(flat, Photons(q=q, **settings), seed, 0, N, True, serially, projection=projection)


def caustic_power(maps, path_class):
    """Photons of that class and their mean-square, for the error: power in watts (luminance)."""
    found = unpack(maps.caustic, maps.caustic_unit)
    power = found["Phi"][found["path_class"] == path_class].astype(float) @ LUMINANCE
    return power.sum(), math.sqrt((power**2).sum()), len(power)


def meets(position, direction, center, radius):
    offset = np.asarray(center) - position
    along = (offset * direction).sum(1)
    miss = (offset**2).sum(1) - along**2
    return (miss <= radius**2) & ((along > 0) | ((offset**2).sum(1) <= radius**2))


@pytest.mark.parametrize("name", [n for n in ALL if n not in ("thin spot", "sphere inside", "cylinder inside")])
def test_maps_are_conservative(name):
    """200 000 photons that start anywhere: each that meets the ball lies in a cell that is on."""
    flat = flatten(lit(name))
    (chart,) = projection_of(flat).caustic
    position, direction, _, _ = emit(flat, 200_000, INDEPENDENT)
    hit = meets(position, direction, BALL.center, BALL.radius)
    print(f"{name}: mode {chart.mode}, share {chart.share:.4f}, {hit.mean():.4f} of all photons meet the ball")
    if chart.mode == "whole":
        return
    assert hit.sum() > 20
    assert hit.mean() < chart.share * 4.01 if chart.mode == "world directions" else hit.mean() <= chart.share * 1.01
    if chart.mode == "disc":
        across = position[hit] - chart.origin
        across -= (across * direction[hit]).sum(1, keepdims=True) * direction[hit]
        assert np.linalg.norm(across, axis=1).max() <= chart.edges[-1]
        return
    if chart.mode == "places":
        x, y, _ = ((position[hit] - chart.origin) @ chart.axes.T).T
        radius = np.hypot(x, y)
    else:
        x, y, z = (direction[hit] @ chart.axes.T).T
        radius = np.arctan2(np.hypot(x, y), z)
    row = np.clip(np.searchsorted(chart.edges, radius, side="right") - 1, 0, len(chart.edges) - 2)
    column = np.clip((np.arctan2(y, x) / (2 * math.pi) % 1.0 * chart.on.shape[1]).astype(int), 0, chart.on.shape[1] - 1)
    assert chart.on[row, column].all()


@pytest.mark.parametrize("name", list(ALL))
def test_equal_expected_power(name):
    """z-tests: caustic and global power with projection maps and without are estimates of the same; the energy ledger
    balances; and where the map is small, many more photons reach the ball."""
    flat = flatten(lit(name))
    projection = projection_of(flat)
    plain, mapped = (trace(flat, p, sequence="independent", seed=s) for p, s in ((None, 1), (projection, 2)))
    (a, ea, na), (b, eb, nb) = (caustic_power(m, CAUSTIC) for m in (plain, mapped))
    z = (a - b) / max(math.hypot(ea, eb), 1e-12)
    (chart,) = projection.caustic
    print(
        f"{name} ({chart.mode}, share {chart.share:.4f}): caustic {a:.5f} and {b:.5f} W, z {z:+.2f}, "
        f"{na} and {nb} photons"
    )
    assert abs(z) < 4
    stored = [unpack(m.global_, m.global_unit)["Phi"].astype(float) @ LUMINANCE for m in (plain, mapped)]
    # Photons of one trajectory are correlated: at most two or three lie on the floor and in the ball's light.
    error = math.sqrt(3 * sum((s**2).sum() for s in stored))
    assert abs(stored[0].sum() - stored[1].sum()) < 4 * error
    ledger = mapped.ledger
    ended = ledger[E_ABSORBED] + ledger[E_ESCAPED] + ledger[E_TERMINATED]
    assert ended == pytest.approx(ledger[E_EMITTED], rel=1e-6)
    if chart.mode != "whole":
        assert nb >= na


def test_caustics_after_a_diffuse_bounce_keep_their_power():
    """They come from the trajectories of the global map alone, and weigh more than direct ones."""
    flat = flatten(lit("point", Sphere((-0.2, 0.4, 0.15), 0.3)))
    plain, mapped = (
        trace(flat, p, N=400_000, q=0.5, sequence="independent", seed=s)
        for p, s in ((None, 1), (projection_of(flat), 2))
    )
    (a, ea, na), (b, eb, nb) = (caustic_power(m, INDIRECT_CAUSTIC) for m in (plain, mapped))
    print(f"indirect caustics {a:.5f} and {b:.5f} W, {na} and {nb} photons")
    assert abs(a - b) < 4 * math.hypot(ea, eb) * math.sqrt(2)
    assert nb > 40


def test_five_times_more_caustic_photons_for_a_small_ball():
    flat = flatten(lit("point"))
    N = 100_000
    plain, mapped = (trace(flat, p, N=N, q=0.1) for p in (None, projection_of(flat)))
    counts = [(unpack(m.caustic, 1.0)["path_class"] == CAUSTIC).sum() / m.emitted for m in (plain, mapped)]
    print(f"caustic photons per trajectory {counts[0]:.5f} and {counts[1]:.5f}, ratio {counts[1] / counts[0]:.1f}")
    assert counts[1] >= 5 * counts[0]


def test_nothing_is_traced_for_caustics_that_cannot_be():
    """The ball stands behind a spot: no light reaches it."""
    spot = MORE["sharp spot"]
    behind = np.array(spot.position) - np.array(spot.axis)
    flat = flatten(lit("sharp spot", Sphere(tuple(behind), 0.1)))
    projection = projection_of(flat)
    assert projection.caustic_power == 0
    maps = trace(flat, projection, N=10_000, q=0.25)
    assert maps.emitted == 2500
    assert np.isfinite(maps.caustic_unit)


def test_auto_leaves_closed_rooms_alone():
    closed = open_scene(diffuse_box())
    assert projection_for(closed, settings_of(photons={"q": 0.5})) is None
    scene = open_scene(lit("point"))
    assert projection_for(scene, settings_of(photons={"q": 0.5})) is not None
    assert projection_for(scene, settings_of(photons={"projection": "off"})) is None
    assert projection_for(scene, settings_of(render={"method": "path"})) is None
    assert projection_for(closed, settings_of(photons={"projection": "on"})) is not None


def test_mesh_spheres_cover_the_mesh():
    mesh = ball_mesh(0.7, 4)
    spheres = spheres_of(replace(light_scene(), shapes=(Shape("mesh", mesh, 0),))).around
    assert MOST_SPHERES <= len(spheres) < 2 * MOST_SPHERES
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), len(mesh.faces))
    points = (mesh.vertices[mesh.faces] * weights[:, :, None]).sum(1)
    gap = np.linalg.norm(points[:, None] - spheres[None, :, :3], axis=2) - spheres[None, :, 3]
    assert gap.min(axis=1).max() <= 1e-12
    center, radius = enclosing(spheres)
    assert np.linalg.norm(points - center, axis=1).max() <= radius


@pytest.mark.parametrize("q", [0.5, 0.125])
def test_photons_aimed_at_caustics_are_as_many_as_the_trial_reckons(q):
    """Squared powers of a light's caustic photons, the variance of a sum of them, fall by what automatic mode expects
    of q: with all trajectories filling both maps against q of them, by the share of the light that is covered."""
    flat = flatten(lit("point"))
    projection = projection_of(flat)
    everywhere = trace(flat, projection_of(flat, with_caustics=False), N=200_000, q=1.0, sequence="independent")
    aimed = trace(flat, projection, N=200_000, q=q, sequence="independent", seed=2)
    (_, before, many), (_, after, more) = (caustic_power(maps, CAUSTIC) for maps in (everywhere, aimed))
    expected = Numbers(1, q=q).aimed(projection.caustic_power / projection.surface_power)
    print(f"q {q}: {many} and {more} photons, variance {(before / after) ** 2:.2f} times less, expected {expected:.2f}")
    assert expected > 5
    assert (before / after) ** 2 == pytest.approx(expected, rel=0.1)


def leaning(z: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two axes across an axis that leans, and that one."""
    axis = np.array([0.48, 0.6, z]) / np.linalg.norm([0.48, 0.6, z])
    across = np.cross(axis, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    return across, np.cross(axis, across), axis


def round_points(kind: str, u: np.ndarray, v: np.ndarray) -> tuple[object, np.ndarray]:
    """A shape of that kind, and the points on it by two numbers from 0 to 1 each."""
    x, y, axis = leaning(-0.64)
    center, u, v = np.array([0.3, -2.0, 5.0]), u[:, None], v[:, None]
    circle = np.cos(2 * math.pi * u) * x + np.sin(2 * math.pi * u) * y
    if kind == "disk":
        return Disk(tuple(center), tuple(axis), 0.7), center + 0.7 * np.sqrt(v) * circle
    if kind in ("tall cylinder", "flat cylinder"):
        height = 3.0 if kind.startswith("tall") else 0.05
        return Cylinder(tuple(center), tuple(center + height * axis), 0.7), center + 0.7 * circle + v * height * axis
    if kind == "sphere":
        z = 2 * v - 1
        return Sphere(tuple(center), 0.7), center + 0.7 * (np.sqrt(1 - z**2) * circle + z * axis)
    edges = (2.0 * x, 0.1 * y + 0.5 * x)
    return Parallelogram(tuple(center), *map(tuple, edges)), center + u * edges[0] + v * edges[1]


@pytest.mark.parametrize("kind", ["disk", "tall cylinder", "flat cylinder", "sphere", "sheet"])
def test_spheres_cover_other_shapes_closely(kind):
    """Points on the shape, its rims among them, lie in a sphere each; and but for the ball, spheres are far smaller
    than the shape, so that what they don't cover of a ring's or a sheet's surroundings stays off the map."""
    u, v = np.random.default_rng(2).random((2, 20_000))
    v[:4000], u[4000:8000] = np.round(v[:4000]), np.round(u[4000:8000])
    geometry, points = round_points(kind, u, v)
    spheres = spheres_of(replace(light_scene(), shapes=(Shape(kind, geometry, 0),))).around
    gap = np.linalg.norm(points[:, None] - spheres[None, :, :3], axis=2) - spheres[None, :, 3]
    assert gap.min(axis=1).max() <= 1e-9
    size = np.linalg.norm(points - points.mean(axis=0), axis=1).max()
    assert spheres[:, 3].max() <= (0.25 if kind != "sphere" else 1.01) * size


@kernel
def _disc_points(u, v, out):
    for i in range(len(u)):
        out[i] = concentric_from_polar(u[i], v[i])


def test_polar_numbers_through_the_concentric_map():
    from pmviewer.kernels import warp

    rng = np.random.default_rng(2)
    u, v = rng.random((2, 2000)).astype(np.float32)
    out = np.zeros((2000, 2), np.float32)
    _disc_points(u, v, out)
    disk = from_python(warp.square_to_disk)
    points = np.array([disk(np.float32(a), np.float32(b)) for a, b in out])
    expected = np.sqrt(u)[:, None] * np.stack([np.cos(2 * np.pi * v), np.sin(2 * np.pi * v)], 1)
    assert points == pytest.approx(expected, abs=2e-6)


def test_points_in_a_sphere_see_everything():
    inside = replace(lit("point"), lights=(PointLight("inside", BALL.center, (1.0, 1.0, 1.0)),))
    (chart,) = projection_of(flatten(inside)).caustic
    assert chart.mode == "whole"


def test_units_of_the_caustic_map_follow_the_strongest_photons(monkeypatch):
    """Indirect caustics may weigh so much more than direct ones that no unit fits both but a small one: powers in watts
    are the same for any."""
    flat = flatten(lit("point", Sphere((-0.2, 0.4, 0.15), 0.3)))
    projection, found = projection_of(flat), []
    for largest in (2.0**12, 2.0**-5):
        monkeypatch.setattr(passplan, "LARGEST_SCALE", largest)
        photons = trace(flat, projection, N=400_000, q=0.5)
        found.append((photons.caustic_unit, unpack(photons.caustic, photons.caustic_unit)))
    (unit, plain), (larger, scaled) = found
    assert larger > 30 * unit
    assert np.array_equal(plain["path_class"], scaled["path_class"])
    assert {CAUSTIC, INDIRECT_CAUSTIC} <= set(plain["path_class"])
    np.testing.assert_allclose(scaled["Phi"], plain["Phi"], rtol=1e-3)


def test_many_meshes_share_their_spheres():
    """Of a room of a thousand meshes, as exporters write them, each has few; all of them cover it."""
    places = np.random.default_rng(3).random((1000, 3)) * 10
    meshes = [replace(ball, vertices=ball.vertices + place) for ball in [ball_mesh(0.2, 2)] for place in places]
    shapes = tuple(Shape(f"mesh {i}", mesh, i % 2) for i, mesh in enumerate(meshes))
    scene = light_scene()
    spheres = spheres_of(replace(scene, shapes=shapes, materials=(diffuse(), MIRROR)))
    assert 1000 < len(spheres.around) <= MOST_OF_MESHES
    assert len(spheres.caustic) == len(spheres.around)
    assert spheres.caustic.mean() == pytest.approx(0.5)
    for mesh in meshes[1:100:2]:
        near = spheres.around[spheres.caustic]
        gap = np.linalg.norm(mesh.vertices[:, None] - near[None, :, :3], axis=2) - near[None, :, 3]
        assert gap.min(axis=1).max() <= 1e-12
