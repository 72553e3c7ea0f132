"""Every bench one after the other, within a time, and the report of what they found."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from pmviewer.bench.collected import Kept, load, revision, save
from pmviewer.bench.page import write_page
from pmviewer.bench.registry import BENCHES
from pmviewer.bench.report import BenchResult
from pmviewer.errors import SceneError

LIMIT, QUICK_LIMIT = 39.5 * 60.0, 14.5 * 60.0
"""Seconds for all; half a minute is left for starting, ending and the page."""
SHARE = 6.0
"""How much more than an equal part of what is left one bench may take."""
LEAST = 20.0
THEMSELVES = ("all", "report")
NEED_MORE = ("files",)
"""Benches of files that somebody has to name."""
LONG = (
    "actions", "agree", "auto", "checkpoint", "cluster", "combined", "deposition", "emission", "estimation", "gather",
    "hostile", "importance", "lens", "load", "media", "mitsuba", "preview", "series", "stress", "thin-glass", "unused",
    "virtual", "virtual-many",
)  # fmt: skip
"""Benches that take many minutes whole: all of them together are run quick, and the page says so."""
LAST = ("stress",)
"""Most of its time compiles kernels where nobody has before: it takes what the others leave."""
FOLDER = Path("bench-results")


def run(quick: bool = False, keep: Path | None = None) -> BenchResult:
    """Each bench in a process of its own, which ends when it takes too long; results go to the folder `keep`, the page
    of `bench report` too. `LONG` ones run quick; others do where the whole one has taken too long."""
    folder = keep or FOLDER
    names = sorted((name for name in BENCHES if name not in (*THEMSELVES, *NEED_MORE)), key=LAST.__contains__)
    end = time.monotonic() + (QUICK_LIMIT if quick else LIMIT)
    for number, name in enumerate(names):
        left = end - time.monotonic()
        if left < LEAST:
            save(folder, Kept(name, None, "not run: the time for all was over", 0.0, quick, revision()))
            continue
        print(f"{number + 1} of {len(names)}: {name} …", file=sys.stderr, flush=True)
        part = max(LEAST, SHARE * left / (len(names) - number))
        short = quick or name in LONG
        if not _one(name, folder, short, min(left, part)) and not short and end - time.monotonic() > LEAST:
            _one(name, folder, True, min(end - time.monotonic(), part))
    return _report(folder, names)


def report(quick: bool = False, folder: Path | None = None) -> BenchResult:
    """The page of what `bench all` kept in the folder. Raises SceneError where nothing is there."""
    return _report(folder or FOLDER, [name for name in BENCHES if name not in THEMSELVES])


def _report(folder: Path, names: list[str]) -> BenchResult:
    kept = load(folder, names)
    if not kept:
        raise SceneError("There are no results here.", folder, hint="pmviewer bench all makes some.")
    notes = [write_page(folder, kept)]
    rows: list[list[str | float | int]] = []
    targets = []
    for one in kept:
        found = list(one.result.targets) if one.result is not None else []
        held = sum(target.ok for target in found)
        rows.append([one.name, one.seconds, held, len(found) - held, one.failed])
        targets += found
    rows.append(["all", math.fsum(one.seconds for one in kept), sum(t.ok for t in targets),
                 sum(not t.ok for t in targets), ""])  # fmt: skip
    return BenchResult("All benches", ["bench", "seconds", "held", "short", "failed"], rows, targets, notes)


def _one(name: str, folder: Path, quick: bool, seconds: float) -> bool:
    """Run it, and end it with all that it has started after that time; whether it ended by itself."""
    command = [sys.executable, "-m", "pmviewer.bench.one", name, str(folder), "quick" if quick else "full"]
    (folder / f"{name}.json").unlink(missing_ok=True)
    started, late = time.monotonic(), False
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace", start_new_session=True
    )
    try:
        said = process.communicate(timeout=seconds)[1]
        why = "" if process.returncode == 0 else (said.strip().splitlines() or ["?"])[-1][:200]
    except subprocess.TimeoutExpired:
        why, late = f"ended after {seconds:.0f} s: it took too long", True
    finally:
        if process.poll() is None:
            _end(process)
    if why or not (folder / f"{name}.json").is_file():
        save(folder, Kept(name, None, why or "no result", time.monotonic() - started, quick, revision()))
    return not late


def _end(process: subprocess.Popen[str]) -> None:
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except (OSError, AttributeError):
        process.kill()
    process.communicate()
