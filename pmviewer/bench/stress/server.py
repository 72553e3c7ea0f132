"""Runs stress cases in a process of its own: `python -m pmviewer.bench.stress.server` answers line by line."""

from __future__ import annotations

import json
import os

from pmviewer.bench.guarded import requests
from pmviewer.bench.stress.answers import THREADS, answer_of


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
