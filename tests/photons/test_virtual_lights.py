"""Virtual lights as they are traced, chosen and weighed (R10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.kernels.lights.start import spread_over
from pmviewer.maps.record import unpack
from pmviewer.maps.virtual_lights import (
    COLUMNS,
    MODIFIED,
    V_BEAMS,
    V_BLOCKED,
    V_FIRST,
    V_LAMBERTIAN,
    V_P,
    V_PHI,
    V_Q,
    V_WI,
)
from pmviewer.photons.virtual import single_step
from pmviewer.photons.virtual.choice import as_photons, chosen
from pmviewer.photons.virtual.flight import C_STORED, N_COUNTS
from pmviewer.photons.virtual.lights import neighbours, trajectories, virtual_lights
from pmviewer.photons.virtual.trace import TRACE_DTYPE, trace_virtual_lights
from pmviewer.scene.description import Material, Parallelogram, PointLight, Shape, SpotLight
from pmviewer.settings.access import Photons, Virtual
from tests.support.device import from_python
from tests.support.scenes import closed_sphere, diffuse, diffuse_box, light_scene


def serial(tasks):
    return [task() for task in tasks]


def made(scene, index=0, sequence="independent", **values):
    how = Virtual(**{"photons": 4000, **values})
    return virtual_lights(open_scene(scene).flat, how, Photons(sequence=sequence), 1, index, serial)


@pytest.mark.parametrize("density", ["photon map", "virtual lights"])
@pytest.mark.parametrize("k", [2, 16])
def test_areas_of_the_lights_add_up_to_that_of_the_surface(density, k):
    """Curved, with photons everywhere alike: 4π; flat and with edges, under a panel: the six walls and the panel's own
    back, less than a strip of which is dark."""
    areas = [made(closed_sphere(), i, number=1000, k=k, density=density).rows[:, V_Q].sum() for i in range(6)]
    assert np.mean(areas) == pytest.approx(4 * np.pi, rel=0.04)
    box = diffuse_box()
    areas = [made(box, i, number=2000, k=k, density=density).rows for i in range(6)]
    floor = [rows[rows[:, V_P + 1] < -1 + 1e-4, V_Q].sum() for rows in areas]
    assert np.mean(floor) == pytest.approx(4.0, rel=0.06)


@pytest.mark.parametrize("expected", [0.3, 1.5, 6.0])
@pytest.mark.parametrize("k", [2, 8])
def test_areas_add_up_to_what_lies_near_photons_where_discs_end(expected, k, monkeypatch):
    """On a sphere of radius 1 the largest disc expects PER_DISC photons: a place has none with probability e^−μ."""
    monkeypatch.setattr(single_step, "PER_DISC", expected)
    radius = open_scene(closed_sphere()).flat.radius
    areas = [made(closed_sphere(), i, number=1000, k=k).rows[:, V_Q].sum() for i in range(6)]
    assert np.mean(areas) == pytest.approx(4 * np.pi * (1 - np.exp(-expected * radius**2)), rel=0.04)


def striped():
    """A floor of 4 × 4 under a point light; a black plate keeps the light from a strip of 1.2."""
    floor = Parallelogram((-2.0, 0.0, -2.0), (0.0, 0.0, 4.0), (4.0, 0.0, 0.0))
    plate = Parallelogram((-0.2, 1.6, -2.0), (0.4, 0.0, 0.0), (0.0, 0.0, 4.0))
    light = PointLight("point", (0.0, 2.4, 0.0), (1.0, 1.0, 1.0))
    black = diffuse("black", (0.0, 0.0, 0.0))
    shapes = Shape("floor", floor, 0), Shape("plate", plate, 1)
    return replace(light_scene("point"), shapes=shapes, materials=(diffuse(), black), lights=(light,))


@pytest.mark.parametrize("k", [2, 8])
def test_areas_add_up_to_that_of_the_surface_beside_a_shadow_too(k):
    """All of the strip lies near photons, so that gather rays count there: it belongs to those along its rims. By discs
    out to the k-th photon the areas added up to 72 % of the floor."""
    areas = [made(striped(), i, number=1500, photons=3000, k=k).rows[:, V_Q].sum() for i in range(8)]
    print(np.mean(areas) / 16)
    assert np.mean(areas) == pytest.approx(16.0, rel=0.03)


def floor_with(*pieces):
    """These, each a parallelogram, under a point light over the middle."""
    light = PointLight("point", (0.0, 2.4, 0.0), (1.0, 1.0, 1.0))
    shapes = tuple(Shape(f"piece {i}", piece, 0) for i, piece in enumerate(pieces))
    return replace(light_scene("point"), shapes=shapes, materials=(diffuse(),), lights=(light,))


@pytest.mark.parametrize("k", [2, 8])
def test_areas_add_up_to_that_of_a_surface_that_bends(k):
    """Ten strips of a floor that rise and fall by 25°, narrower than cells. What lay more than a fifth of its distance
    below or above a light's tangent plane was left out, a quarter of all."""
    run, rise = 0.4, 0.4 * np.tan(np.radians(25.0))
    strips = []
    for i in range(10):
        low, high = (0.0, rise) if i % 2 else (rise, 0.0)
        strips.append(Parallelogram((-2.0 + run * i, low, -2.0), (0.0, 0.0, 4.0), (run, high - low, 0.0)))
    areas = [made(floor_with(*strips), i, number=400, photons=400, k=k).rows[:, V_Q].sum() for i in range(12)]
    print(np.mean(areas) / (16 / np.cos(np.radians(25.0))))
    assert np.mean(areas) == pytest.approx(16 / np.cos(np.radians(25.0)), rel=0.05)


