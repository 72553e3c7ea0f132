"""Comparisons of `bench agree` that tests make up."""

from __future__ import annotations

from pmviewer.bench.agree.statistics import Outcome
from pmviewer.bench.agree.trial import STAGES
from pmviewer.bench.agree.verdict import Comparison


def comparison(
    method: str, p: float, ratio: float = 1.2, peer_name: str = "Mitsuba path", known: str = ""
) -> Comparison:
    """Of a method's picture with another's, at the last stage."""
    return Comparison(method, peer_name, "picture", Outcome(p, ratio, 0.01, 51), len(STAGES), True, known)
