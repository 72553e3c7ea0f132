"""Reprojected gathers: the z-buffer against a naive twin and closed forms, pictures against full gathers."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.inspector.report import Pinned
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages import reprojection
from pmviewer.engine.store import StageStore
from pmviewer.kernels.compile.jit import kernel
from pmviewer.maps.hemisphere import strata
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.gather.estimation import gather_samples
from pmviewer.render.gather.reprojection import FULL, PARTIAL, look_around
from pmviewer.render.gather.zbuffer import (
    COARSEST,
    EMPTY,
    FACE,
    HIDING,
    HIT,
    LIGHT,
    PATCH,
    PLACE,
    USABLE,
    WAY,
    WIDEST,
    Hemisphere,
    clear,
    plot,
    resolve,
)
from pmviewer.scene.analysis import analyse
from pmviewer.scene.load import load_scene
from tests.support.scenes import cornell_box, diffuse_box, rendered, settings_of

ON = {"estimation": "on", "estimation_samples": 32, "reprojection": "on"}
ALONE = {**ON, "reprojection": "off"}
GATHER = {"render": {"method": "gather"}, "photons": {"N": 20_000}}
X, Y, Z = np.eye(3)


@kernel
def buffered(view, hits, points, cover, depth, owner, cells, known):
    """All hits plotted and resolved; returns how many cells are known."""
    clear(owner)
    for row in range(len(hits)):
        plot(view, hits, row, points, depth, owner)
    return resolve(view, hits, cover, depth, owner, cells, known)


def vector(v):
    return tuple(np.float32(c) for c in v)


def looked_from(x, hits, samples=256, parts=4, points=1, cover=0.25):
    """Seen from x with normal Z: owner (sectors·parts, rings·parts), depth alike, cells (n, 5), known (n,)."""
    rings, sectors = strata(samples)
    n = rings * sectors
    whole = [np.int64(i) for i in (rings, sectors, parts)]
    view = Hemisphere(vector(x), vector(Z), vector(Z), vector(X), vector(Y), *whole)
    depth, owner = np.zeros(n * parts**2, np.float32), np.zeros(n * parts**2, np.int32)
    cells, known = np.zeros((n, 5), np.float32), np.zeros(n, bool)
    count = buffered(view, hits, np.int64(points), np.float32(cover), depth, owner, cells, known)
    assert count == known.sum()
    shape = sectors * parts, rings * parts
    return owner.reshape(shape), depth.reshape(shape), cells, known


def stratified(samples, rng):
    """Directions (n, 3) around Z, one in each cell."""
    rings, sectors = strata(samples)
    j, k = np.meshgrid(np.arange(rings), np.arange(sectors))
    sin = np.sqrt((j + rng.random(j.shape)) / rings).ravel()
    phi = (2 * np.pi * (k + rng.random(k.shape)) / sectors).ravel()
    return np.column_stack([sin * np.cos(phi), sin * np.sin(phi), np.sqrt(np.maximum(1 - sin**2, 1e-12))])


def gathered(x, planes, rng, samples=256):
    """Known hits of a full gather at x. planes: (height, half width around the z axis, radiance(point)), nearest
    first; all else is empty."""
    hits = np.zeros((0, HIT), np.float32)
    for d in stratified(samples, rng):
        row = np.zeros(HIT, np.float32)
        row[PLACE : PLACE + 3], row[WAY], row[USABLE] = d, np.inf, 1
        for height, half, radiance in planes:
            p = x + d * (height - x[2]) / d[2]
            if np.abs(p[:2]).max() <= half:
                r = np.linalg.norm(p - x)
                row[PLACE : PLACE + 3], row[FACE : FACE + 3], row[WAY] = p, -Z, r
                row[LIGHT : LIGHT + 3], row[PATCH] = radiance(p), r * r / (d[2] * d[2])
                break
        hits = np.vstack([hits, row])
    return hits


def naive(x, hits, samples, parts, points):
    """Which hit each part shows: every hit against every part by the definitions, in double precision."""
    rings, sectors = (parts * count for count in strata(samples))
    owner, depth = np.full((sectors, rings), EMPTY), np.full((sectors, rings), np.inf)
    middle = np.sqrt((np.arange(rings) + 0.5) / rings), (np.arange(sectors) + 0.5) / sectors
    for number, row in enumerate(hits.astype(float)):
        far = np.isinf(row[WAY])
        d = row[:3] if far else row[:3] - x
        r = np.inf if far else np.linalg.norm(d)
        d = d / np.linalg.norm(d)
        if d[2] <= 0:
            continue
        facing = -d @ row[FACE : FACE + 3]
        cells = 1.0 if far else row[PATCH] * d[2] * abs(facing) / r**2
        hides = row[USABLE] == 0 or (not far and facing <= 0) or cells >= COARSEST
        cells = min(cells, WIDEST)
        radius, turn = math.hypot(d[0], d[1]), math.atan2(d[1], d[0]) / (2 * np.pi) % 1
        covers = np.zeros((sectors, rings), bool)
        covers[min(int(turn * sectors), sectors - 1), min(int(radius**2 * rings), rings - 1)] = True
        if cells * parts**2 / points > 1:
            # A square of that share of the unit disc's area, its sides along the ring and across it.
            half = 0.5 * math.sqrt(np.pi * cells * parts**2 / points / (rings * sectors))
            along = np.abs((middle[1] - turn + 0.5) % 1 - 0.5) <= half / max(radius, half) / (2 * np.pi)
            across = (middle[0] >= radius - half) & (middle[0] <= radius + half)
            covers |= along[:, None] & across
        nearer = covers & ((owner == EMPTY) | (r < depth))
        owner[nearer], depth[nearer] = HIDING - number if hides else number, r
    return owner, depth


def bright(p):
    return (1.0, 0.5, 0.25)


@pytest.mark.parametrize("points", [1, 2])
def test_the_z_buffer_is_its_naive_twin(points):
    """A square in front of a plane, gathered at two places and seen from a third nearer by, where squares of hits cover
    several parts; some hits hide only, some rays met nothing."""
    rng = np.random.default_rng(3)
    planes = [(1.0, 0.4, bright), (2.5, 6.0, bright)]
    hits = np.vstack([gathered(x, planes, rng) for x in (np.array([0.4, 0, 0]), np.array([-0.4, 0.2, 0]))])
    hits[rng.random(len(hits)) < 0.05, USABLE] = 0
    x = np.array([0.05, -0.1, 0.35])
    owner, depth, _, _ = looked_from(x, hits, points=points)
    expected, far = naive(x, hits, 256, 4, points)
    same = owner == expected
    print("same", same.mean())
    assert same.mean() > 0.998  # middles of parts on the very rim of a square
    np.testing.assert_allclose(depth[same & (owner != EMPTY)], far[same & (owner != EMPTY)], rtol=1e-5)
    assert {o <= HIDING for o in np.unique(owner)} == {True, False}


def test_a_square_in_front_of_a_plane_hides_what_is_behind_it():
    """Others have seen a bright plane where a dark square hides it here. Gaps and rims of the square about cancel: what
    the plane sends is 1 less the square's form factor."""
    rng = np.random.default_rng(4)
    half, x = 0.4, np.array([0.0, 0.0, 0.0])
    planes = [(1.0, half, lambda p: (0.0,) * 3), (2.5, 1e3, lambda p: (1.0,) * 3)]
    hits = np.vstack([gathered(np.array([u, v, 0]), planes, rng, 1024) for u in (-0.25, 0.25) for v in (-0.25, 0.25)])
    hidden = (hits[:, PLACE + 2] > 2) & (np.abs(hits[:, :2] / 2.5).max(axis=1) < half)
    assert hidden.sum() > 50
    owner, _, cells, known = looked_from(x, hits, 1024, points=4)
    sectors, rings = owner.shape
    sin, phi = np.sqrt((np.arange(rings) + 0.5) / rings), 2 * np.pi * (np.arange(sectors) + 0.5) / sectors
    tan = sin / np.sqrt(1 - sin**2)
    across = np.abs(np.stack([tan * np.cos(phi)[:, None], tan * np.sin(phi)[:, None]])).max(axis=0)  # at height 1
    front = np.isin(owner, np.flatnonzero(hits[:, PLACE + 2] < 2))
    shows = owner >= 0
    sure = shows & (across > 1.25 * half)
    assert not front[sure].any(), "the square ends"
    seen = hidden.sum() / ((hits[:, PLACE + 2] < 2).sum() + hidden.sum())
    leaks = 1 - front[shows & (across < 0.75 * half)].mean()
    root = math.hypot(1, half)
    F = 4 / (2 * np.pi) * 2 * half / root * math.atan(half / root)
    print("leaks", leaks, "of", seen, "dark", 1 - cells[known, 0].mean(), "form factor", F, "known", known.mean())
    assert leaks < 0.5 * seen
    assert known.mean() > 0.95
    assert 1 - cells[known, 0].mean() == pytest.approx(F, abs=0.015)


