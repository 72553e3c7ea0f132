"""Corners of Mitsuba's conventions: which side of a surface is its outside, and which way mapped normals lean.

The expectation was rendered by Mitsuba 3 (tests/scene/mitsuba_conventions/record.py) and is recorded as block means
with their standard errors; each picture is tested against it by Welch's t-test, as `pmviewer bench mitsuba` does.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from tests.support.scenes import settings_of

pytestmark = pytest.mark.usefixtures("every_surface")

FOLDER = Path(__file__).parents[1] / "scene" / "mitsuba_conventions"
EXPECTED = json.loads((FOLDER / "expected.json").read_text("utf-8"))
SCENES = EXPECTED["scenes"]
PATH, PHOTONS = (16, 4), (8, 4)
"""Runs and passes of each. Many short runs: of eight the spread is known so badly that Student's t has to be 13 before
a block counts as wrong, of sixteen 7. Half of the blocks may be off by no more than 0.6 % (mirrored_mesh_own_normals)
to 7 % (bumpmap_on_metal; 34 % where smooth_mesh_light_inside_out is lit by few paths)."""
SIGNIFICANCE = 1e-4
ROUNDING = 1e-5
"""Relative: six digits are recorded."""
RADIUS = 0.01
"""Of the scene's: what a look-up blurs must be less than the noise."""


def block_runs(name, method, runs, passes):
    """(runs, blocks) means over blocks and channels of pictures with different seeds."""
    opened = open_scene(str(FOLDER / f"{name}.xml"))
    pool = WorkPool()
    rows = []
    try:
        for seed in range(1, runs + 1):
            values = {"render": {"method": method, "seed": seed}, "estimate": {"radius": RADIUS}}
            renderer = Renderer(opened, settings_of(**values), pool, StageStore(0))
            for _ in range(passes):
                renderer.step()
            image = renderer.frame(0).image().astype(np.float64)
            h, w, _ = image.shape
            b = EXPECTED["block"]
            rows.append(image.reshape(h // b, b, w // b, b, 3).mean(axis=(1, 3, 4)).reshape(-1))
    finally:
        pool.close()
    return np.array(rows)


def p_value(ours, mean, error, runs, tolerance=0.0):
    """Probability of the largest difference beyond that share of a block, by chance (Šidák over blocks)."""
    mean, error = np.array(mean), np.array(error)
    a, b = ours.var(axis=0, ddof=1) / len(ours), error**2
    variance = np.maximum(a + b, 1e-60)
    freedom = np.maximum(variance**2 / np.maximum(a**2 / (len(ours) - 1) + b**2 / (runs - 1), 1e-130), 1.0)
    beyond = np.maximum(np.abs(ours.mean(axis=0) - mean) - tolerance * mean, 0.0)
    t = beyond / np.sqrt(variance + (ROUNDING * mean) ** 2)
    smallest = float(2 * student.sf(t, freedom).min())
    print(f"mean ratio {ours.mean() / mean.mean():.4f}, largest t {t.max():.2f}")
    return -np.expm1(len(t) * np.log1p(-min(smallest, 1 - 1e-16)))


def test_every_scene_has_an_expectation():
    assert {path.stem for path in FOLDER.glob("*.xml")} == set(SCENES)


@pytest.mark.parametrize("name", list(SCENES))
def test_path_tracer_shows_mitsubas_picture(name):
    expected = SCENES[name]
    ours = block_runs(name, "path", *PATH)
    assert p_value(ours, expected["mean"], expected["error"], EXPECTED["runs"]) > SIGNIFICANCE


@pytest.mark.extensive
@pytest.mark.parametrize("method", ["progressive", "gather"])
@pytest.mark.parametrize("name", ["bumpmap_on_metal", "smooth_mesh_light"])
def test_photon_methods_show_it_too(name, method):
    """Within one percent of a block, for what a look-up blurs."""
    expected = SCENES[name]
    ours = block_runs(name, method, *PHOTONS)
    assert p_value(ours, expected["mean"], expected["error"], EXPECTED["runs"], tolerance=0.01) > SIGNIFICANCE
