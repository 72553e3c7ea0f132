"""A region of interest: inside the picture of a whole render, outside that of its first pass."""

from __future__ import annotations

import numpy as np
import pytest

import pmviewer
from pmviewer.engine.stages.eye import _tiled
from pmviewer.errors import PictureWarning
from pmviewer.settings.schema.region import Region

SIZE = {"camera.width": 24, "camera.height": 20, "photons.N": 2000}
REGION = {"region.left": 0.25, "region.right": 0.5, "region.top": 0.5, "region.bottom": 0.9}


@pytest.mark.parametrize("filtered", ["box", "Mitchell-Netravali"])
def test_inside_all_passes_outside_the_first(filtered):
    scene = pmviewer.open("cornell_caustic")
    scene.set({**SIZE, "render.filter": filtered})
    first, third = (scene.render(passes=n).beauty.copy() for n in (1, 2))  # more each time
    scene.set({"region.on": True, **REGION})
    with pytest.warns(PictureWarning, match="region"):
        seen = scene.render(passes=3).beauty
    inside = np.zeros((20, 24), bool)
    inside[10:18, 6:12] = True
    same = (seen == third).all(axis=-1)
    alike = np.isclose(seen, first, rtol=1e-5, atol=1e-7).all(axis=-1)
    assert same[inside].all()
    assert alike[~inside].all()
    assert np.isclose(third, first, rtol=1e-2).all(axis=-1)[~inside].mean() < 0.2, "they can be told from each other"


def test_every_pixel_is_in_one_task():
    spans = (7, 12), (27, 32), (100, 200), (300, 301)
    tasks = _tiled(spans, 16)
    parts = [part for task in tasks for part in task]
    assert [i for a, b in parts for i in range(a, b)] == [i for a, b in spans for i in range(a, b)]
    assert max(sum(b - a for a, b in task) for task in tasks) <= 16
    quarters = [[(at, at + 4)] for at in range(48, 64, 4)]
    assert _tiled(((0, 64),), 16) == [[(0, 16)], [(16, 32)], [(32, 48)], *quarters]


def test_a_region_has_a_pixel_at_least_whichever_end_comes_first():
    assert Region(left=0.5, right=0.25, top=0.9, bottom=0.5).pixels(24, 20) == (6, 10, 12, 18)
    assert Region(left=1.0, right=1.0, top=0.0, bottom=0.0).pixels(24, 20) == (23, 0, 24, 1)
