"""Which radius the statistics and the status bar show."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from pmviewer.viewer.panels.statistics_panel import look_up_radius
from pmviewer.viewer.panels.status_bar import status_parts


def frame(lookup: str, **radii: float) -> SimpleNamespace:
    stored, dropped = dict.fromkeys(radii, 7), dict[str, int]()
    statistics = SimpleNamespace(
        passes=2, emitted=1000, stored=stored, radius=radii, rays=0, seconds=1.0, remaining=None, dropped=dropped
    )
    return SimpleNamespace(statistics=statistics, coarse=False, automatic={"estimate.lookup": lookup})


def test_the_nearest_photons_lie_within_it():
    """It bounds their search; in media it is the radius."""
    shown = frame("nearest", caustic=0.5, volume=0.25)
    assert [look_up_radius(shown, name) for name in ("global", "caustic", "volume")] == ["", "≤ 500 mm", "250 mm"]
    assert look_up_radius(frame("radius", caustic=0.5), "caustic") == "500 mm"


@pytest.mark.parametrize(
    ("radii", "said"),
    [({"caustic": 0.5, "global": 2.0}, "r ≤ 2 m"), ({"caustic": 0.5}, "r ≤ 500 mm"), ({"global": 0.0}, None)],
)
def test_the_status_bar_has_that_of_the_global_map_first(radii, said):
    comparison = SimpleNamespace(latest=lambda frame: None)
    parts = status_parts(SimpleNamespace(frame=frame("nearest", **radii), comparison=comparison))
    assert [part for part in parts if part.startswith("r ")] == [said] * (said is not None)
