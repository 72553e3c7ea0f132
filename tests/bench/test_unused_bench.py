"""What `bench unused` says by hand of what scenes need."""

from __future__ import annotations

import pytest

from pmviewer.bench.measures.unused import NEEDS, stripped_plan
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import open_scene
from pmviewer.settings.access import Settings


@pytest.mark.parametrize("name", ["cornell_diffuse", "cornell_caustic", "cornell_lights", "museum"])
def test_it_is_what_the_program_finds_out(name):
    """Otherwise the pictures differ, and their times compare nothing."""
    by_hand, found = stripped_plan(NEEDS[name]), plan_of(Settings(), open_scene(name).traits)
    for what in ("running", "choice", "light_samples", "mirror_rays", "caustic_mask", "global_mask", "direct_mask"):
        assert getattr(by_hand, what) == getattr(found, what), what
