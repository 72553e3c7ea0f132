"""The virtual lights that the inspector lists at a pixel, against a sum over all of them in numpy (R10)."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.inspection import Wanted
from pmviewer.engine.inspector.report import Pinned
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.virtual_lights import V_N, V_P, V_PHI, V_Q, V_WI
from tests.support.scenes import cornell_box, settings_of

SIZE = 24
FLOOR, LEFT, CEILING, MIRROR = (12, 20), (3, 12), (12, 2), (6, 18)
WHITE, RED, GREEN = (0.7, 0.7, 0.7), (0.6, 0.1, 0.1), (0.1, 0.5, 0.1)
BALLS = np.array([[-0.45, -0.6, -0.4], [0.45, -0.6, 0.1]])
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture
def pool():
    pool = WorkPool(1)
    yield pool
    pool.close()


def renderer_of(pool, **virtual):
    settings = settings_of(
        render={"method": "virtual lights"},
        virtual={"number": 150, "photons": 2000, "normalisation": "none", **virtual},
    )
    renderer = Renderer(open_scene(cornell_box(size=SIZE)), settings, pool, StageStore(0))
    renderer.step()
    return renderer


def report(renderer, x, y):
    return renderer.inspect(Wanted(pinned=Pinned(x, y))).pixel


def albedo_at(p):
    """Of the box: red at x = −1, green at x = 1, else white, the panel too."""
    return np.where(p[:, :1] < -1 + 1e-4, RED, np.where(p[:, :1] > 1 - 1e-4, GREEN, WHITE))


def visible(x, y):
    """Whether the segments from x (3,) to y (n, 3) meet neither ball nor the panel; ends on the panel count by their
    cosines."""
    d = y - x
    free = np.ones(len(y), bool)
    for c in BALLS:
        t = np.clip(((c - x) * d).sum(axis=1) / (d * d).sum(axis=1), 0, 1)
        free &= np.linalg.norm(x + t[:, None] * d - c, axis=1) > 0.38
    with np.errstate(all="ignore"):
        t = (0.9 - x[1]) / d[:, 1]
        at = x + t[:, None] * d
    return free & ~((t > 1e-4) & (t < 1 - 1e-4) & (np.abs(at[:, [0, 2]]) < 0.4).all(axis=1))


def naive(rows, x, n):
    """(F, G, faces) of each light at the Lambertian point x with normal n: radiance, weight, and whether it faces x."""
    rows, x, n = rows.astype(np.float64), x.astype(np.float64), n.astype(np.float64)
    y, wi = rows[:, V_P : V_P + 3], rows[:, V_WI : V_WI + 3]
    ny = rows[:, V_N : V_N + 3]
    ny = ny * np.sign((ny * wi).sum(axis=1))[:, None]
    d = y - x
    d2 = (d * d).sum(axis=1)
    w = d / np.sqrt(d2)[:, None]
    cos = np.maximum(w @ n, 0) * np.maximum(-(w * ny).sum(axis=1), 0)
    geometry, rho = cos / d2, albedo_at(x[None])[0]
    F = rho / np.pi * albedo_at(y) / np.pi * rows[:, V_PHI : V_PHI + 3] * geometry[:, None]
    return F, rho @ LUMINANCE / np.pi * geometry * rows[:, V_Q], geometry > 1e-7


@pytest.mark.parametrize("estimator", ["unweighted", "single step"])
def test_each_light_adds_what_a_sum_over_all_of_them_says(pool, estimator):
    renderer = renderer_of(pool, estimator=estimator)
    rows = renderer.latest.virtual.lights.rows
    hidden = 0
    for pixel in (FLOOR, LEFT, CEILING):
        told = report(renderer, *pixel)
        (place,) = told.lit
        F, G, faces = naive(rows, place.p, place.n)
        seen = faces & visible(place.p, rows[:, V_P : V_P + 3].astype(np.float64))
        quotient = 1.0
        if estimator == "single step":
            albedo = albedo_at(place.p[None])[0] @ LUMINANCE
            quotient = albedo / G[seen].sum()
            by_light = np.zeros(len(rows))
            by_light[place.number] = place.weight
            assert by_light[seen] == pytest.approx(G[seen], rel=2e-3)
        assert place.quotient == pytest.approx(quotient, rel=2e-3)
        assert sorted(place.number) == list(np.flatnonzero(seen))
        assert place.adds == pytest.approx(F[place.number] * quotient, rel=5e-3)
        assert (np.diff(place.adds @ LUMINANCE) <= 1e-12).all(), "most first"
        assert place.sum == pytest.approx(told.terms[4], rel=1e-5), "what the picture shows"
        assert place.asked == len(rows)
        assert len(place.blocked) == (faces & ~seen).sum()
        hidden += len(place.blocked)
        walls = {-1: "left", 1: "right"}
        for name, p in zip(place.objects, place.points, strict=True):
            if abs(p[0]) > 1 - 1e-4:
                assert name == walls[round(p[0])]
            elif abs(p[1]) < 0.99 and abs(p[2]) < 0.99:
                assert name == "panel"
    assert hidden > 10


def test_over_a_mirror_and_with_a_part_of_the_lights(pool):
    """The surface is the one that the mirror shows, whose light is dimmed by the mirror, and lights stand for those
    that are not asked."""
    renderer = renderer_of(pool, estimator="unweighted", per_pixel=30)
    told = report(renderer, *MIRROR)
    (place,) = told.lit
    assert (place.shows, place.depth, place.asked) == ("specular", 1, 30)
    assert place.p == pytest.approx(told.way[-1], abs=1e-6)
    rows = renderer.latest.virtual.lights.rows
    F = naive(rows, place.p, place.n)[0] * 0.9 * len(rows) / 30
    assert place.adds == pytest.approx(F[place.number], rel=5e-3)
    assert (place.sum < told.terms[2]).all(), "direct light is seen in the mirror as well"


def test_the_latest_pass_times_the_quotient_of_all_passes(pool):
    """What the lights of a pass add is its ΣF times the quotient by which the picture is divided now."""
    renderer = renderer_of(pool, normalisation="interpolated", walks=4)
    first = report(renderer, *FLOOR)
    assert first.lit[0].sum == pytest.approx(first.terms[4], rel=1e-5)
    renderer.step()
    (now,) = report(renderer, *FLOOR).lit
    earlier = first.lit[0].sum / first.lit[0].quotient
    mean = (earlier + now.sum / now.quotient) * now.quotient / 2
    assert mean == pytest.approx(report(renderer, *FLOOR).terms[4], rel=1e-5)


def test_other_methods_tell_of_no_virtual_lights(pool):
    settings = settings_of(render={"method": "progressive", "outline_rays": 0}, photons={"N": 20_000})
    renderer = Renderer(open_scene(cornell_box(size=SIZE)), settings, pool, StageStore(0))
    renderer.step()
    assert report(renderer, *FLOOR).lit == ()
