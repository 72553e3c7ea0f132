"""Radiance photons: which there are, the nearest one, what is stored, and pictures made with them."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.photon_words import encode_direction
from pmviewer.maps.radiance import (
    SHARES,
    build_radiance_map,
    chosen,
    nearest_radiance_photon,
    radiance_photon_irradiance,
    radiance_photon_place,
    radiance_photon_slot,
    store_irradiance,
)
from pmviewer.maps.record import decode_directions, unpack
from pmviewer.scene.analysis import analyse
from pmviewer.scene.description import Camera, Parallelogram, Scene, Shape
from tests.support.scenes import (
    closed_sphere,
    cornell_box,
    diffuse,
    diffuse_box,
    rendered,
    settings_of,
)

pytestmark = pytest.mark.usefixtures("every_path_may_split")

SHARE_NAMES = list(SHARES)


@kernel
def encode_all(vectors, codes):
    for i in range(len(vectors)):
        codes[i] = encode_direction(vectors[i, 0], vectors[i, 1], vectors[i, 2])


@kernel
def nearest_all(records, points, normals, radius, flatness, similarity, found):
    for i in range(len(points)):
        p = (points[i, 0], points[i, 1], points[i, 2])
        n = (normals[i, 0], normals[i, 1], normals[i, 2])
        found[i] = nearest_radiance_photon(records[0], p, n, radius, flatness, similarity)


@kernel
def store_and_read(records, radiance, values, read, places, normals):
    for i in range(len(radiance)):
        store_irradiance(records[0], radiance[i], (values[i, 0], values[i, 1], values[i, 2]))
        read[i, 0], read[i, 1], read[i, 2] = radiance_photon_irradiance(
            records[0], radiance_photon_slot(records[0], radiance[i])
        )
        p, n = radiance_photon_place(records[0], radiance[i])
        for axis in range(3):
            places[i, axis], normals[i, axis] = p[axis], n[axis]


def directions(rng, n):
    v = rng.normal(size=(n, 3))
    return np.ascontiguousarray(v / np.linalg.norm(v, axis=1, keepdims=True), np.float32)


def made(positions, normals, radius):
    codes = np.empty(len(normals), np.uint32)
    encode_all(normals, codes)
    photons = np.zeros((len(positions), 6), np.float32)
    photons[:, :3] = positions
    return build_radiance_map(photons, codes, "all", radius, 1.0), decode_directions(codes)


def found_by(radiance, points, normals, radius, flatness=1.0, similarity=0.9):
    found = np.empty(len(points), np.int64)
    nearest_all(
        radiance.record, points, normals, np.float32(radius), np.float32(flatness), np.float32(similarity), found
    )
    return found


@pytest.mark.parametrize(("flatness", "similarity"), [(1.0, 0.9), (0.2, 0.9), (1.0, 0.3)])
def test_nearest_is_that_of_brute_force(flatness, similarity):
    rng = np.random.default_rng(5)
    radius = 0.08
    positions = rng.random((4000, 3), np.float32)
    radiance, normals = made(positions, directions(rng, 4000), radius)
    points, point_normals = rng.random((1000, 3), np.float32), directions(rng, 1000)
    found = found_by(radiance, points, point_normals, radius, flatness, similarity)
    offset = positions[None] - points[:, None]
    distance = np.linalg.norm(offset, axis=2)
    height = np.abs((offset * point_normals[:, None]).sum(axis=2))
    fits = (distance < radius) & (height <= flatness * radius) & (point_normals @ normals.T >= similarity)
    distance[~fits] = np.inf
    expected = distance.min(axis=1)
    # Where two pass a threshold by rounding alone the answers may differ.
    got = np.full(len(points), np.inf)
    places = radiance.grid.photons[:, :3]
    got[found >= 0] = np.linalg.norm(places[found[found >= 0]] - points[found >= 0], axis=1)
    assert 50 < np.isfinite(expected).sum() < 1000
    assert np.isclose(got, expected, rtol=1e-4).mean() > 0.998


def test_sides_of_a_thin_wall_stay_apart():
    """The radiance photon of the other side lies nearer, and is not taken."""
    up, down = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)
    positions = np.array([(0, 0, 0), (0.05, 0, 0), (0.0, 0.05, 0.0)], np.float32)
    radiance, _ = made(positions, np.array([down, up, (1.0, 0.0, 0.0)], np.float32), 0.2)
    points = np.zeros((3, 3), np.float32)
    found = found_by(radiance, points, np.array([up, down, (0.0, 0.0, 1.0)], np.float32), 0.2)
    assert found[2] == -1
    assert np.array_equal(radiance.grid.photons[found[:2], :3], positions[[1, 0]])


def test_nothing_is_found_in_an_empty_map():
    radiance, _ = made(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32), 0.2)
    up = np.array([(0.0, 1.0, 0.0)], np.float32)
    assert found_by(radiance, np.zeros((1, 3), np.float32), up, 0.2)[0] == -1
    assert radiance.known().shape == (0, 6)


def test_stored_irradiance_position_and_normal_are_read_back():
    rng = np.random.default_rng(7)
    positions, normals = rng.random((100, 3), np.float32), directions(rng, 100)
    radiance, decoded = made(positions, normals, 0.3)
    assert len(radiance.known()) == 0
    some = np.arange(0, 100, 3)
    values = np.exp(rng.uniform(-15, 15, (len(some), 3))).astype(np.float32)
    values[0] = 0
    read, places, read_normals = (np.empty((len(some), 3), np.float32) for _ in range(3))
    store_and_read(radiance.record, some, values, read, places, read_normals)
    assert read == pytest.approx(values, rel=2**-11)
    original = [int(np.flatnonzero((positions == p).all(axis=1))[0]) for p in places]
    assert np.abs(read_normals - decoded[original]).max() < 1e-5
    known = unpack(radiance.known(), radiance.grid.power_unit)
    assert np.array_equal(known["position"], places)
    assert np.array_equal(known["Phi"], read)
    assert np.abs(known["wi"] - read_normals).max() < 1e-5


@pytest.mark.parametrize("share", SHARE_NAMES)
def test_share_of_photons_that_become_radiance_photons(share):
    picked = chosen(100_000, share)
    assert picked.mean() == pytest.approx(1 / SHARES[share], rel=0.03)
    assert np.array_equal(picked[:5000], chosen(5000, share))


# Photons and passes as in the test of the plain gather.
@pytest.mark.extensive
@pytest.mark.parametrize("lookup", ["radius", "nearest"])
@pytest.mark.parametrize("share", SHARE_NAMES)
def test_radiance_of_the_closed_sphere_is_one(share, lookup):
    settings = settings_of(
        render={"method": "gather"},
        photons={"N": 60_000},
        gather={"radiance_photons": share},
        estimate={"lookup": lookup},
    )
    renderer = rendered(closed_sphere(), settings, passes=6)
    image = renderer.frame(1).image()
    print(f"{share}, {lookup}: mean {image.mean():.5f}, standard deviation {image.std():.4f}")
    assert image.mean() == pytest.approx(1.0, abs=0.005)
    assert renderer.tally.dropped == {"photons": 0, "samples": 0}


@pytest.mark.parametrize("N", [1000, 4000, 16_000])
def test_few_photons_change_the_noise_not_the_mean(N):
    """From less than one to some ten photons in a disc, where black beyond the cut-off would lose most of the light."""
    settings = settings_of(
        render={"method": "gather"},
        photons={"N": N},
        gather={"radiance_photons": "all", "rays": 64},
        estimate={"radius": 0.04},
    )
    mean = float(rendered(closed_sphere(size=48), settings, passes=8).frame(1).image("indirect").mean())
    print(f"N = {N}: mean {mean:.4f}")
    assert mean == pytest.approx(0.25, rel=0.02)


def below_a_lit_wall():
    """A thin wall, lit from above; the camera sees a floor in its shadow, to which the wall shows its dark side."""

    def square(half, y):
        return Parallelogram((-half, y, -half), (0, 0, 2 * half), (2 * half, 0, 0))

    light = Shape("light", Parallelogram((-0.3, 1, -0.3), (0.6, 0, 0), (0, 0, 0.6)), 0, (5.0,) * 3)
    camera = Camera((0, -0.05, 0.25), (0, -0.3, 0), (0, 1, 0), 40.0, near=0.0, far=np.inf)
    shapes = (Shape("wall", square(1.0, 0.0), 0), Shape("floor", square(0.3, -0.3), 0), light)
    return Scene("below a wall", None, shapes, (diffuse(),), (), camera, 24, 24)


@pytest.mark.parametrize("share", SHARE_NAMES)
def test_light_does_not_leak_through_a_thin_wall(share):
    settings = settings_of(
        render={"method": "gather"}, photons={"N": 20_000}, gather={"radiance_photons": share, "cutoff": 2.0}
    )
    renderer = rendered(below_a_lit_wall(), settings, passes=2)
    assert renderer.tally.stored["global"] > 10_000
    assert renderer.frame(1).image().max() == 0
    assert renderer.frame(1).image("normal")[..., 1].max() == 1  # the floor is in the picture


@pytest.mark.parametrize("lookup", ["radius", pytest.param("nearest", marks=pytest.mark.extensive)])
def test_threads_change_nothing(lookup):
    settings = settings_of(
        render={"method": "gather"},
        photons={"N": 20_000},
        gather={"radiance_photons": "1/4"},
        estimate={"lookup": lookup},
    )
    scene = cornell_box(size=64)
    one, two = (rendered(scene, settings, 3, threads) for threads in (1, 2))
    assert np.array_equal(one.film.sums, two.film.sums)
    clouds = [renderer.frame(1).clouds["radiance"] for renderer in (one, two)]
    assert np.array_equal(clouds[0].photons.view(np.uint32), clouds[1].photons.view(np.uint32))
    assert 0 < len(clouds[0].photons) == one.frame(1).statistics.stored_in_pass["radiance"]
    plain = settings_of(render={"method": "gather"}, photons={"N": 20_000}, estimate={"lookup": lookup})
    assert not np.array_equal(one.film.sums, rendered(scene, plain, 3).film.sums)


def test_caches_change_nothing():
    """Radiance photons that rays of another camera have computed are those that rays of this one would compute."""
    opened = open_scene(cornell_box())
    values = {"render": {"method": "gather"}, "photons": {"N": 20_000}, "gather": {"radiance_photons": "all"}}
    pool, cache, films = WorkPool(1), StageStore(), []
    for camera in ({"fov": 50.0}, {}):
        renderer = Renderer(opened, settings_of(**values, camera=camera), pool, cache)
        for _ in range(3):
            renderer.step()
        films.append(renderer.film.sums)
    pool.close()
    assert np.array_equal(films[1], rendered(opened, settings_of(**values), 3).film.sums)
    assert not np.array_equal(*films)


def test_plan_has_radiance_photons_where_they_are_asked_for():
    traits = analyse(diffuse_box())
    on, off = ({"radiance_photons": share} for share in ("1/4", "off"))
    assert plan_of(settings_of(render={"method": "gather"}, gather=on), traits).radiance
    assert not plan_of(settings_of(render={"method": "gather"}, gather=off), traits).radiance
    assert not plan_of(settings_of(render={"method": "progressive"}, gather=on), traits).radiance


@pytest.mark.parametrize("path", ["gather.cutoff", "gather.similarity"])
def test_settings_of_radiance_photons_say_when_they_do_nothing(path):
    traits = analyse(diffuse_box())
    on, off = ({"radiance_photons": share} for share in ("1/4", "off"))
    assert inactive_reason(path, settings_of(render={"method": "gather"}, gather=on), traits) is None
    assert "radiance photons" in inactive_reason(path, settings_of(render={"method": "gather"}, gather=off), traits)
    assert "gather" in inactive_reason(path, settings_of(render={"method": "progressive"}, gather=on), traits)


def test_no_photons_no_light():
    """A lamp that shines on nothing: the map is empty."""
    settings = settings_of(render={"method": "gather"}, photons={"N": 100}, gather={"radiance_photons": "all"})
    square = Parallelogram((-1, 0, -1), (0, 0, 2), (2, 0, 0))
    floor = Shape("floor", square, 0)
    upwards = Shape("lamp", Parallelogram((-1, 2, -1), (0, 0, 2), (2, 0, 0)), 1, (1.0,) * 3)
    camera = Camera((0, 1, 2), (0, 0, 0), (0, 1, 0), 40.0, near=0.0, far=np.inf)
    black = diffuse("black", (0.0, 0.0, 0.0))
    scene = Scene("away", None, (floor, upwards), (diffuse(), black), (), camera, 8, 8)
    renderer = rendered(scene, settings, passes=1)
    assert renderer.tally.stored["global"] == 0
    assert renderer.frame(1).image().max() == 0
