"""From the command to the window and to the first picture (P10): cold (compiling), warm, from a second clone, and what
the first clicks cost after `pmviewer compile`."""

from __future__ import annotations

import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pmviewer.bench.report import BenchResult, Target
from pmviewer.bench.screen import probe, screen
from pmviewer.errors import PmviewerError
from pmviewer.installing import to_bytecode
from pmviewer.resources import data_folder

SCENE = "cornell_caustic"
PACKAGE = Path(__file__).resolve().parents[2]


def run(quick: bool = False) -> BenchResult:
    """Start the real window in processes of its own; a cold start gets an empty kernel cache, and the bytecode that
    `pmviewer.launch` has made of the sources. `quick` leaves out the clicks, which take minutes to compile."""
    rows: list[list[str | float | int]] = []
    warm_window, warm_image = [], []
    with screen() as environment, tempfile.TemporaryDirectory(prefix="pmviewer-bench-") as folder:
        environment["PMVIEWER_CACHE"] = str(Path(folder, "cache"))
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # users' second start finds what the first has translated
        to_bytecode(Path(sys.executable), PACKAGE)
        cold = _start(environment)
        rows.append(["cold", *cold])
        for _ in range(2 if quick else 5):
            window, image = _start(environment)
            rows.append(["warm", window, image])
            warm_window.append(window)
            warm_image.append(image)
        clone = _start(environment, _clone(Path(folder, "clone")))
        rows.append(["second clone", *clone])
        clicks = [] if quick else _clicks(environment)
    targets = [
        Target("P10", cold[0], 1.0, "s", False, "cold: window"),
        Target("P10", cold[1], 12.0, "s", False, "cold: first picture; the launcher has translated the sources"),
        Target("P10", statistics.median(warm_window), 1.0, "s", False, "warm: window"),
        Target("P10", statistics.median(warm_image), 1.5, "s", False, "warm: first picture"),
        Target("P10", clone[1], 3.0, "s", False, "second clone: first picture"),
    ]
    for text, seconds, compiling in clicks:
        rows.append([f"click: {text or 'none'}", compiling, seconds])
    if clicks:
        longest = max(compiling for _, _, compiling in clicks)
        targets.append(Target("P10", longest, 1.0, "s", False, "longest compiling for a click"))
    heading = ["start", "window s (clicks: compiling s)", "first picture s"]
    return BenchResult(f"Start on {SCENE}", heading, rows, targets)


def _start(environment: dict[str, str], folder: Path | None = None) -> tuple[float, float]:
    before = time.monotonic()
    result = probe(environment, SCENE, "start", folder=folder)
    return result["window"] - before, result["coarse"] - before


def _clone(folder: Path) -> Path:
    """A second checkout as Python sees one: the package with what it reads."""
    shutil.copytree(PACKAGE, folder / PACKAGE.name, ignore=shutil.ignore_patterns("__pycache__"))
    to_bytecode(Path(sys.executable), folder / PACKAGE.name)
    (folder / "pyproject.toml").touch()  # marks a checkout
    shutil.copytree(data_folder("shaders"), folder / "shaders")
    shutil.copytree(data_folder("scenes") / SCENE, folder / "scenes" / SCENE)
    return folder


def _clicks(environment: dict[str, str]) -> list[tuple[str, float, float]]:
    """What is clicked, seconds to the first picture and those of compiling, once all is compiled ahead."""
    for module, *words in (["pmviewer", "compile"], ["pmviewer.bench.measures.start_clicks"]):
        command = [sys.executable, "-m", module, *words]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise PmviewerError(f"Compiling ahead failed: {done.stderr.strip()[-400:]}")
    told = [json.loads(line) for line in done.stdout.splitlines()]
    return [(each["click"], each["seconds"], each["compiling"]) for each in told]
