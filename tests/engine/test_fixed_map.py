"""One photon map for all passes: what it holds stays, and the image converges to what the map says."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from tests.support.scenes import diffuse_box, settings_of


def renderer_of(pool, renew, cache_bytes, **groups):
    values = {"photons": {"N": 20_000, "renew": renew}, "render": {"method": "gather"}, "estimate": {"radius": 0.1}}
    return Renderer(open_scene(diffuse_box(size=16)), settings_of(**(values | groups)), pool, StageStore(cache_bytes))


@pytest.fixture
def pool():
    pool = WorkPool(2)
    yield pool
    pool.close()


def test_photons_and_radius_stay_and_are_counted_once(pool):
    kept, renewed = renderer_of(pool, "once", 1 << 28), renderer_of(pool, "each pass", 1 << 28)
    radii = []
    for _ in range(3):
        kept.step()
        renewed.step()
        radii.append((kept.tally.radius["global"], renewed.tally.radius["global"]))
    assert radii[0][0] == radii[2][0]
    assert radii[2][1] < radii[0][1]
    clouds = [r.frame(0).clouds["global"].photons for r in (kept, renewed)]
    assert kept.tally.emitted == 20_000
    assert renewed.tally.emitted == 60_000
    first = renderer_of(pool, "each pass", 1 << 28)
    first.step()
    np.testing.assert_array_equal(clouds[0], first.frame(0).clouds["global"].photons)
    assert len(clouds[1]) != len(clouds[0]) or not np.array_equal(clouds[0], clouds[1])


def test_a_map_that_does_not_fit_into_the_cache_is_made_again_the_same(pool):
    images = []
    for size in (1 << 28, 0):
        renderer = renderer_of(pool, "once", size)
        for _ in range(3):
            renderer.step()
        images.append(renderer.frame(0).image())
    np.testing.assert_array_equal(*images)


def test_gathering_from_a_fixed_map_converges_to_its_image_and_no_other(pool):
    """Two halves of many passes from one map agree; maps of different seeds keep apart: their bias and noise stay."""

    def halves(seed):
        values = {
            "render": {"method": "gather", "seed": seed},
            "gather": {"rays": 16},
            "photons": {"N": 300, "renew": "once"},
        }
        renderer = renderer_of(pool, "once", 1 << 28, **values)
        sums = []
        for _ in range(2):
            for _ in range(24):
                renderer.step()
            sums.append(renderer.film.sums[:, 12:15].mean(0).copy())
        return sums[0] / 24, (sums[1] - sums[0]) / 24

    (a, b), (c, d) = halves(1), halves(2)
    within = max(np.abs(a - b).max(), np.abs(c - d).max())
    between = np.abs((a + b) - (c + d)).max() / 2
    print(f"indirect light {a} and {b}, of another map {c} and {d}")
    assert within < 0.3 * between
