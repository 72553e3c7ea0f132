"""Both ways at glass: the same picture as by choosing one, with less noise."""

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import open_scene
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.stages.pass_data import blank_eye
from pmviewer.engine.store import StageStore
from pmviewer.render.planes import PLANES
from tests.support.scenes import GLASS, ball_in_environment, cornell_box, diffuse_box, settings_of


def renderer(scene, pool, splits, **render):
    settings = settings_of(render={"method": "progressive", "splits": splits, **render}, photons={"N": 2000})
    return Renderer(scene, settings, pool, StageStore(0))


def test_the_mean_is_that_of_choosing_one_way(pool):
    """What is seen in glass and mirrors, over 8 × 8 passes: alike within its error, and less noisy."""
    scene = open_scene(cornell_box(size=24))
    means, spreads = [], []
    for splits in (0, 2):
        runs = []
        for seed in range(8):
            one = renderer(scene, pool, splits, seed=seed)
            for _ in range(8):
                one.step()
            runs.append(one.film.planes()[..., PLANES["specular"]].astype(float))
        runs = np.array(runs)
        means.append(runs.mean(axis=(1, 2, 3)))
        spreads.append(runs.var(axis=0, ddof=1).sum())
    choosing, both = means
    error = np.sqrt((choosing.var(ddof=1) + both.var(ddof=1)) / len(both))
    assert both.mean() == pytest.approx(choosing.mean(), abs=4 * error)
    assert 4 * error < 0.15 * both.mean()
    assert spreads[1] < 0.8 * spreads[0]


def test_a_clear_ball_shows_its_surroundings_as_they_are(pool):
    """Radiance 1 all around: what both ways and roulette bring adds up to 1."""
    one = renderer(open_scene(ball_in_environment(GLASS)), pool, 2)
    for _ in range(16):
        one.step()
    assert one.frame(0).beauty.mean() == pytest.approx(1.0, abs=0.01)


def test_what_has_no_smooth_glass_is_compiled_without(pool):
    for scene, splits, compiled in ((cornell_box(), 2, True), (cornell_box(), 0, False), (diffuse_box(), 2, False)):
        one = renderer(open_scene(scene), pool, splits)
        assert ("splits" in blank_eye(one.settings, one.plan).dtype.names) == compiled
    traits = open_scene(diffuse_box()).traits
    assert inactive_reason("render.splits", settings_of(), traits) == "No smooth glass in this scene."
    of_path = settings_of(render={"method": "path"})
    assert "one way" in inactive_reason("render.splits", of_path, open_scene(cornell_box()).traits)