@pytest.mark.parametrize("x", [-0.25, 0.1, 0.3])
def test_irradiance_below_a_half_lit_ceiling(x):
    """A ceiling at height 1 of radiance 1 for x > 0: the point at x gets π/2·(1 + x/√(1 + x²)) of it."""
    rng = np.random.default_rng(5)
    ceiling = [(1.0, 1e6, lambda p: (float(p[0] > 0),) * 3)]
    hits = np.vstack([gathered(np.array([u, v, 0]), ceiling, rng, 1024) for u in (-0.4, 0.4) for v in (-0.4, 0.4)])
    _, _, cells, known = looked_from(np.array([x, 0.0, 0.0]), hits, 1024, points=4, cover=0.4)
    assert known.mean() > 0.8
    expected = 0.5 * (1 + x / math.hypot(1, x))
    rings, sectors = strata(1024)
    j, k = np.arange(rings * sectors) % rings, np.arange(rings * sectors) // rings
    sin, phi = np.sqrt((j + 0.5) / rings), 2 * np.pi * (k + 0.5) / sectors
    lit = x + sin * np.cos(phi) / np.sqrt(1 - sin**2) > 0  # what a ray through the middle of a cell finds
    E = np.where(known, cells[:, 0], lit).mean()
    print("E/pi", E, "expected", expected, "known", known.mean())
    assert pytest.approx(expected, abs=0.006) == E


