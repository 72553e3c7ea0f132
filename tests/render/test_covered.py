"""What surfaces leave of a look-up's disc uncovered, against areas counted by points that know the scene's planes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.estimate.filters import FILTERS
from pmviewer.render.closest_hits import closest_hits
from pmviewer.render.covered import Spot, over_covered
from pmviewer.render.record import EYE_DTYPE
from pmviewer.scene.description import Camera, ConstantEnvironment, Cylinder, Mesh, Parallelogram, Scene, Shape, Sphere
from pmviewer.scene.medium import Medium
from tests.support.scenes import MIRROR, box_walls, diffuse, rendered, settings_of

RADIUS, FLATNESS = 0.5, 0.2
PLATE = Parallelogram((-1, -1, 0), (2, 0, 0), (0, 2, 0))
NEXT = Parallelogram((1, -1, 0), (2, 0, 0), (0, 2, 0))
"""The plate's continuation."""


def plane(x, y, z=0.0, lean=(1.0, 0.0)):
    """A plate beside x, which goes on by (lean) in x and z, seen from above."""
    return Parallelogram((x, y, z), (2 * lean[0], 0, 2 * lean[1]), (0, 2, 0))


@kernel
def factors(scenes, eyes, prim, p, n, radius, enough, out):
    """`over_covered` of as many passes as `out` has room for, and of places that are hardly apart."""
    scene, eye = scenes[0], eyes[0]
    for i in range(len(out)):
        eye.index = np.uint32(i)
        at = Spot(prim, (p[0] + np.float32(1e-6) * np.float32(i), p[1], p[2]), (n[0], n[1], n[2]))
        out[i] = over_covered(scene, eye, at, radius, enough)


def factor(
    shapes, x, y, *, materials=(), media=(), z=0.0, enough=3, kind="constant", known=True, passes=4000, radius=RADIUS
):
    """Mean factor, and its standard error, of look-ups from above at (x, y) on the first of the shapes."""
    pieces = tuple(s if isinstance(s, Shape) else Shape(f"s{i}", s, 0) for i, s in enumerate(shapes))
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 40.0)
    sky = ConstantEnvironment("sky", (1.0,) * 3)
    scene = Scene("plates", None, pieces, (diffuse(), *materials), (sky,), camera, 8, 8, media=media)
    flat = open_scene(scene).flat
    hits = closest_hits(flat.record[0], np.array([[x, y, 1e-3]]), np.array([[0, 0, -1.0]]))
    assert hits.t[0] == pytest.approx(1e-3, rel=0.01)
    eye = np.zeros(1, EYE_DTYPE)
    eye["covered"], eye["flatness"], eye["cone_k"], eye["filter"] = 1, FLATNESS, 1.1, FILTERS.index(kind)
    out = np.zeros(passes, np.float32)
    prim, p = np.int64(hits.prims[0] if known else -1), np.array([x, y, 0], np.float32)
    n = np.array([0, 0, 1], np.float32)
    factors(flat.record, eye, prim, p, n, np.float32(RADIUS), np.int64(enough), out)
    return out.mean(), out.std(ddof=1) / np.sqrt(passes)


def share(x, y, area, weight=lambda x2: 1.0):
    """Share of the disc around (x, y), weighed by `weight` of the squared relative distance, that is surface: `area`
    says how much there is above or below places (m,), which lie on a fine grid."""
    u = (np.arange(2000) + 0.5) / 1000 - 1
    dx, dy = np.meshgrid(u, u)
    inside = dx**2 + dy**2 < 1
    dx, dy = dx[inside], dy[inside]
    w = weight(dx**2 + dy**2) * np.ones(len(dx))
    return (w * area(x + RADIUS * dx, y + RADIUS * dy)).sum() / w.sum()


def on_plate(x, y):
    return (np.abs(x) < 1) & (np.abs(y) < 1)


PLACES = [(0.0, 0.0), (0.75, 0.0), (0.95, 0.3), (0.999, 0.0), (0.85, 0.9)]


