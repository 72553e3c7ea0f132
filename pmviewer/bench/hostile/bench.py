"""`pmviewer bench hostile`: thousands of hostile files opened under watch, and what went wrong."""

from __future__ import annotations

import contextlib
import queue
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from pmviewer.bench.guarded import Ended, Guarded, Limits
from pmviewer.bench.hostile.cases import Case, case, honest
from pmviewer.bench.hostile.judge import CPU_SECONDS, EXTRA_MEMORY, Finding, findings
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.pool import available_threads
from pmviewer.errors import SettingError

FILES, QUICK_FILES, SEED = 3000, 220, 1
LIMITS = Limits(cpu=1.5 * CPU_SECONDS, idle=10.0, memory=3 << 30)
"""Ended beyond these: longer than the bound, so that what is only a little too slow is told by its time."""
START = Limits(cpu=300.0, idle=60.0)
"""Of honest files: the first one compiles."""
KINDS = ("honest", "traceback", "time", "memory", "died", "internals", "long")


@dataclass(frozen=True)
class Trial:
    """A case by its number, and what was wrong."""

    index: int
    case: str
    format: str
    size: int
    outcome: str
    cpu: float
    memory: int
    findings: Sequence[Finding]


def run(quick: bool = False, scenes: int | None = None, seed: int = SEED, keep: Path | None = None) -> BenchResult:
    """Open `scenes` hostile files. `keep` gets the smallest file of each kind of finding. Raises SettingError."""
    count = (QUICK_FILES if quick else FILES) if scenes is None else scenes
    if count < 1:
        raise SettingError(f"hostile needs at least one file, found {count}.")
    started = time.perf_counter()
    trials = []
    for trial in tried(seed, range(count), every_special=not quick):
        trials.append(trial)
        if trial.findings or len(trials) % 250 == 0:
            said = "; ".join(f"{f.kind}, {f.detail}" for f in trial.findings)
            print(f"[{len(trials)}/{count}, {time.perf_counter() - started:.0f} s] {trial.index} {trial.case}: {said}",
                  file=sys.stderr, flush=True)  # fmt: skip
    trials.sort(key=lambda trial: trial.index)
    worst = smallest(trials)
    if keep is not None:
        for (finding, format_), trial in worst.items():
            if trial.index < 0:
                continue
            name = f"{format_}-{finding.kind}-{trial.index}".replace(" ", "_").replace(",", "")
            case(seed, trial.index, not quick).write(keep / name)
    return report(seed, trials, worst, time.perf_counter() - started)


def tried(seed: int, indices: Sequence[int], every_special: bool, workers: int | None = None) -> Iterator[Trial]:
    """Trials in the order in which they end: one process a worker for many files, started anew when it had to be
    ended. Honest files that don't open come first, with negative numbers: nothing is learnt from their mutations."""
    count = max(min(workers or available_threads(), len(indices)), 1)
    idle: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
    with tempfile.TemporaryDirectory(prefix="pmviewer-hostile-") as name, contextlib.ExitStack() as stack:
        folder = Path(name)
        all_workers = [_Worker(stack.enter_context(Guarded("pmviewer.bench.hostile.server"))) for _ in range(count)]
        yield from all_workers[0].warm_up(folder)
        memory = all_workers[0].memory
        for worker in all_workers:
            worker.memory = memory
            idle.put(worker)

        def one(index: int) -> Trial:
            worker = idle.get()
            try:
                made = case(seed, index, every_special)
                return worker.tried(index, made, made.write(folder / str(index)))
            finally:
                shutil.rmtree(folder / str(index), ignore_errors=True)
                idle.put(worker)

        with ThreadPoolExecutor(count) as pool:
            futures = [pool.submit(one, index) for index in indices]
            try:
                for future in as_completed(futures):
                    yield future.result()
            finally:
                pool.shutdown(wait=True, cancel_futures=True)


