"""`pmviewer bench files FOLDER`: every file below a folder opened, looked at, and compared with Mitsuba 3."""

from __future__ import annotations

import queue
import random
import re
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import numpy as np

from pmviewer.bench import peer
from pmviewer.bench.files.judge import JUDGEMENTS, NOISE_BOUND, Row
from pmviewer.bench.files.sheet import write_sheet
from pmviewer.bench.files.store import THEIRS, Store
from pmviewer.bench.files.survey import STATES, Survey, candidates, surveys
from pmviewer.bench.guarded import Ended, Guarded, Limits
from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.pool import available_threads
from pmviewer.errors import SettingError
from pmviewer.output.files import check_target

LONGEST = 96
"""Pixels of the longer side."""
MAX_DEPTH = 8
"""Scatterings of both path tracers; Mitsuba counts one more."""
MEDIA_DEPTH = 96
"""The same where there are media: next to nothing is cut off, as Mitsuba doesn't count what passes thin glass."""
TIRED = 2 << 30
"""Bytes that a process may hold between two files: what was compiled for many of them must not count for the next."""
PASSES = 4
"""Of the default method's picture."""
NOISE = 0.003
"""Relative standard error of a side's mean that is enough: together less than half of `NOISE_BOUND`."""
EFFORT, QUICK_EFFORT = 8.0, 2.0
"""CPU seconds of a path tracer after which the noise is what it is."""
LIMITS = Limits(cpu=120, idle=600, memory=6 << 30)
"""Idle for long is who waits for a function that another process compiles, which on a busy machine takes minutes."""
OPENS, RIGHT = 0.95, 1.0
QUICK_FILES = 40
NICE = 10
COLUMNS = ("file", "loads", "seconds", "triangles", "warnings", "luminance", "black", "R", "G", "B", "noise", "default",
           "judgement")  # fmt: skip


def run(
    folder: Path | None = None,
    quick: bool = False,
    scenes: int | None = None,
    seed: int = 1,
    json: Path | None = None,
    sheet: Path | None = None,
) -> BenchResult:
    """Try all complete files below `folder`, or `scenes` of them drawn by `seed`.

    `json` keeps every result as soon as it is there, and takes over those that hold still; `sheet` gets the pictures.
    Raises SettingError for a folder without scene files, OutputError for files that can't be written.
    """
    if folder is None or not folder.is_dir():
        raise SettingError("The bench 'files' needs a folder of scene files: pmviewer bench files FOLDER.")
    for path, endings in ((json, (".json", ".jsonl")), (sheet, (".png",))):
        if path is not None:
            check_target(path, endings)
    started = time.perf_counter()
    found = surveys(candidates(folder))
    chosen = drawn([p for p, s in found.items() if s.state == "complete"], scenes or (QUICK_FILES if quick else None),
                   seed)  # fmt: skip
    if not chosen:
        raise SettingError(f"{folder} holds no complete scene file.")
    effort = QUICK_EFFORT if quick else EFFORT
    store = Store(json, f"{LONGEST} {MAX_DEPTH} {MEDIA_DEPTH} {NOISE} {effort} {PASSES}")
    rows = []
    for row in tried(chosen, folder, store, effort):
        rows.append(row)
        _tell(row, len(rows), len(chosen), time.perf_counter() - started)
    rows.sort(key=lambda row: row.file)
    if sheet is not None:
        write_sheet(sheet, rows)
    return report(folder, rows, found, time.perf_counter() - started)


def drawn(paths: Sequence[Path], count: int | None, seed: int) -> list[Path]:
    """`count` of the paths, from folder to folder so that no large collection stands for all; all if None."""
    if count is None or count >= len(paths):
        return list(paths)
    chance = random.Random(seed)
    by_folder: dict[Path, list[Path]] = {}
    for path in paths:
        by_folder.setdefault(path.parent, []).append(path)
    groups = list(by_folder.values())
    chance.shuffle(groups)
    for group in groups:
        chance.shuffle(group)
    chosen: list[Path] = []
    while len(chosen) < count:
        groups = [group for group in groups if group]
        chosen += [group.pop() for group in groups[: count - len(chosen)]]
    return sorted(chosen)


def _tell(row: Row, done: int, count: int, seconds: float) -> None:
    ratio = " ".join(f"{v:.3f}" for v in row.ratio) if row.compared else ""
    said = row.crash.strip().splitlines()[-1] if row.crash else row.error or ratio or row.refused[:80]
    print(f"[{done}/{count}, {seconds:.0f} s] {row.file}: {row.judgement} {said}", file=sys.stderr, flush=True)


