"""Deposition rules over passes: right in the mean with both methods, and nothing of them while they are off."""

from __future__ import annotations

import numpy as np
import pytest

from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.scene.arrays.flatten import LUMINANCE
from tests.support import fresh
from tests.support.scenes import cornell_box, rendered, settings_of

SEEDS, PASSES = 12, 3
RULES = {
    "clamp": {"map": "screen", "deposition": "Keller-Wald", "f": 0.02, "epsilon": 0.1},
    "discard": {"map": "screen", "deposition": "Keller-Wald", "f": 0.02, "epsilon": 0.5, "cut_off": "discard"},
}


def indirect(scene, method, seed, **importance):
    """Mean luminance of indirect light and caustics, and photons stored, after some passes of shrinking radius."""
    settings = settings_of(
        render={"method": method, "seed": seed}, photons={"N": 3000}, importance={"N": 400, **importance}
    )
    renderer = rendered(scene, settings, PASSES)
    assert renderer.tally.radius["global"] < renderer.first_radius
    frame = renderer.frame(1)
    image = frame.image("indirect").astype(float) + frame.image("caustic")
    return float((image @ LUMINANCE).mean()), sum(renderer.tally.stored.values())


@pytest.mark.parametrize("method", ["progressive", "gather"])
def test_the_mean_over_passes_is_right(method):
    """Importance is refined from pass to pass and radii shrink: the clamped rule keeps the mean, discarding does not.
    Z-test over seeds, of differences to the picture with all photons of the same passes."""
    scene = open_scene(cornell_box(size=12))
    off, lost = [], []
    for seed in range(SEEDS):
        all_, stored = indirect(scene, method, seed)
        clamped, kept = indirect(scene, method, seed, **RULES["clamp"])
        assert kept < 0.7 * stored
        off.append(clamped / all_ - 1)
        lost.append(indirect(scene, method, seed, **RULES["discard"])[0] / all_ - 1)
    error = np.std(off, ddof=1) / np.sqrt(SEEDS)
    assert error < 0.02
    assert abs(np.mean(off)) < 3.5 * error
    assert np.mean(lost) < -0.03


@pytest.mark.parametrize("changed", [{"caustic_radius": 0.3}, {"radius": 0.05}])
def test_photons_kept_from_before_do_not_matter(changed):
    """The automatic constant density follows the radii of look-ups; photons stored for others are not taken."""
    scene, pool, cache = open_scene(cornell_box(size=8)), WorkPool(1), StageStore(1 << 26)
    made = []
    try:
        for estimate, kept in ({}, cache), (changed, cache), (changed, StageStore(0)):
            values = settings_of(
                photons={"N": 20_000},
                importance={"deposition": "constant density"},
                estimate={"radius": 0.1} | estimate,
            )
            renderer = Renderer(scene, values, pool, kept)
            renderer.step()
            made.append(renderer.light.photons.caustic)
    finally:
        pool.close()
    assert len(made[0]) != len(made[1])
    np.testing.assert_array_equal(made[1], made[2])


OFF = """
import numpy as np
from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.opened import open_scene
from pmviewer.viewer.panels.statistics_panel import photon_rows
from tests.support.scenes import cornell_box, rendered, settings_of
import pmviewer.importance.trace, pmviewer.importance.view, pmviewer.maps.convergence, pmviewer.maps.density.compare
import pmviewer.maps.density.control, pmviewer.maps.density.groups, pmviewer.maps.importance.facets
import pmviewer.maps.density.growing_tree, pmviewer.maps.importance.build, pmviewer.maps.importance.importance_map
import pmviewer.maps.importance.look_up, pmviewer.photons.deposition.depositor, pmviewer.photons.deposition.fates
from pmviewer import importance, maps, photons

MODULES = [
    importance.trace, importance.view, maps.convergence, maps.density.compare, maps.density.control,
    maps.density.groups, maps.density.growing_tree, maps.importance.build, maps.importance.facets,
    maps.importance.importance_map, maps.importance.look_up, photons.deposition.depositor, photons.deposition.fates,
]

scene = open_scene(cornell_box(size=8))
for method in ("progressive", "gather", "global map"):
    settings = settings_of(render={"method": method}, photons={"N": 500})
    pool = WorkPool(1)
    prepare(scene, settings, pool, lambda text, share: print(text))
    pool.close()
    renderer = rendered(scene, settings, 2)
    statistics = renderer.frame(1).statistics
    assert renderer.importance.latest is None and renderer.light.latest.rules.deposition is None
    assert not statistics.deposited and not statistics.importons and not statistics.warnings
    assert not {"importance", "deposition"} & set(statistics.stage_seconds)
    assert not [row for row in photon_rows(statistics) if "onverged" in row[0]]
    assert len(renderer.light.photons.sample) == len(renderer.light.photons.caustic_normals) == 0
for module in MODULES:
    for name, value in vars(module).items():
        if hasattr(value, "nopython_signatures") and value.__module__ == module.__name__:
            assert not value.nopython_signatures, (module.__name__, name)
print("nothing of it")
"""


def test_nothing_is_compiled_or_computed_while_off():
    """In a program of its own, because other tests of this one compile the rules."""
    done = fresh.python(OFF)
    assert "nothing of it" in done.stdout
    assert not [line for line in done.stdout.splitlines() if "importance" in line or "deposition" in line]
