"""Radii of pixels: what they are after a pass, who shows them, and who has none (E6)."""

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.render.pixel_radius import COUNTED, FOUND, OF_CAUSTIC, OF_GLOBAL, RADIUS, first_radii, shrink
from pmviewer.settings.access import Settings, with_values

PIXEL = {"estimate.radius_rule": "pixel"}
SMALL = {"camera.width": 32, "camera.height": 32, "photons.N": 4000, "render.method": "progressive"}


@pytest.fixture(scope="module")
def opened():
    return open_scene("cornell_caustic")


def stepped(opened, pool, values, passes=3):
    renderer = Renderer(opened, with_values(Settings(), SMALL | values), pool, StageStore(0))
    for _ in range(passes):
        renderer.step()
    return renderer


def test_the_rule_by_hand():
    """α = ½: 10 photons seen and 6 found leave 13 of 16 parts of the area; without photons nothing changes."""
    radii = first_radii(3, 4.0, 8.0)
    radii[0, [COUNTED + OF_CAUSTIC, FOUND + OF_CAUSTIC]] = 10, 6
    radii[1, [COUNTED + OF_GLOBAL, FOUND + OF_GLOBAL]] = 0, 5
    shrink(radii, 0.5, 0.0)
    assert radii[0, RADIUS + OF_CAUSTIC] == pytest.approx(4 * np.sqrt(13 / 16))
    assert radii[0, COUNTED + OF_CAUSTIC] == 13
    assert radii[1, RADIUS + OF_GLOBAL] == pytest.approx(8 * np.sqrt(1 / 2))
    assert radii[1, COUNTED + OF_GLOBAL] == 2.5
    np.testing.assert_array_equal(radii[2], [4, 8, 0, 0, 0, 0])
    assert not radii[:, FOUND:].any()
    radii[1, FOUND + OF_GLOBAL] = 100
    shrink(radii, 0.5, 5.5)
    assert radii[1, RADIUS + OF_GLOBAL] == 5.5
    assert radii[2, RADIUS + OF_CAUSTIC] == 4  # smaller than the floor from the beginning


def test_after_the_first_pass_a_pixel_shrinks_if_it_found_anything(opened, pool):
    renderer = stepped(opened, pool, PIXEL, 1)
    found = renderer.film.radii[:, FOUND:].copy()
    assert 0.5 < (found[:, OF_GLOBAL] > 0).mean() < 1
    assert 0.02 < (found[:, OF_CAUSTIC] > 0).mean() < 0.9
    renderer.step()
    first = np.array([0.5, 1.0]) * renderer.first_radius
    expected = first * np.where(found > 0, np.sqrt(renderer.settings.estimate.alpha), 1.0)
    np.testing.assert_allclose(renderer.film.radii[:, :COUNTED], expected, rtol=1e-5)


def test_found_photons_are_those_around_the_point(pool):
    """The view counts through the pixel's middle; the eye pass looks somewhere else in the pixel."""
    renderer = stepped(open_scene("cornell_diffuse"), pool, PIXEL | {"photons.N": 100_000}, 1)
    counts = renderer.frame(1, Wanted("look-up", "global")).image("photon count").reshape(-1)
    found = renderer.film.radii[:, FOUND + OF_GLOBAL]
    seen = counts >= 0
    assert found[seen].sum() == pytest.approx(counts[seen].sum(), rel=0.03)
    assert np.corrcoef(found[seen], counts[seen])[0, 1] > 0.8


def test_the_view_shows_them(opened, pool):
    renderer = stepped(opened, pool, PIXEL)
    frame = renderer.frame(1, Wanted("look-up", "global"))
    shown = frame.image("look-up radius").reshape(-1)
    seen = shown >= 0
    np.testing.assert_array_equal(shown[seen], renderer.film.radii[seen, RADIUS + OF_GLOBAL])
    assert len(np.unique(shown)) > 10


def test_the_same_for_any_number_of_threads_and_again(opened, pool):
    one = WorkPool(1)
    try:
        alone = stepped(opened, one, PIXEL)
    finally:
        one.close()
    together = stepped(opened, pool, PIXEL)
    np.testing.assert_array_equal(alone.film.sums, together.film.sums)
    np.testing.assert_array_equal(alone.film.radii, together.film.radii)


def test_a_wide_radius_is_not_cut_off(opened, pool):
    """Where nothing was found the radius stays the first one: the grid has to reach as far."""
    renderer = stepped(opened, pool, PIXEL | {"photons.N": 300}, 6)
    first = renderer.first_radius
    widest = renderer.film.radii[:, RADIUS + OF_GLOBAL].max()
    assert widest == pytest.approx(first, rel=1e-6)
    assert renderer.tally.radius["global"] < 0.9 * first
    structure = renderer.latest.maps.global_.structure
    assert structure.radius >= widest


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({}, False),
        ({"render.method": "gather"}, False),  # caustics
        ({"render.method": "caustic map"}, False),
        ({"estimate.area": "convex hull"}, False),
        ({"estimate.lookup": "nearest"}, True),
        ({"photons.renew": "once"}, True),
        ({"estimate.alpha": 1.0}, True),
        ({"render.method": "path"}, True),
    ],
)
def test_without_effect_it_says_so(opened, pool, values, reason):
    settings = with_values(Settings(), SMALL | values)
    assert (inactive_reason("estimate.radius_rule", settings, opened.traits) is not None) == reason


@pytest.mark.parametrize("values", [{}, PIXEL | {"estimate.lookup": "nearest"}, PIXEL | {"photons.renew": "once"}])
def test_pixels_without_the_rule_have_no_radii(opened, pool, values):
    assert stepped(opened, pool, values, 1).film.radii is None


def test_a_gather_of_a_diffuse_room_has_none(pool):
    opened = open_scene("cornell_diffuse")
    values = PIXEL | {"render.method": "gather"}
    assert stepped(opened, pool, values, 1).film.radii is None
    assert inactive_reason("estimate.radius_rule", with_values(Settings(), SMALL | values), opened.traits) is not None
