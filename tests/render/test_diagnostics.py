"""Diagnostic planes against naive values, and that nothing else changes by them."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.maps.record import decode_directions, unpack
from pmviewer.output.diagnostic_views import DIAGNOSTICS
from pmviewer.settings.access import Settings, with_values
from tests.support import naive_maps as naive
from tests.support.scenes import diffuse_box, settings_of

SIZE = 16
GATHER = {"render.method": "gather", "gather.radiance_photons": "1/4"}


@pytest.fixture(scope="module")
def box():
    return open_scene(diffuse_box(size=SIZE))


def stepped(box, pool, values, passes=2):
    settings = with_values(settings_of(photons={"N": 3000}, estimate={"radius": 0.1}), values)
    renderer = Renderer(box, settings, pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
    return renderer


def hits(camera):
    """Points (n, 3) and normals on the box's walls that pixel middles see, in the order of pixels; NaN at the lamp and
    on edges."""
    x, y = np.meshgrid(np.arange(SIZE) + 0.5, np.arange(SIZE) + 0.5)
    corner, right, down = camera.ray_frame()[1:4]
    d = corner + x.reshape(-1, 1) * right + y.reshape(-1, 1) * down
    o = np.asarray(camera.origin, float)
    with np.errstate(divide="ignore"):
        t = np.where(d > 0, (1 - o) / d, (-1 - o) / d)
    axis = t.argmin(axis=1)
    rows = np.arange(len(d))
    p = o + t[rows, axis, None] * d
    n = np.zeros_like(p)
    n[rows, axis] = -np.sign(p[rows, axis])
    lamp = o + ((0.9 - o[1]) / d[:, 1:2]) * d
    behind = (d[:, 1] > 0) & (np.abs(lamp[:, 0]) < 0.4) & (np.abs(lamp[:, 2]) < 0.4)
    p[behind | ((np.abs(p) > 0.999).sum(axis=1) > 1)] = np.nan
    return p, n


def in_disc(photons, p, n, radius, flatness, flat=0.0):
    """Distances of the photons that arrive on the surface in the flattened disc; `flat`: as for `naive.arriving`."""
    off = unpack(photons, 1.0)["position"] - p
    inside = (np.abs(off @ n) <= flatness * radius) & naive.arriving(photons, p, n, flat)
    distance = np.linalg.norm(off[inside], axis=1)
    return distance[distance < radius]


def test_count_and_radius_are_those_of_the_look_up(box, pool):
    renderer = stepped(box, pool, {"render.method": "global map"})
    frame = renderer.frame(1, Wanted("look-up", "global"))
    radius = renderer.tally.radius["global"]
    counts, radii = (frame.image(view).reshape(-1) for view in ("photon count", "look-up radius"))
    photons = frame.clouds["global"].photons
    compared = 0
    for pixel, (p, n) in enumerate(zip(*hits(frame.camera), strict=True)):
        if np.isnan(p[0]):
            continue
        assert radii[pixel] == np.float32(radius)
        assert counts[pixel] == pytest.approx(
            len(in_disc(photons, p, n, radius, 0.2, 0.2 * radius / 2048)), abs=1
        )  # one on the rim
        compared += counts[pixel] > 0
    assert compared > 150


@pytest.mark.parametrize(("alpha", "k", "share"), [(1.0, 20, 1.0), (0.5, 18, 0.75 * 20 / 18)])
def test_the_radius_of_the_nearest_follows_the_density(box, pool, alpha, k, share):
    """In the second pass, whose look-ups have (1 + α)/2 of the first pass's area."""
    values = {"render.method": "global map", "estimate.lookup": "nearest", "estimate.k": 20, "estimate.flatness": 1.0}
    renderer = stepped(box, pool, values | {"estimate.max_radius": 0.5, "estimate.alpha": alpha})
    frame = renderer.frame(1, Wanted("look-up", "global"))
    counts, radii = (frame.image(view).reshape(-1) for view in ("photon count", "look-up radius"))
    photons = frame.clouds["global"].photons
    for pixel, (p, n) in enumerate(zip(*hits(frame.camera), strict=True)):
        if not np.isnan(p[0]):
            distances = np.sort(in_disc(photons, p, n, 1e9, 1.0))
            expected = np.sqrt(share) * distances[k - 1]
            assert radii[pixel] == pytest.approx(expected, rel=1e-3)
            assert counts[pixel] == pytest.approx((distances <= expected).sum(), abs=0 if share == 1 else 1)