def test_what_a_crate_stands_on_belongs_to_no_light():
    """Few photons, in wide cells that reach under it: no gather ray ends there."""
    a, h = 0.6, 0.3
    x, y, z, top = (2 * a, 0.0, 0.0), (0.0, h, 0.0), (0.0, 0.0, 2 * a), (-a, h, -a)
    corner, other = (-a, 0.0, -a), (a, 0.0, a)
    back = [tuple(-t for t in side) for side in (x, z)]
    sides = [(corner, x, y), (other, back[0], y), (corner, y, z), (other, y, back[1]), (top, z, x)]
    floor = Parallelogram((-2.0, 0.0, -2.0), (0.0, 0.0, 4.0), (4.0, 0.0, 0.0))
    scene = floor_with(floor, *(Parallelogram(*side) for side in sides))
    areas = [made(scene, i, number=300, photons=300).rows for i in range(30)]
    floor = [rows[rows[:, V_P + 1] < 1e-4, V_Q].sum() for rows in areas]
    print(np.mean(floor), 16 - 4 * a * a)
    assert np.mean(floor) == pytest.approx(16 - 4 * a * a, rel=0.03)


@pytest.mark.parametrize("k", [2, 16])
def test_photons_of_another_wall_own_nothing_of_this_one(k):
    """Few photons, in wide cells. With those of other walls near the edges walls had 90 to 99 % of their area."""
    areas = [made(diffuse_box(), i, number=150, photons=300, k=k).rows for i in range(60)]
    for axis in range(3):
        for side in (-1, 1):
            if (axis, side) != (1, 1):  # the ceiling lies behind the panel, whose back has photons, too
                wall = [rows[side * rows[:, V_P + axis] > 1 - 1e-4, V_Q].sum() for rows in areas]
                assert np.mean(wall) == pytest.approx(4.0, rel=0.05)


@pytest.mark.parametrize("opacity", [0.5, 0.8])
def test_surfaces_that_rays_pass_in_part_weigh_by_their_opacity_once(opacity):
    """A gather ray stops on the floor as often: all lights there weigh opacity times area. Places of a cell are found
    by rays that pass it as well, which weighed the floor by its opacity once more."""
    box = diffuse_box()
    shapes = [replace(s, material=1) if s.name == "floor" else s for s in box.shapes]
    box = replace(box, shapes=tuple(shapes), materials=(diffuse(), replace(diffuse("veil"), opacity=opacity)))
    areas = [made(box, i, number=2000).rows for i in range(8)]
    floor = [rows[rows[:, V_P + 1] < -1 + 1e-4, V_Q].sum() for rows in areas]
    assert np.mean(floor) == pytest.approx(4.0 * opacity, rel=0.06)