class _Worker:
    """A process that opens files. `memory`: what honest ones take, by name."""

    def __init__(self, server: Guarded) -> None:
        self._server, self._warm = server, False
        self.memory: dict[str, int] = {}

    def warm_up(self, folder: Path) -> list[Trial]:
        """Open all honest files twice, so that all is imported and compiled. Those that are refused."""
        refused = []
        for number, one in enumerate(honest(), start=1):
            path = one.write(folder / f"honest {number}")
            first, again = (self._server.ask({"path": str(path)}, START) for _ in range(2))
            self.memory[one.name] = min(first["memory"], again["memory"])
            if again["outcome"] != "scene":
                found = [Finding("honest", again["said"][0][:200])]
                refused.append(_trial(-number, one, again["outcome"], 0.0, 0, found))
        self._warm = True
        return refused

    def tried(self, index: int, made: Case, path: Path) -> Trial:
        """Open one hostile file."""
        if not self._warm:
            with tempfile.TemporaryDirectory(prefix="pmviewer-hostile-") as folder:
                self.warm_up(Path(folder))
        try:
            answer = self._server.ask({"path": str(path)}, LIMITS)
        except Ended as ended:
            self._warm = False
            kind = {"cpu": "time"}.get(ended.kind, ended.kind)
            return _trial(index, made, kind, LIMITS.cpu if ended.kind == "cpu" else 0.0, 0, [Finding(kind, str(ended))])
        found = findings(answer, self.memory.get(made.seed, 0))
        return _trial(index, made, answer["outcome"], answer["cpu"], answer["memory"], found)


def _trial(index: int, made: Case, outcome: str, cpu: float, memory: int, found: list[Finding]) -> Trial:
    return Trial(index, made.name, made.format, made.size, outcome, cpu, memory, found)


def smallest(trials: Sequence[Trial]) -> dict[tuple[Finding, str], Trial]:
    """Of each finding of a format the trial with the smallest files."""
    found: dict[tuple[Finding, str], Trial] = {}
    for trial in sorted(trials, key=lambda trial: (trial.size, trial.index)):
        for finding in trial.findings:
            found.setdefault((finding, trial.format), trial)
    return found


COLUMNS = ("format", "files", "open", "refused", *KINDS, "most CPU s", "most MiB")


def report(seed: int, trials: Sequence[Trial], worst: dict[tuple[Finding, str], Trial], seconds: float) -> BenchResult:
    """The table by format, the smallest file of each finding, and the targets."""
    rows = [_row(name, [t for t in trials if t.format == name]) for name in sorted({t.format for t in trials})]
    rows.append(_row("all", trials))
    notes = [
        f"{format_}, {finding.kind}: {finding.detail} (file {trial.index}, {trial.case}, {trial.size} bytes)"
        for (finding, format_), trial in sorted(worst.items(), key=lambda item: (item[0][1], item[0][0].kind))
    ]
    notes.append(f"{len(trials)} files of seed {seed}, {seconds:.0f} s")
    bad = [sum(any(f.kind == kind for f in t.findings) for t in trials) for kind in KINDS]
    about = ("honest files that do not open", "files that end in a traceback",
             f"files above {CPU_SECONDS:g} CPU seconds or without an answer",
             f"files above {EXTRA_MEMORY >> 30} GiB beyond the honest one", "files that end the process",
             "files whose messages show internals", "files with messages that nobody can read")  # fmt: skip
    targets = [Target(f"hostile {kind}", number, 0, "files", False, note)
               for kind, number, note in zip(KINDS, bad, about, strict=True)]  # fmt: skip
    return BenchResult("Hostile files", COLUMNS, rows, targets, notes)


def _row(name: str, trials: Sequence[Trial]) -> list[Cell]:
    outcomes = [sum(t.outcome == outcome for t in trials) for outcome in ("scene", "refused")]
    bad = [sum(any(f.kind == kind for f in t.findings) for t in trials) for kind in KINDS]
    most = max(trials, key=lambda t: t.cpu).cpu, max(t.memory for t in trials) / 2**20
    return [name, len(trials), *outcomes, *bad, *most]
