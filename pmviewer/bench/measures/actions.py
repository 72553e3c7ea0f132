"""A thousand random actions in the real window, by three seeds: no error, nothing lost, memory as it was.

Every hundred actions everything is undone; settings and picture must then be those of the beginning, bit for bit. The
rounds compile what the actions ask for, and the code stays: beside the memory, of which the last round is compared with
the first and with the middle one, stands how many kernels were loaded.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from typing import Any

from pmviewer.bench.report import BenchResult, Target
from pmviewer.bench.screen import screen
from pmviewer.errors import PmviewerError

SCENE = "cornell_caustic"
SEEDS = (1, 2, 3)
ACTIONS, QUICK = 1000, 200
PATIENCE = 3600


def run(quick: bool = False) -> BenchResult:
    """A row a seed; what went wrong is listed below the table."""
    seeds, actions = (SEEDS[:1], QUICK) if quick else (SEEDS, ACTIONS)
    with screen() as environment:
        reports = [_user(environment, seed, actions) for seed in seeds]
    columns = [
        "seed",
        "actions",
        "rounds undone",
        "wrong",
        "frames",
        "seconds",
        "MiB first",
        "middle",
        "last",
        "growth",
        "kernels, middle",
        "kernels, last",
    ]
    rows: list[list[str | float | int]] = []
    growths = []
    for seed, report in zip(seeds, reports, strict=True):
        memory, kernels = report["resident"], report["kernels"]
        half = (len(memory) - 1) // 2
        first, middle, last = memory[0], memory[half], memory[-1]
        growths.append((last / first - 1, last / middle - 1))
        rows.append(
            [seed, report["actions"], report["rounds"], len(report["wrong"]), report["frames"], report["seconds"],
             first, middle, last, last / middle - 1, kernels[half], kernels[-1]]
        )  # fmt: skip
    wrong = [f"seed {seed}: {text}" for seed, report in zip(seeds, reports, strict=True) for text in report["wrong"]]
    targets = [
        Target("must show 1", len(wrong), 0, "errors, differences", False, f"{actions} actions each, all undone"),
        Target("must show 1", 100 * max(g[0] for g in growths), 5, "%", False, "memory, last round over the first"),
        Target(
            "must show 1", 100 * max(g[1] for g in growths), 5, "%", False, "memory, last round over the middle one"
        ),
    ]
    return BenchResult("Random actions in the window", columns, rows, targets, notes=wrong)


def _user(environment: dict[str, str], seed: int, actions: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="pmviewer-actions-") as folder:
        command = [sys.executable, "-m", "pmviewer.viewer.random_user", SCENE, str(seed), str(actions)]
        run = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False, timeout=PATIENCE, cwd=folder
        )
    lines = [line for line in run.stdout.splitlines() if "{" in line]
    if run.returncode != 0 or not lines:
        raise PmviewerError(f"The window ended with seed {seed}: {(run.stderr or run.stdout).strip()[-400:]}")
    report: dict[str, Any] = json.loads(lines[-1][lines[-1].index("{") :])
    return report
