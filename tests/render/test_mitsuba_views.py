"""What rays pass, colours at vertices, other views, lights that are not seen: Mitsuba 3's pictures are ours.

The expectation was rendered by Mitsuba 3 (tests/render/mitsuba_views/record.py): means over blocks of pixels and their
standard errors; each picture is tested against it by Welch's t-test.
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
from tests.render.mitsuba_views.scenes import VIEWS, description
from tests.support.scenes import settings_of


@pytest.fixture(autouse=True)
def kernels(request):
    """Those of scenes with anything, and for hidden lights those of `test_hidden_lights`."""
    if "hid" not in request.node.name:
        request.getfixturevalue("every_surface")


EXPECTED = json.loads((Path(__file__).parent / "mitsuba_views" / "expected.json").read_text("utf-8"))
PATH = (16, 4)
"""Runs and passes: of few runs the spread is known badly, and Student's t has to be large before a block counts as
wrong. Half of the blocks may be off by no more than 1.8 % (vertex_colours) to 8 % (veils_area)."""
SIGNIFICANCE = 1e-4


def block_runs(name, method, runs, passes):
    """(runs, blocks · 3) means over blocks of pictures with different seeds."""
    opened, pool, rows, b = open_scene(description(name)), WorkPool(), [], EXPECTED["block"]
    try:
        for seed in range(1, runs + 1):
            values = {"render": {"method": method, "seed": seed}, "estimate": {"radius": 0.01}}
            renderer = Renderer(opened, settings_of(photons={"N": 16_000}, **values), pool, StageStore(0))
            for _ in range(passes):
                renderer.step()
            image = renderer.frame(0).image().astype(np.float64)
            h, w, _ = image.shape
            rows.append(image.reshape(h // b, b, w // b, b, 3).mean(axis=(1, 3)).reshape(-1))
    finally:
        pool.close()
    return np.array(rows)


def check(name, method, runs, passes, tolerance):
    """All blocks agree within their noise and that share of a block, and the whole picture within one percent."""
    ours = block_runs(name, method, runs, passes)
    mean, error = (np.array(EXPECTED["scenes"][name][key]) for key in ("mean", "error"))
    rounding = (2e-5 * mean) ** 2  # six digits are recorded, and float32 sums of pixels that show the sky alone
    a, b = ours.var(axis=0, ddof=1) / runs + rounding, error**2 + rounding
    freedom = (a + b) ** 2 / (a**2 / (runs - 1) + b**2 / (EXPECTED["runs"] - 1))
    beyond = np.maximum(np.abs(ours.mean(axis=0) - mean) - tolerance * mean, 0.0)
    smallest = float(2 * student.sf(beyond / np.sqrt(a + b), freedom).min())
    ratio = ours.mean() / mean.mean()
    noise = np.sqrt((a + b).sum()) / mean.sum()
    print(f"{name} {method}: ratio {ratio:.4f} ± {noise:.4f}, p {smallest:.2g}")
    assert 1 - (1 - smallest) ** len(mean) > SIGNIFICANCE
    assert ratio == pytest.approx(1.0, abs=max(0.01, 3 * noise))


@pytest.mark.parametrize("name", list(VIEWS))
def test_path_tracer(name):
    check(name, "path", *PATH, 0.0)


@pytest.mark.extensive
@pytest.mark.parametrize(
    ("name", "method"), [("veils_area", "progressive"), ("veils_sky", "gather"), ("orthographic", "progressive")]
)
def test_photon_methods(name, method):
    """Within two percent of a block, for what look-ups blur along edges. Each pair compiles kernels of its own."""
    check(name, method, 6, 24, 0.02)


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_photon_methods_hide_lights(method):
    check("hidden_lights", method, 6, 12, 0.02)