def test_nothing_known_is_nothing_seen():
    _, _, _, known = looked_from(np.zeros(3), np.zeros((0, HIT), np.float32))
    assert not known.any()
    below = gathered(np.zeros(3), [(1.0, 5.0, bright)], np.random.default_rng(1))
    _, _, _, known = looked_from(np.array([0, 0, 1.5]), below[~np.isinf(below[:, WAY])])
    assert not known.any(), "all hits lie below the horizon"


def reprojected(scene, passes=2, threads=1, gather=ON, **groups):
    return rendered(scene, settings_of(**{**GATHER, "gather": gather, **groups}), passes, threads)


def test_gathers_without_sources_are_those_of_the_estimation_but_for_rounding(monkeypatch):
    scene = cornell_box(size=48)
    whole = {"area": "disc"}  # what covers a part of one is told by points that the last bit of a place decides
    alone = reprojected(scene, 2, gather=ALONE, estimate=whole)
    assert alone.latest.estimates.known is None
    some = reprojected(scene, 2, estimate=whole)
    monkeypatch.setattr(reprojection, "FEWEST", 5)
    full = reprojected(scene, 2, estimate=whole)
    assert (full.latest.estimates.known.how != PARTIAL).all()
    assert np.allclose(full.frame(0).planes, alone.frame(0).planes, rtol=1e-3, atol=1e-4)  # two kernels, each rounds
    assert full.tally.rays == alone.tally.rays
    assert not np.array_equal(some.frame(0).planes, alone.frame(0).planes)
    assert some.tally.rays < alone.tally.rays


def estimates_of(scene, index=0, **gather):
    """The estimates of pass `index`, what it was given, and who holds that."""
    pool = WorkPool(1)
    gather = {**ON, "estimation_samples": 64, "estimation_error": 0.1, **gather}
    renderer = Renderer(open_scene(scene), settings_of(**GATHER, gather=gather), pool, StageStore(0))
    renderer.film.passes = index
    renderer.step()
    pool.close()
    return renderer.latest.estimates, renderer.latest.given, renderer


