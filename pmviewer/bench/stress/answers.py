"""What a process that runs stress cases says of each."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from pmviewer.bench.stress.lab import Case, Outcome, Row

THREADS = 2
"""Of a process, so that times mean the same everywhere."""


def answer_of(row: Row) -> dict[str, Any]:
    """All of a row but its case, for JSON."""
    return {**asdict(row.outcome), "seconds": row.seconds, "cpu": row.cpu, "memory": row.memory}


def row_of(case: Case, answer: dict[str, Any]) -> Row:
    """The row that became this answer."""
    answer = dict(answer)
    seconds, cpu, memory = (answer.pop(name) for name in ("seconds", "cpu", "memory"))
    return Row(case, Outcome(**{**answer, "said": tuple(answer["said"])}), seconds, cpu, memory)