def tried(paths: Sequence[Path], folder: Path, store: Store, effort: float) -> Iterator[Row]:
    """A row for each file in the order in which they are through, several at a time."""
    helpers = [_Helpers() for _ in range(max(min(available_threads(), len(paths)), 1))]
    idle: queue.SimpleQueue[_Helpers] = queue.SimpleQueue()
    for one in helpers:
        idle.put(one)

    def work(path: Path) -> Row:
        mine = idle.get()
        try:
            return _one(path, path.relative_to(folder).as_posix(), store, effort, mine)
        finally:
            mine.ours.renew(TIRED)
            idle.put(mine)

    with ThreadPoolExecutor(len(helpers)) as pool:
        futures = [pool.submit(work, path) for path in paths]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
            for one in helpers:
                one.close()


class _Helpers:
    """A worker's two processes."""

    def __init__(self) -> None:
        self.ours = Guarded("pmviewer.bench.files.ours", nice=NICE)
        self.mitsuba = Guarded("pmviewer.bench.agree.mitsuba_server", nice=NICE)

    def close(self) -> None:
        """End both."""
        self.ours.close()
        self.mitsuba.close()


_keeping = threading.Lock()


def _one(path: Path, name: str, store: Store, effort: float, helpers: _Helpers) -> Row:
    if (known := store.row(name, path)) is not None:
        return known
    row = Row(name, "complete")
    _load(row, path, helpers)
    if row.opens:
        if path.suffix.lower() == ".xml" and peer.installed():
            _theirs(row, path, store.theirs(name, path), effort, helpers)
        _picture(row, path, effort, helpers)
    with _keeping:
        store.keep(row, path)
    return row


def _asked(helper: Guarded, request: dict[str, Any]) -> dict[str, Any]:
    try:
        return helper.ask(request, LIMITS)
    except Ended as ended:
        return {"crash": str(ended)}


def _load(row: Row, path: Path, helpers: _Helpers) -> None:
    answer = _asked(helpers.ours, {"do": "load", "path": str(path)})
    row.error, row.crash = answer.get("error", ""), answer.get("crash", "")
    if row.opens:
        row.seconds, row.triangles, row.warnings = answer["seconds"], answer["triangles"], answer["warnings"]
        row.sizes = [answer["size"]]


def _theirs(row: Row, path: Path, known: dict[str, Any] | None, effort: float, helpers: _Helpers) -> None:
    if known is not None:
        for key in THEIRS:
            setattr(row, key, known[key])
        row.sizes += known["sizes"][1:]
        return
    answer = _asked(
        helpers.mitsuba,
        {"mode": "file", "path": str(path), "longest": LONGEST, "max_depth": MAX_DEPTH + 1,
         "media_depth": MEDIA_DEPTH + 1, "noise": NOISE, "cpu": effort},
    )  # fmt: skip
    row.refused = answer.get("error") or answer.get("crash", "")
    if not row.refused:
        row.theirs, row.adapted, row.media = answer["means"], answer["adapted"], answer["media"]
        row.sizes += [answer["size"], *([answer["file_size"]] if answer["file_size"] else [])]


def _picture(row: Row, path: Path, effort: float, helpers: _Helpers) -> None:
    size = row.sizes[1] if len(row.sizes) > 1 else None
    answer = _asked(
        helpers.ours,
        {"do": "picture", "path": str(path), "longest": LONGEST, "size": size, "passes": PASSES,
         "paths": bool(row.theirs), "max_depth": MEDIA_DEPTH if row.media else MAX_DEPTH, "noise": NOISE,
         "cpu": effort},
    )  # fmt: skip
    row.error, row.crash = answer.get("error", ""), answer.get("crash", "")
    if row.opens:
        row.luminance, row.grey, row.dark = answer["luminance"], answer["grey"], answer["dark"]
        row.default, row.png, row.ours = answer["default"], answer["png"], answer.get("means", [])
        row.warnings += [text for text in answer["said"] if text not in row.warnings]


