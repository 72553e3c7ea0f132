"""Settings that are said to have no effect: the sentence comes for every combination, and is true."""

from __future__ import annotations

import random
from typing import Any

import numpy as np
import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import SettingError
from pmviewer.output.diagnostic_views import DIAGNOSTICS, HELD_WHILE_SHOWN
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import SETTINGS, SettingInfo, Settings, get, with_values
from pmviewer.settings.schema.display import MAP_VIEWS, VIEW_NEEDS
from tests.support.scenes import cornell_box

SMALL = {"photons.N": 400, "importance.N": 400, "direct.shadow_N": 400, "estimate.radius": 0.2}
PICTURES: dict[str, dict[str, object]] = {
    "path": {"render.method": "path"},
    "progressive": {},
    "gather": {"render.method": "gather"},
    "nearest": {"estimate.lookup": "nearest", "photons.renew": "once"},
    "constant density": {"importance.deposition": "constant density"},
}


@pytest.fixture(scope="module")
def box() -> OpenScene:
    return open_scene(cornell_box(size=8))


def other_values(info: SettingInfo, value: Any) -> list[Any]:
    """Values that differ from this one, at both ends of what is allowed."""
    if info.choices:
        found: list[Any] = list(info.choices)
    elif info.kind is bool:
        found = [not value]
    elif info.lower is not None and info.upper is not None:
        found = [info.kind(min(max(end, info.lower), info.upper)) for end in (info.lower, 3 * info.lower, 0.5)]
    else:
        found = []
    return [each for each in found if each != value]


def film(box: OpenScene, settings: Settings, pool: WorkPool) -> np.ndarray:
    renderer = Renderer(box, settings, pool, StageStore(0))
    renderer.step()
    renderer.step()
    return renderer.film.planes()


@pytest.mark.parametrize("picture", PICTURES)
def test_what_has_no_effect_changes_no_picture(picture, box):
    settings = with_values(Settings(), SMALL | PICTURES[picture])
    pool = WorkPool(2)
    try:
        plain = film(box, settings, pool)
        silent = [path for path in SETTINGS if inactive_reason(path, settings, box.traits) is not None]
        assert len(silent) > 40
        values: dict[str, Any] = {}
        for path in silent:
            if SETTINGS[path].stage in ("photons", "maps", "image") and (
                others := other_values(SETTINGS[path], get(settings, path))
            ):
                alone = with_values(settings, {path: others[0]})
                if inactive_reason(path, alone, box.traits) is not None:
                    values[path] = others[0]
        assert len(values) > 15
        np.testing.assert_array_equal(film(box, with_values(settings, values), pool), plain, str(values))
    finally:
        pool.close()


def test_every_need_can_be_judged():
    """For settings and scenes drawn at random: a sentence or nothing, whatever the method."""
    rng = random.Random(5)
    names = [*SETTINGS, *(f"display.view={view}" for view in SETTINGS["display.view"].choices)]
    told: set[str] = set()
    for _ in range(60):
        values = {}
        for path, info in SETTINGS.items():
            others = other_values(info, info.default)
            if info.stage != "scene" and others and rng.random() < 0.5:
                values[path] = rng.choice(others)
        settings = with_values(Settings(), values)
        traits = SceneTraits(*(rng.random() < 0.5 for _ in range(4)), rng.choice((0, 1, 20)), rng.random() < 0.5)
        for path in names:
            reason = inactive_reason(path, settings, traits)
            assert reason is None or reason.endswith(".")
            told.add(reason or "")
    assert len(told) > 50


def test_no_scene_no_reason_and_unknown_settings_are_named():
    assert inactive_reason("estimate.k", Settings(), None) is None
    traits = SceneTraits(False, True, False, False, 1)
    assert inactive_reason("estimate.k", Settings(), traits) == "Only with look-up 'nearest'."
    with pytest.raises(SettingError, match=r"estimate\.q"):
        inactive_reason("estimate.q", Settings(), traits)


def test_the_schema_knows_the_views():
    """What it declares of each and which show one map is what the table of views has."""
    assert tuple(VIEW_NEEDS) == HELD_WHILE_SHOWN
    of_a_map = {"look-up", "importance", "density", "storing"}
    assert tuple(name for name, view in DIAGNOSTICS.items() if view.family in of_a_map) == MAP_VIEWS