@pytest.mark.parametrize(("x", "y"), PLACES)
@pytest.mark.parametrize("enough", [1, 3])
def test_edges_and_corners_of_a_plate(x, y, enough):
    mean, error = factor([PLATE], x, y, enough=enough)
    expected = 1 / share(x, y, on_plate)
    print(f"({x}, {y}): {mean:.4f} ± {error:.4f}, exactly {expected:.4f}")
    assert mean == pytest.approx(expected, rel=0.02, abs=4 * error)
    assert expected > 1.001 or mean == 1.0


def test_nothing_needs_to_be_known_of_the_surface():
    """The same place has the same factor then, whatever the pass."""
    mean, error = factor([PLATE], 0.85, 0.9, known=False)
    assert mean == pytest.approx(1 / share(0.85, 0.9, on_plate), rel=0.02, abs=4 * error)


WALL = Parallelogram((1, -1, 0), (0, 2, 0), (0, 0, 2))
NEIGHBOURS = {
    "wall": ([WALL], lambda x, y: on_plate(x, y) * 1.0),
    "the same plane": ([NEXT], lambda x, y: (x > -1) & (np.abs(y) < 1)),
    "a low step down": ([plane(1, -1, -0.02)], lambda x, y: (x > -1) & (np.abs(y) < 1)),
    "a high step down": ([plane(1, -1, -0.2)], lambda x, y: on_plate(x, y) * 1.0),
    "leaning away": (
        [plane(1, -1, 0.0, (1.0, -0.4))],
        lambda x, y: on_plate(x, y) + np.sqrt(1.16) * ((x > 1) & (np.abs(y) < 1) & (0.4 * (x - 1) < 0.1)),
    ),
    "what faces the other way": (
        [Parallelogram((1, -1, -0.02), (0, 2, 0), (-2, 0, 0))],
        lambda x, y: on_plate(x, y) * 1.0,
    ),
}


@pytest.mark.parametrize("kind", NEIGHBOURS)
def test_what_photons_would_count_on_is_covered(kind):
    neighbours, area = NEIGHBOURS[kind]
    mean, error = factor([PLATE, *neighbours], 0.9, 0.0)
    assert mean == pytest.approx(1 / share(0.9, 0.0, area), rel=0.035, abs=4 * error)


def test_sheets_above_one_another_count_each():
    above = Parallelogram((0.8, -1, 0.05), (2, 0, 0), (0, 2, 0))
    mean, error = factor([PLATE, above], 0.7, 0.0, known=False, enough=24)
    assert mean == pytest.approx(
        1 / share(0.7, 0.0, lambda x, y: on_plate(x, y) + 1.0 * (x > 0.8)), rel=0.03, abs=4 * error
    )


def test_mirrors_store_no_photons():
    """A mirror beside the plate is not covered, the same of another matt material is."""
    expected = 1 / share(0.9, 0.0, on_plate)
    for material, value in ((MIRROR, expected), (diffuse("white", (0.9,) * 3), 1.0)):
        mean, error = factor([PLATE, Shape("next", NEXT, 1)], 0.9, 0.0, materials=(material,))
        assert mean == pytest.approx(value, rel=0.02, abs=4 * error)


def test_boundaries_of_media_hide_nothing():
    below = plane(1, -1, -0.05)
    fog = Shape("fog", Parallelogram((0.5, -1, -0.03), (3, 0, 0), (0, 2, 0)), 1, media=(0, -1))
    null = replace(diffuse("boundary"), kind="null")
    mean, error = factor([PLATE, below, fog], 0.9, 0.0, materials=(null,), media=(Medium("fog"),))
    assert mean == pytest.approx(1.0, rel=0.02, abs=4 * error)


@pytest.mark.parametrize("opacity", [0.3, 1.0])
def test_what_lets_light_pass_in_part_is_covered_whole(opacity):
    """As many fewer photons stop there as count for more: in the mean but for a few percent."""
    veil = replace(diffuse("veil"), opacity=opacity)
    mean, error = factor([PLATE, Shape("next", NEXT, 1)], 0.9, 0.0, materials=(veil,), enough=24, passes=8000)
    assert mean == pytest.approx(1.0, rel=0.04, abs=4 * error)