def test_places_that_hold_no_photons_belong_to_no_light():
    """Half of the floor is a mirror: lights of the other half weigh their own half alone, where gather rays count."""
    box = diffuse_box()
    mirror = Material("mirror", "conductor", (1.0,) * 3)
    left = Parallelogram((-1.0, -1.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -2.0))
    right = Parallelogram((0.0, -1.0, 1.0), (1.0, 0.0, 0.0), (0.0, 0.0, -2.0))
    shapes = [s for s in box.shapes if s.name != "floor"]
    shapes += [Shape("left", left, 0), Shape("right", right, 1)]
    box = replace(box, shapes=tuple(shapes), materials=(diffuse(), mirror))
    areas = [made(box, i, number=2000).rows for i in range(8)]
    floor = [rows[rows[:, V_P + 1] < -1 + 1e-4, V_Q].sum() for rows in areas]
    assert np.mean(floor) == pytest.approx(2.0, rel=0.06)


@pytest.mark.parametrize("estimator", ["unweighted", "single step", "full path", "modified", "printed single step"])
def test_power_of_the_lights_is_what_arrives_on_surfaces(estimator):
    """In a closed box of albedo ½ twice the power of the light arrives."""
    opened = open_scene(diffuse_box())
    total = [made(diffuse_box(), i, number=300, estimator=estimator).rows[:, V_PHI].sum() for i in range(8)]
    assert np.mean(total) == pytest.approx(2 * opened.flat.light_power[0, 0], rel=0.05)


def test_weights_of_modified_paths_do_not_grow_where_they_see_no_light():
    """Photons go on there as the gathering walk does, surely: in a grey box the weight stays that of the first hit,
    (1 − s)·q, however often the panel hid its light. With roulette it was 1/s times that each time, for ever fewer."""
    flat, N = open_scene(diffuse_box(albedo=0.3)).flat, 2000
    record = np.zeros(1, TRACE_DTYPE)
    record[0] = (1, 0, 0, 50, 0.2, MODIFIED)
    photons, rows = np.zeros((20 * N, 6), np.float32), np.zeros((20 * N, COLUMNS), np.float32)
    counts = np.zeros(N_COUNTS, np.int64)
    assert trace_virtual_lights(flat.record, record, 0, N, photons, rows, counts) == N
    rows = rows[: counts[C_STORED]]
    first = rows[:, V_FIRST] != 0
    of = np.cumsum(first) - 1
    weights = rows[:, V_Q] * np.where(first, 1 - 0.3, 0.3 / np.pi)
    assert weights == pytest.approx(weights[first][of], rel=1e-3)
    hidden = np.bincount(of, rows[:, V_BLOCKED])
    assert hidden.max() > 2


@pytest.mark.usefixtures("every_surface")
def test_a_glossy_light_stands_for_the_photons_around_it_and_for_itself():
    flat = open_scene("glossy_room").flat
    found = virtual_lights(flat, Virtual(photons=4000), Photons(), 1, 0, serial)
    rows, beams = found.rows, found.beams
    glossy = rows[:, V_LAMBERTIAN] == 0
    assert 10 < glossy.sum() < len(rows)
    assert not rows[~glossy, V_BEAMS].any()
    assert rows[glossy, V_BEAMS].max() == 9  # k and itself
    assert rows[glossy, V_BEAMS].min() >= 1  # in the dark there are fewer
    lonely = glossy & (rows[:, V_BEAMS] < 9)
    assert lonely.sum() < 0.5 * glossy.sum()
    glossy &= ~lonely
    assert beams[glossy][..., :3] == pytest.approx(beams[glossy][..., :3] / norms(beams[glossy][..., :3]), abs=1e-6)
    own = norms(beams[glossy][..., :3] - rows[glossy, None, V_WI : V_WI + 3])
    assert not own.min(axis=1).any()
    assert (np.sort(own[..., 0], axis=1)[:, 1] > 0).all()
    # Photons that wait their turn with roulette all bring about the same.
    power, kept = rows[glossy, V_PHI : V_PHI + 3].sum(), beams[glossy][..., 3:].sum()
    assert kept == pytest.approx(power, rel=0.03)


