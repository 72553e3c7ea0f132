"""What was found out about a scene. Imports nothing that renders: it passes between processes."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pmviewer.bench.agree.statistics import Outcome


DIED = "the process died"
"""Why a scene was refused that ended the process which tried it."""


@dataclass(frozen=True)
class Comparison:
    """`method` against `peer` in `what`; the outcome of the last stage that was needed, counted from 1. `final`:
    whether it may be a disagreement, because all stages were suspicious or path tracers differ beyond doubt. `known`:
    the known deviation that it comes from, if it does."""

    method: str
    peer: str
    what: str
    outcome: Outcome
    stage: int
    final: bool
    known: str = ""

    @property
    def p(self) -> float:
        """Chance of the difference where there is none; 1 where it is gone after another look."""
        return self.outcome.p if self.final else 1.0


@dataclass(frozen=True)
class Verdict:
    """Comparisons of a scene. `refused`: why a program could not open it."""

    comparisons: list[Comparison] = field(default_factory=list)
    refused: str = ""
    lit: float = 0.0