def report(folder: Path, rows: list[Row], found: dict[Path, Survey], seconds: float) -> BenchResult:
    """The table, what was said how often, and the targets."""
    opened = [row for row in rows if row.opens]
    both = [row for row in rows if row.compared]
    compared = [row for row in both if row.judgement != "noisy"]
    right = [row for row in compared if row.judgement in ("agrees", "said")]
    refused = sum(bool(row.refused) for row in opened)
    targets = [
        Target("files open", len(opened) / len(rows), OPENS, "", True,
               f"{len(opened)} of {len(rows)} complete files tried"),
    ]  # fmt: skip
    if compared:
        agree = sum(row.judgement == "agrees" for row in compared)
        note = f"{agree} within 2 % of Mitsuba 3, {len(right) - agree} that warn of something (read the rows), "
        note += f"of {len(compared)} that both render; {len(both) - len(compared)} too noisy to tell"
        targets.append(Target("files right", len(right) / len(compared), RIGHT, "", True, note))
    targets.append(
        Target("files crash", sum(bool(row.crash) for row in rows), 0, "", False, "tracebacks, hangs, memory")
    )
    return BenchResult(f"Files below {folder}", COLUMNS, [_cells(row) for row in rows], targets,
                       [*_notes(rows, found), f"Mitsuba 3 renders {len(both)} of the XML files that open, refuses "
                        f"{refused}; {LONGEST} pixels, {MAX_DEPTH} scatterings "
                        f"({MEDIA_DEPTH} with media); {seconds:.0f} s in all"])  # fmt: skip


def _cells(row: Row) -> list[Cell]:
    loads = "yes" if row.opens else _short(row.crash.strip().splitlines()[-1] if row.crash else row.error, 70)
    channels = [f"{v:.3f}" if row.compared else "" for v in row.ratio]
    noise = f"{row.noise:.1%}" if row.compared else ""
    off = np.array(row.default_ratio)
    default = f"{off[np.abs(off - 1).argmax()]:.3f}" if row.compared and np.isfinite(off).all() else ""
    return [_short(row.file, 70, end=True), loads, row.seconds, row.triangles, len(row.warnings), row.luminance,
            row.dark, *channels, noise, default, row.judgement]  # fmt: skip


def _short(text: str, length: int, end: bool = False) -> str:
    if len(text) <= length:
        return text
    return "…" + text[-length + 1 :] if end else text[: length - 1] + "…"


def _notes(rows: list[Row], found: dict[Path, Survey]) -> list[str]:
    states = Counter(one.state for one in found.values())
    notes = [f"{states[state]} {state}: {about}" for state, about in STATES.items() if states[state]]
    judged = Counter(row.judgement for row in rows)
    notes += [f"{judged[name]} {name}: {about}" for name, about in JUDGEMENTS.items() if judged[name]]
    errors = Counter(_kind(row.error) for row in rows if row.error)
    notes += [f"error, {count} × {text}" for text, count in errors.most_common(20)]
    refused = Counter(_kind(row.refused.partition("): ")[2] or row.refused) for row in rows if row.refused)
    notes += [f"Mitsuba 3 refuses, {count} × {text}" for text, count in refused.most_common(20)]
    warnings = Counter(kind for row in rows for kind in {_kind(text) for text in row.warnings})
    notes += [f"warning, in {count} files: {text}" for text, count in warnings.most_common(30)]
    for row in rows:
        if row.crash:
            notes.append(f"{row.file}: {' '.join(row.crash.split())[-300:]}")
        elif row.judgement in ("said", "differs"):
            said = "; ".join(_short(text, 160) for text in row.warnings[:4]) or "no warning"
            notes.append(f"{row.judgement}, {row.file}: ratio {' '.join(f'{v:.3f}' for v in row.ratio)} ± "
                         f"{row.noise:.1%}; {said}")  # fmt: skip
        if row.compared and row.noise > NOISE_BOUND:
            notes.append(f"{row.file}: noise of the ratio {row.noise:.1%}, more than {NOISE_BOUND:.0%}")
        if row.opens and len(row.sizes) == 3 and row.sizes[0] != row.sizes[2]:
            notes.append(f"{row.file}: the picture has {row.sizes[2]} pixels in the file, we say {row.sizes[0]}")
        if row.opens and row.dark > 0.9:
            notes.append(f"{row.file}: {row.dark:.0%} of the picture is black")
    return notes


def _kind(text: str) -> str:
    """A sentence without its place, lines and what is quoted, so that equal ones are counted together."""
    text = re.sub(r"^(?:/|\w:\\)\S.*?\.\w{3,4}(?::\d+)?: ", "", text)
    text = re.sub(r"^:\d+: ", "", text).partition(" Left out:")[0]
    text = re.sub(r"^lines? [\d, ]+(?:and \d+ more)?: ", "", text)
    text = re.sub(r"/\S+/", "…/", text)
    return _short(re.sub(r"'[^']{12,}'", "'…'", text), 150)
