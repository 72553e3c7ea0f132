"""Passes rendered elsewhere, in any order, and added in their order: the same film bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import SettingError
from pmviewer.settings.access import Settings, with_values

PASSES = 4
SMALL = {"camera.width": 20, "camera.height": 16, "photons.N": 3000, "gather.rays": 4}


def renderer(settings: Settings, threads: int) -> Renderer:
    return Renderer(open_scene("cornell_caustic"), settings, WorkPool(threads), StageStore())


@pytest.mark.extensive
@pytest.mark.slow
@pytest.mark.parametrize(
    "values",
    [
        {},
        {"render.filter": "Mitchell-Netravali", "importance.map": "footprint"},
        {"render.method": "gather", "region.on": True, "region.right": 0.6, "region.bottom": 0.5},
        {"render.method": "virtual lights", "virtual.normalisation": "per object"},
        {"render.method": "path"},
        {"photons.renew": "once"},
        {"render.method": "gather", "gather.directions": "photon cones", "direct.choice": "photons"},
        {"render.method": "gather", "gather.cache": "on"},
        {"render.method": "gather", "gather.estimation": "on", "gather.reprojection": "on"},
        {"estimate.lookup": "nearest", "photons.maps": 4},
    ],
    ids=[
        "as it comes",
        "signed filter",
        "gather, region",
        "virtual lights",
        "path",
        "photons once",
        "radii of the first pass",
        "irradiance cache",
        "gather reprojection",
        "several maps",
    ],
)
def test_passes_from_elsewhere_make_the_same_film(values):
    settings = with_values(Settings(), {**SMALL, **values})
    alone, whole = renderer(settings, 2), renderer(settings, 1)
    elsewhere = [renderer(settings, 1), renderer(settings, 3)]
    for _ in range(PASSES):
        alone.step()
    made = {index: elsewhere[index % 2].increment(index) for index in reversed(range(PASSES))}
    assert all(other.passes == 0 for other in elsewhere)
    for index in range(PASSES):
        whole.add(made[index])
    assert whole.film.passes == alone.film.passes == PASSES
    assert alone.film.sums.any()
    np.testing.assert_array_equal(whole.film.sums, alone.film.sums)
    np.testing.assert_array_equal(whole.film.planes(), alone.film.planes())
    if alone.film.moments is not None:
        np.testing.assert_array_equal(whole.film.moments.squares, alone.film.moments.squares)
        assert whole.film.moments.efficiency == alone.film.moments.efficiency
    assert whole.error.latest == alone.error.latest


@pytest.mark.slow
def test_what_is_lent_is_the_same():
    settings = with_values(Settings(), {**SMALL, "render.filter": "Mitchell-Netravali"})
    owner, lender = renderer(settings, 1), renderer(settings, 1)
    for index in (2, 0, 1):
        own, lent = owner.increment(index), lender.increment(index, lent=True)
        np.testing.assert_array_equal(lent.sums, own.sums)
    assert lender.increment(0, lent=True).sums is lender.increment(1, lent=True).sums


@pytest.mark.parametrize(
    "values",
    [
        {"estimate.radius_rule": "pixel"},
        {"render.adaptive": "on"},
        {"importance.map": "screen", "importance.emission": "Peter-Pietrek"},
    ],
)
def test_passes_that_need_those_before_are_refused(values):
    with pytest.raises(SettingError, match=f"{list(values)[-1]} = .* can't be rendered apart"):
        renderer(with_values(Settings(), {**SMALL, **values}), 1).increment(1)
