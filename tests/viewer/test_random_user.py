"""A user who does anything, for a while; `pmviewer bench actions` lets three of them loose for a thousand actions."""

from __future__ import annotations

import pytest

from pmviewer.viewer.random_user import let_loose


@pytest.mark.extensive
@pytest.mark.slow
@pytest.mark.parametrize("seed", [7])
def test_random_actions_break_nothing_and_are_undone_to_the_same_picture(tmp_path, monkeypatch, seed):
    monkeypatch.chdir(tmp_path)
    report = let_loose("cornell_caustic", seed, 40, tmp_path)
    assert report.wrong == []
    assert (report.actions, report.rounds) == (40, 1)
    assert sum(report.counts.values()) == 40
    assert report.frames > 10
