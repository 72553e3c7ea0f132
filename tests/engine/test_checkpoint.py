"""A renderer whose state was written and read goes on bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pmviewer.engine.checkpoint.checkpoint import Job, read_checkpoint, write_checkpoint
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.settings.access import Settings, with_values

BEFORE, ALL = 3, 5
"""Passes when the checkpoint is written, and in all: the error is estimated anew in between."""
SMALL = {"camera.width": 20, "camera.height": 16, "photons.N": 3000, "gather.rays": 4}
TIMES = ("seconds", "cpu_seconds", "stage_seconds")


def renderer(scene: str, values: dict, threads: int = 1) -> Renderer:
    """A new one, with nothing kept of another."""
    settings = with_values(Settings(), {**SMALL, **values})
    return Renderer(open_scene(scene), settings, WorkPool(threads), StageStore(0))


def resumed(path: Path, scene: str, values: dict, passes: int = BEFORE) -> Renderer:
    """After so many passes and a checkpoint in the hands of another renderer."""
    first = renderer(scene, values, 2)
    for _ in range(passes):
        first.step()
    write_checkpoint(path, first, Job(scene))
    other = renderer(scene, values)
    found = read_checkpoint(path)
    assert found.check(other) == ""
    found.resume(other)
    return other


def counts(of: Renderer) -> dict:
    """All that is counted but times."""
    return {name: value for name, value in of.tally.state().numbers.items() if name not in TIMES}


WAYS = {
    "as it comes": ("cornell_caustic", {}),
    "signed filter": ("cornell_caustic", {"render.filter": "Mitchell-Netravali", "importance.map": "footprint"}),
    "radii of pixels": ("cornell_caustic", {"estimate.radius_rule": "pixel"}),
    "gather, region": (
        "cornell_caustic",
        {"render.method": "gather", "region.on": True, "region.right": 0.6, "region.bottom": 0.5},
    ),
    "guided gather rays": ("cornell_caustic", {"render.method": "gather", "gather.directions": "photon cones"}),
    "virtual lights": ("cornell_caustic", {"render.method": "virtual lights", "virtual.normalisation": "per object"}),
    "path": ("cornell_caustic", {"render.method": "path"}),
    "photons once": ("cornell_caustic", {"photons.renew": "once"}),
    "guided emission": (
        "cornell_caustic",
        {"importance.map": "average", "importance.emission": "Christensen keep", "photons.N": 40_000},
    ),
    "many lights": ("cornell_lights", {"direct.choice": "Keller-Wald"}),
    "media": ("fog_sphere", {}),
}


@pytest.mark.slow
@pytest.mark.usefixtures("any_light_in_media")
@pytest.mark.parametrize(("scene", "values"), WAYS.values(), ids=WAYS.keys())
def test_going_on_is_as_never_having_stopped(scene, values, tmp_path):
    whole, other = renderer(scene, values, 2), resumed(tmp_path / "a.checkpoint", scene, values)
    for _ in range(BEFORE):
        whole.step()
    assert counts(other) == counts(whole)
    if whole.light.photons is not None and values.get("photons.renew") != "once":
        np.testing.assert_array_equal(other.light.photons.global_, whole.light.photons.global_)
    for _ in range(BEFORE, ALL):
        whole.step()
        other.step()
    assert whole.film.sums.any()
    assert other.film.sums.tobytes() == whole.film.sums.tobytes()
    mine, others = whole.film.radii, other.film.radii
    assert (mine is None) == (others is None)
    assert mine is None or mine.tobytes() == others.tobytes()
    assert counts(other) == counts(whole)
    assert other.error.latest == whole.error.latest
    one, two = whole.frame(1), other.frame(1)
    assert one.planes.tobytes() == two.planes.tobytes()
    assert one.exposure == two.exposure
    assert one.statistics.remaining == two.statistics.remaining
    noise, there = whole.film.moments, other.film.moments
    assert (noise is None) == (there is None)
    assert noise is None or noise.relmse() == there.relmse()
    assert one.automatic == two.automatic
    assert one.statistics.warnings == two.statistics.warnings
