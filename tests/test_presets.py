"""Presets: valid, alone in what they set, and without a value that does nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pmviewer.engine.effects import inactive_reason
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import SETTINGS, Settings, flat, get, with_values
from pmviewer.settings.presets import PRESETS, RESET

MANY_LIGHTS = replace(SceneTraits(True, True, False, False, 1), n_lights=20)


@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.name)
def test_a_preset_sets_ways_of_rendering_alone_whatever_was_set_before(preset):
    strange = {"photons.N": 77, "estimate.k": 3, "gather.rays": 7, "virtual.walks": 9, "importance.epsilon": 0.5}
    kept = {"camera.fov": 30.0, "render.seed": 5, "render.passes": 3, "display.view": "depth"}
    before = with_values(Settings(), strange | kept)
    after = with_values(before, preset.assignments())
    assert flat(after) == flat(with_values(with_values(Settings(), kept), dict(preset.values)))
    assert all(path.startswith(RESET) for path in preset.values)
    assert all(any(path.startswith(start) for path in SETTINGS) for start in RESET)
    assert preset.text.endswith(".")


@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.name)
def test_every_value_of_a_preset_has_an_effect(preset):
    settings = with_values(Settings(), preset.assignments())
    assert {p: r for p in preset.values if (r := inactive_reason(p, settings, MANY_LIGHTS))} == {}


def test_balanced_is_the_default_and_no_two_presets_are_alike():
    assert with_values(Settings(), PRESETS[1].assignments()) == Settings()
    assert len({repr(sorted(p.assignments().items())) for p in PRESETS}) == len(PRESETS)
    assert get(with_values(Settings(), PRESETS[2].assignments()), "render.method") == "path"