def norms(vectors):
    """Their lengths, the last axis kept."""
    return np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.mark.usefixtures("every_surface")
@pytest.mark.parametrize("values", [{"estimator": "every vertex"}, {"density": "virtual lights"}])
def test_where_the_map_does_not_weigh_them_lights_stand_for_themselves(values):
    found = virtual_lights(open_scene("glossy_room").flat, Virtual(photons=4000, **values), Photons(), 1, 0, serial)
    assert not found.rows[:, V_BEAMS].any()
    assert found.beams.shape[1] == 0


def test_every_candidate_is_chosen_as_often_as_its_probability_says():
    worth = np.array([0.4, 0.05, 0.25, 0.1, 0.2])
    counted = np.zeros(5)
    for start in (np.arange(2000) + 0.5) / 2000:
        kept, share = chosen(worth, 3, start)
        np.add.at(counted, kept, share)
    assert counted / 2000 == pytest.approx(np.ones(5), rel=0.01)


def test_no_candidates_and_no_power_choose_nothing():
    kept, share = chosen(np.zeros(0), 0, 0.5)
    assert len(kept) == len(share) == 0


def test_photon_records_carry_the_power_of_the_lights():
    lights = made(diffuse_box(), number=50)
    photons = unpack(lights.photons, lights.power_unit)
    assert photons["Phi"][:, 0] == pytest.approx(lights.rows[:, V_PHI], rel=2e-3)
    assert photons["position"] == pytest.approx(lights.rows[:, V_P : V_P + 3])
    doubled = as_photons(lights.photons, np.full(50, 2.0, np.float32))
    assert unpack(doubled, lights.power_unit)["Phi"] == pytest.approx(2 * photons["Phi"], rel=1e-3)


def test_maps_sharpen_from_pass_to_pass():
    how = Virtual()
    assert [trajectories(how, i) for i in (0, 7, 63)] == [20_000, 40_000, 80_000]
    assert [neighbours(how, i) for i in (0, 7, 63, 100_000)] == [8, 4, 2, 2]
    own = Virtual(density="virtual lights")
    assert trajectories(own, 63) == 2 * own.number
    assert neighbours(own, 63) == own.k


def test_passes_have_other_lights_and_a_pass_always_the_same():
    first, again, second = (made(diffuse_box(), i, number=40).rows for i in (0, 0, 1))
    assert (first == again).all()
    assert not {tuple(row[:3]) for row in first} & {tuple(row[:3]) for row in second}


def test_an_open_scene_may_have_fewer_lights_than_asked_for():
    lights = made(light_scene("point"), number=3000, estimator="unweighted")
    assert 0 < lights.n < 3000
    assert lights.n == lights.candidates


SPOT = SpotLight("spot", (0.0, 2.0, 0.0), (0.0, -1.0, 0.0), (3.0, 3.0, 3.0), 40.0, 25.0)


@pytest.mark.parametrize("light", ["point", "spot", "parallelogram", "disk", "sphere", "cylinder", "mesh"])
def test_densities_of_first_segments_have_the_integral_one(light):
    """∫ p_ω dω over all directions, by uniform ones; p_ω = distance²/spread."""
    scene = replace(light_scene("point"), lights=(SPOT,)) if light == "spot" else light_scene(light)
    record = open_scene(scene).flat.record
    spread = from_python(spread_over)
    rng = np.random.default_rng(2)
    total, n = 0.0, 20_000
    for d in rng.normal(size=(n, 3)):
        d /= np.linalg.norm(d)
        place = tuple(np.float32(rng.random(2)))
        area = spread(record[0], 0, place, tuple(np.float32(d)), np.float32(1.0))
        total += 1 / area if area > 0 else 0.0
    assert 4 * np.pi * total / n == pytest.approx(1.0, rel=0.05)


def test_light_from_outside_is_spread_over_the_disc_that_it_starts_on():
    opened = open_scene(light_scene("environment"))
    area = from_python(spread_over)(
        opened.flat.record[0], 0, (np.float32(0.5),) * 2, (np.float32(0), np.float32(1), np.float32(0)), np.float32(7)
    )
    assert area == pytest.approx(np.pi * opened.flat.radius**2, rel=1e-5)