@pytest.mark.extensive
@pytest.mark.parametrize("values", [{"estimate.area": "convex hull"}, {"estimate.differential": True}])
def test_other_estimates_have_their_radius_and_count(box, pool, values):
    plain = stepped(box, pool, {"render.method": "global map"}).frame(1, Wanted("look-up", "global"))
    frame = stepped(box, pool, {"render.method": "global map"} | values).frame(1, Wanted("look-up", "global"))
    radius, full = frame.image("look-up radius"), plain.image("look-up radius")
    if "estimate.area" in values:
        np.testing.assert_array_equal(radius, full)
        np.testing.assert_array_equal(frame.image("photon count"), plain.image("photon count"))
    else:
        assert np.all(radius <= full * (1 + 1e-6))
        assert np.all(frame.image("photon count") <= plain.image("photon count"))
        assert np.any(radius < 0.99 * full)


def test_radiance_photons_are_the_nearest_and_nothing_is_filled_in(box, pool):
    renderer = stepped(box, pool, GATHER)
    before = renderer.frame(1)
    frame = renderer.frame(2, Wanted("radiance photons"))
    np.testing.assert_array_equal(frame.clouds["radiance"].photons, before.clouds["radiance"].photons)
    cells = frame.image("radiance cells").reshape(-1)
    irradiance = frame.image("radiance photons").reshape(-1, 3)
    radiance = renderer.latest.maps.radiance.grid.photons
    normals = decode_directions(radiance.view(np.uint32)[:, 3])
    found = {}
    for pixel, (p, n) in enumerate(zip(*hits(frame.camera), strict=True)):
        if np.isnan(p[0]):
            continue
        similar = (normals @ n >= 0.9) & (np.abs((radiance[:, :3] - p) @ n) < 0.01)
        distance = np.where(similar, np.linalg.norm(radiance[:, :3] - p, axis=1), np.inf)
        nearest = int(distance.argmin())
        assert (cells[pixel] % 1 == 0) == (distance[nearest] < renderer.latest.given.eye[0]["radiance_cutoff"])
        assert found.setdefault(int(cells[pixel]), nearest) == nearest, "one cell, one radiance photon"
        assert np.all(irradiance[pixel] >= 0)
    assert len(set(found.values())) == len(found) > 50
    used = cells % 1 == 0
    assert 0.1 < used[cells >= 0].mean() < 1


def test_skipped_shadow_rays_are_those_that_the_pass_skips(box, pool):
    """Over all pixels the shares agree with the counts of the passes; all is skipped far from the shadow's edge, where
    the lamp does not graze the walls and photons are enough."""
    values = {"direct.shadow_photons": True, "direct.shadow_N": 20_000, "photons.N": 500}
    renderer = stepped(box, pool, values, passes=16)
    share = renderer.frame(1, Wanted("shadow rays")).image("shadow rays skipped").reshape(-1)
    told = share[share >= 0]
    counted = renderer.tally.saved_rays / (renderer.tally.saved_rays + renderer.tally.shadow_rays)
    assert told.mean() / 100 == pytest.approx(counted, abs=0.05)
    p, _ = hits(renderer.camera)
    ceiling = p[:, 1] > 0.999
    assert np.all(share[ceiling] == -1), "the light does not shine there"
    assert set(np.unique(share[(np.abs(p) < 0.8).sum(axis=1) == 2])) <= {100.0, -1.0}


def test_the_film_does_not_change(box, pool):
    plain, watched = stepped(box, pool, GATHER), stepped(box, pool, GATHER)
    for wanted in (Wanted("look-up", "global", 10), Wanted("radiance photons")):
        held = watched.inspect(wanted)
        assert held.planes
        assert (held.paths is not None) == (wanted.paths > 0)
    plain.step()
    watched.step()
    assert plain.film.sums.tobytes() == watched.film.sums.tobytes()


def test_any_number_of_threads_gives_the_same_planes(box, pool):
    one = WorkPool(1)
    try:
        for family in ("look-up", "radiance photons"):
            a, b = (stepped(box, p, GATHER).inspect(Wanted(family, "global")).planes for p in (pool, one))
            for view in a:
                assert a[view].tobytes() == b[view].tobytes()
    finally:
        one.close()


LOOKED_UP = {"look-up radius", "photon count", "samples a pass"}
"""Of photon methods."""


@pytest.mark.parametrize(
    ("values", "views"),
    [
        ({"render.method": "path"}, set()),
        ({}, {*LOOKED_UP, "achieved density"}),
        (GATHER, {*LOOKED_UP, "achieved density", "radiance photons", "radiance cells"}),
        ({"direct.shadow_photons": True}, {*LOOKED_UP, "achieved density", "shadow rays skipped"}),
    ],
)
def test_views_without_anything_to_show_are_refused_with_a_reason(box, values, views):
    settings = with_values(Settings(), values)
    reasons = {view: inactive_reason(f"display.view={view}", settings, box.traits) for view in DIAGNOSTICS}
    assert {view for view, reason in reasons.items() if reason is None} == views | {"noise"}
