"""The bench of very many virtual lights: its targets read the right numbers."""

from __future__ import annotations

import pytest

from pmviewer.bench.measures.virtual_many import targets_of


def test_growth_is_told_by_the_light_and_spikes_by_the_choice():
    found = {
        (1_000, "even"): (0.1, 1.0, 0.3, 5.0),
        (1_000, "light tree"): (0.1, 2.0, 0.1, 2.0),
        (100_000, "even"): (14.0, 1.5, 0.3, 6.0),
        (100_000, "light tree"): (20.0, 5.0, 0.1, 2.0),
    }
    targets = {target.note: target for target in targets_of(found, "room", "unweighted")}
    even = targets["room, unweighted, even: CPU time of making a light, 100,000 over 1,000"]
    tree = targets["room, unweighted, light tree: CPU time of making a light, 100,000 over 1,000"]
    assert (even.value, even.ok) == (pytest.approx(1.4), True)
    assert tree.value == pytest.approx(2.0)
    assert targets["room, unweighted, light tree: eye pass with 100,000 lights over 1,000"].value == pytest.approx(2.5)
    spikes = targets["room, unweighted: 99.9th percentile of the error, even over light tree"]
    assert (spikes.value, spikes.ok) == (pytest.approx(3.0), True)
    assert not [t for t in targets_of(found, "room", "single step") if "percentile" in t.note], "it has no spikes"