def full_gathers(estimates, given, pixels, index):
    """Irradiance (n, 3) at pixels by gathers of their own, with the numbers of pass `index`."""
    eye, plane = given.eye.copy(), np.zeros_like(estimates.plane)
    eye["index"] = index
    told = np.zeros_like(estimates.told)
    given = given._replace(eye=eye, cache=estimates.record)
    gather_samples(given, pixels, estimates.known.samples, plane, told, np.zeros(N_COUNTS, np.int64), 0, len(pixels))
    return plane[pixels, :3].astype(float)


def test_full_gathers_take_what_those_around_them_found():
    """Their irradiance is that of cells seen by all of them, the rest by rays shot here, which are their own; it is
    that of many gathers there but for a tenth of a per cent or so, with far less noise than that of one gather."""
    estimates, given, _held = estimates_of(diffuse_box(size=192), estimation_smallest=16)
    known = estimates.known
    full = np.flatnonzero(known.how.ravel() == FULL).astype(np.int32)
    own = full_gathers(estimates, given, full, 0)
    ours = estimates.plane[full, :3].astype(float)
    pool = WorkPool(1)
    around = known.sources(full, pool)
    pool.close()
    near = (around >= 0).any(axis=1)
    assert near.mean() > 0.8
    full, around, own, ours = full[near], around[near], own[near], ours[near]
    n, counts = known.cells, np.zeros(N_COUNTS, np.int64)
    given = given._replace(cache=estimates.record)
    hits, same = (known.begin, known.count, known.hits), 0
    for pixel, sources, E in zip(full[:60], around[:60], ours[:60], strict=True):
        cells, found, axes = np.zeros((n, 5), np.float32), np.zeros(n, bool), np.zeros((2, 3))
        sources = np.append(pixel, sources).astype(np.int32)
        look_around(given, pixel, sources, known.samples, hits, known.rule, cells, found, axes, counts)
        same += bool(np.allclose(np.pi * cells[:, :3].mean(axis=0), E, rtol=1e-4))
    assert same == 60
    true = np.mean([full_gathers(estimates, given, full, index) for index in range(1, 33)], axis=0)
    errors = [float(np.sqrt(((E - true) ** 2).mean()) / true.mean()) for E in (own, ours)]
    print("own, pooled", errors, "share", ours.mean() / true.mean())
    assert errors[1] < 0.75 * errors[0]
    assert ours.mean() == pytest.approx(true.mean(), rel=0.02)


def test_full_gathers_stand_alone_in_the_limit():
    """As many of them pool as reproject: after 10⁵ passes hardly one, by the numbers of its own."""
    estimates, given, _held = estimates_of(diffuse_box(size=48), 10**5)
    full = np.flatnonzero(estimates.known.how.ravel() == FULL).astype(np.int32)
    own = full_gathers(estimates, given, full, int(given.eye[0]["index"]))
    alone = np.isclose(own, estimates.plane[full, :3], rtol=1e-3).all(axis=1)
    print("alone", alone.mean())
    assert alone.mean() > 0.8


def test_threads_do_not_change_the_picture():
    one, four = reprojected(cornell_box(), 3), reprojected(cornell_box(), 3, threads=4)
    assert np.array_equal(one.frame(1).planes, four.frame(1).planes)
    assert one.tally.estimates == four.tally.estimates
    assert one.tally.estimates["partial"] > 100


def test_later_passes_reproject_less():
    opened, pool, store = open_scene(diffuse_box(size=48)), WorkPool(1), StageStore(0)
    shares = []
    for index in (0, 63, 10**5):
        renderer = Renderer(opened, settings_of(**GATHER, gather={**ON, "estimation_error": 0.05}), pool, store)
        renderer.film.passes = index
        renderer.step()
        estimates = renderer.latest.estimates
        shares.append(float(estimates.told[estimates.how.ravel() == 2, 2].mean()))
    pool.close()
    print("reprojected", shares)
    assert shares[0] > 0.3
    assert shares[1] < 0.5 * shares[0]
    assert shares[2] < 0.05