@pytest.mark.parametrize("kind", ["cone", "epanechnikov"])
def test_filters_weigh_what_is_missing(kind):
    weight = {"cone": lambda x2: 1 - np.sqrt(x2) / 1.1, "epanechnikov": lambda x2: 1 - x2}[kind]
    mean, error = factor([PLATE], 0.8, 0.0, kind=kind)
    plain, weighed = (1 / share(0.8, 0.0, on_plate, w) for w in (lambda x2: 1.0, weight))
    assert plain > 1.04 * weighed
    assert mean == pytest.approx(weighed, rel=0.02, abs=4 * error)


def test_a_small_ball_is_the_area_of_its_cap():
    """A ball of the disc's radius: its cap is what lies less than the disc's thickness below the top, within reach."""
    for ball in (Sphere((0, 0, -0.5), 0.5), Cylinder((0, -2, -0.5), (0, 2, -0.5), 0.5)):
        across = np.hypot if isinstance(ball, Sphere) else lambda x, y: np.abs(x)

        def cap(x, y, across=across):
            d = np.minimum(across(x, y), 0.499)
            z = np.sqrt(0.25 - d**2) - 0.5
            reached = (x**2 + y**2 + z**2 < RADIUS**2) & (z > -FLATNESS * RADIUS)
            return reached * 0.5 / np.sqrt(0.25 - d**2)

        mean, error = factor([ball], 0.0, 0.0, enough=12)
        assert mean == pytest.approx(1 / share(0.0, 0.0, cap), rel=0.03, abs=4 * error)


def furnace(shapes):
    """Every surface emits half and reflects half: radiance 1 everywhere in what is closed."""
    camera = Camera((0, 0, 0.9), (0, 0, -1), (0, 1, 0), 90.0, near=0.0, far=np.inf)
    lit = tuple(replace(s, radiance=(0.5,) * 3) for s in shapes)
    return Scene("furnace", None, lit, (diffuse(),), (), camera, 64, 64)


@pytest.mark.parametrize("lookup", ["radius", "nearest"])
def test_a_box_of_even_light_has_no_dark_edges(lookup):
    """Light that surfaces reflect is ½ everywhere; by discs alone what is less than a radius from an edge has less."""
    rims = {}
    for area in ("covered", "disc"):
        estimate = {"area": area, "radius": 0.3, "alpha": 1.0, "lookup": lookup, "k": 300, "caustic_radius": 1.0}
        settings = settings_of(render={"method": "progressive"}, photons={"N": 20_000}, estimate=estimate)
        frame = rendered(furnace(box_walls()), settings, 48).frame(0)
        image = frame.image("indirect").mean(axis=2, dtype=float)
        y, x = (np.arange(64) - 31.5)[:, None] / 32, (np.arange(64) - 31.5)[None] / 32
        # The back wall, 1.9 away, ends at 1/1.9 of the way to the picture's border.
        away = np.maximum(np.abs(x), np.abs(y)) * 1.9
        rims[area] = image[(away > 0.85) & (away < 0.97)].mean() / image[away < 0.5].mean()
    print(f"rim over middle, {lookup}: {rims['covered']:.4f}, by discs {rims['disc']:.4f}")
    assert rims["covered"] == pytest.approx(1, abs=0.02)
    assert rims["disc"] < 0.9


def test_gather_rays_end_in_no_dark_edges():
    """What surfaces reflect of light that surfaces reflect is ¼ everywhere, also beside many small things."""
    boxes = [
        Shape(f"box {i}", Mesh(*_cube((x, -0.6, z), 0.1)), 0)
        for i, (x, z) in enumerate((x, z) for x in (-0.6, -0.2, 0.2, 0.6) for z in (-0.6, -0.2))
    ]
    means = {}
    for area in ("covered", "disc"):
        estimate = {"area": area, "radius": 0.15, "alpha": 1.0}
        gather = {"rays": 16, "cache": "off", "secondary": 0.0}
        settings = settings_of(render={"method": "gather"}, photons={"N": 40_000}, estimate=estimate, gather=gather)
        means[area] = (
            rendered(furnace((*box_walls(), *boxes)), settings, 6).frame(0).image("indirect").mean(dtype=float)
        )
    print(f"indirect light {means['covered']:.4f}, by discs {means['disc']:.4f} of ¼")
    assert means["covered"] == pytest.approx(0.25, rel=0.01)
    assert means["disc"] < 0.97 * means["covered"]


def _cube(center, half):
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * half + center
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]]
    faces += [[2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
    return corners, np.array(faces, np.int32)
