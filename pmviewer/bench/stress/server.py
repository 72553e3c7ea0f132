"""Runs stress cases in a process of its own: `python -m pmviewer.bench.stress.server` answers line by line."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from typing import Any

from pmviewer.bench.guarded import requests
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


def main() -> None:
    """Answer until standard input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    from pmviewer.bench.stress.lab import Lab, run_case
    from pmviewer.bench.stress.suite import all_cases
    from pmviewer.engine.pool import WorkPool

    lab, cases = Lab(WorkPool(THREADS)), all_cases()
    for request in requests():
        print(json.dumps(answer_of(run_case(lab, cases[request["case"]]))), file=answers, flush=True)


if __name__ == "__main__":
    main()