@pytest.mark.extensive
@pytest.mark.slow
@pytest.mark.parametrize("scene", [diffuse_box(size=32), cornell_box(size=32)], ids=["diffuse box", "mirror and glass"])
def test_the_mean_is_that_of_the_plain_gather(scene):
    """Blocks of 8 × 8 pixels over independent seeds: differences as large as their own scatter explains."""

    def blocks(gather):
        means = []
        for seed in range(1, 13):
            groups = {"render": {"method": "gather", "seed": seed}, "photons": {"N": 4000}, "gather": gather}
            image = rendered(scene, settings_of(**groups), 4).frame(0).image("indirect").astype(float).mean(axis=2)
            means.append(image.reshape(4, 8, 4, 8).mean(axis=(1, 3)))
        return np.array(means)

    many = {**ON, "estimation_samples": 256, "estimation_error": 0.1, "estimation_spacing": 8}
    ours, plain = blocks(many), blocks({})
    variance = (ours.var(axis=0, ddof=1) + plain.var(axis=0, ddof=1)) / len(ours)
    lit = plain.mean(axis=0) > 0
    z = (ours.mean(axis=0) - plain.mean(axis=0))[lit] / np.sqrt(variance[lit])
    print("z", np.round(z, 1), "share", ours.mean() / plain.mean())
    assert (z**2).mean() < 2.5
    assert ours.mean() == pytest.approx(plain.mean(), rel=0.01)


def test_views_statistics_and_the_fisheye_say_the_same():
    opened, pool = open_scene(diffuse_box(size=64)), WorkPool(1)
    finer = {**ON, "estimation_error": 0.1, "reprojection_cover": 0.5}
    renderer = Renderer(opened, settings_of(**GATHER, gather=finer), pool, StageStore(0))
    renderer.step()
    estimates = renderer.latest.estimates
    counts, known = renderer.tally.estimates, estimates.known
    assert counts["full"] + counts["partial"] == counts["gathered"]
    share = renderer.inspect(Wanted("estimation")).planes["reprojected share"][..., 0]
    assert {"reprojected share"} < {name for name, view in DIAGNOSTICS.items() if view.family == "estimation"}
    assert (share[known.how == FULL] == 0).all()
    assert ((share < 0) == (estimates.how == 0)).all()
    assert share.max() <= 100
    n = known.cells
    shot = (1 - share[known.how == PARTIAL] / 100).sum() * n + counts["full"] * n
    assert counts["shot"] == pytest.approx(shot, rel=1e-4)
    for kind in (FULL, PARTIAL):
        y, x = np.argwhere(known.how == kind)[5]
        seen = renderer.inspect(Wanted(pinned=Pinned(int(x), int(y)))).pixel.fisheye
        np.testing.assert_array_equal(seen.estimate, estimates.plane[y * 64 + x, :3])
        if kind == FULL:
            assert seen.estimate == pytest.approx(seen.irradiance(seen.gathered), rel=0.3)
        assert (seen.reprojected == seen.gathered)[seen.shot].all()
        assert (seen.reprojected != seen.gathered)[~seen.shot].any()
        assert 0 < seen.shot.mean() < 1
    pool.close()


def test_what_it_is_for_and_why_it_has_no_effect():
    diffuse = analyse(diffuse_box())
    on = settings_of(render={"method": "gather"}, gather=ON)
    assert plan_of(on, diffuse).reprojection
    assert "gather reprojection" in plan_of(on, diffuse).running
    for name in ("gather.reprojection", "gather.reprojection_cover", "display.view=reprojected share"):
        assert inactive_reason(name, on, diffuse) is None
    off = settings_of(render={"method": "gather"}, gather=ALONE)
    assert not plan_of(off, diffuse).reprojection
    sentence = "Only with reprojected gathers (gather.reprojection)."
    assert inactive_reason("gather.reprojection_parts", off, diffuse) == sentence
    assert inactive_reason("display.view=reprojected share", off, diffuse) == sentence
    for gather in ({**ON, "estimation": "off"}, {**ON, "cache": "on"}):
        without = settings_of(render={"method": "gather"}, gather=gather)
        assert not plan_of(without, diffuse).reprojection
        assert "gather.estimation" in inactive_reason("gather.reprojection", without, diffuse)
    fog = analyse(load_scene("fog_sphere"))
    assert not plan_of(on, fog).reprojection
    assert inactive_reason("gather.reprojection", on, fog)
