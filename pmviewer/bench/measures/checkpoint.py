"""Checkpoints (X5): renderings killed at random moments and resumed, a full disk, damaged files, and what they cost.

The renderings are the command's own, in processes of their own: killed by SIGKILL, or with a limit to the size of files
at which writing fails as on a full disk.
"""

from __future__ import annotations

import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.checkpoint.checkpoint import Job, read_checkpoint, write_checkpoint
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import PmviewerError, SceneError
from pmviewer.output.checkpoint_header import read_header
from pmviewer.output.exr import read_exr
from pmviewer.settings.access import Settings, with_values

SCENE, PASSES, INTERVAL = "cornell_caustic", 64, 1.0
SIZE, N = 160, 30_000
USUAL_INTERVAL = 60.0
"""Seconds, of what checkpoints cost."""
TIMES = ("seconds", "cpu_seconds")
"""Metadata of pictures that no two renderings share."""
SEED = 15
LONGEST = 600.0
"""Seconds after which a process hangs."""


@dataclass
class _Kill:
    """`passes` in the checkpoint, None without one; seconds `lost` since its state."""

    moment: float
    passes: int | None
    lost: float
    identical: bool


def run(quick: bool = False) -> BenchResult:
    """`quick`: 4 moments instead of 20, and no large picture."""
    rows: list[list[Cell]] = []
    with tempfile.TemporaryDirectory(prefix="pmviewer-bench-") as name:
        folder = Path(name)
        whole, began, ended = _whole(folder / "whole.exr")
        kills = _kills(folder, whole, began, ended, 4 if quick else 20)
        for kill in kills:
            rows.append([f"killed after {kill.moment:.2f} s", kill.passes or 0, kill.lost, _yes(kill.identical)])
        disk = _full_disk(folder)
        rows += [[f"disk full at {share:.0%} of the file", passes, "", _yes(good)] for share, passes, good in disk]
        refused, harmless, bad = _damaged(folder, 60 if quick else 300)
        rows.append([f"{refused + harmless + bad} damaged files: refused, harmless, wrong", refused, harmless, bad])
        costs = [_cost(folder, side) for side in ((512,) if quick else (512, 2048))]
    for side, size, seconds, more in costs:
        rows.append([f"checkpoint of {side} × {side}: MB, s, MB of memory", size / 1e6, seconds, more / 1e6])
    identical, kept = sum(kill.identical for kill in kills), sum(good for _, _, good in disk)
    lost = max(kill.lost for kill in kills)
    targets = [
        Target("X5", identical, len(kills), "", True, "renderings killed and resumed that are bit-identical"),
        Target(
            "X5",
            lost,
            INTERVAL,
            "s",
            False,
            "most that a kill cost, a checkpoint every second; of kills in the first pass, since it usually begins",
        ),
        Target("X5", kept, len(disk), "", True, "full disks that leave the last checkpoint whole, and go on"),
        Target("X5", bad, 0, "", False, "damaged files that are taken for something else"),
    ]
    for side, size, seconds, more in costs:
        share = f"of the time at {side} × {side}, a checkpoint a minute"
        targets.append(Target("X5", 100 * seconds / USUAL_INTERVAL, 1.0 if side <= 512 else 10.0, "%", False, share))
        extra = f"memory while writing over the file, {side} × {side}"
        targets.append(Target("X5", 100 * more / size, 10.0, "%", False, extra))
    notes = [
        f"{SCENE}, {SIZE} × {SIZE}, {PASSES} passes of N = {N:,}; an uninterrupted rendering takes {ended:.1f} s, of "
        f"which {ended - began:.1f} s are passes",
        "identical: all layers and all metadata but times; refused: one sentence; harmless: the same state is read",
    ]
    heading = ["what", "passes kept", "s lost", "as it should be"]
    return BenchResult("Checkpoints", heading, rows, targets, notes)


def _yes(good: bool) -> str:
    return "yes" if good else "NO"


# killed and resumed -------------------------------------------------------------------------------------------------


def _command(output: Path, passes: int, *words: str) -> list[str]:
    size = ["--size", f"{SIZE}x{SIZE}", "--set", f"photons.N={N}", "--passes", str(passes)]
    return [sys.executable, "-m", "pmviewer", "render", SCENE, "-o", str(output), *size, *words]


def _rendered(output: Path, passes: int, *words: str, shell: str = "") -> subprocess.CompletedProcess[str]:
    command = _command(output, passes, *words)
    if shell:
        command = ["sh", "-c", f'{shell}; exec "$@"', "sh", *command]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=LONGEST)


def _done(output: Path, passes: int, *words: str) -> None:
    done = _rendered(output, passes, *words)
    if done.returncode != 0:
        raise PmviewerError(f"A rendering failed: {done.stderr.strip()[-400:]}")


def _whole(output: Path) -> tuple[Path, float, float]:
    """An uninterrupted rendering, and when its passes began and ended, in seconds since the start. The second one: the
    first may compile."""
    _done(output, 2)
    start = time.monotonic()
    _done(output, PASSES)
    ended = time.monotonic() - start
    return output, ended - float(read_exr(output)[1]["seconds"]), ended


def _kills(folder: Path, whole: Path, began: float, ended: float, count: int) -> list[_Kill]:
    chance, found = random.Random(SEED), list[_Kill]()
    while len(found) < count:
        output = folder / f"killed-{len(found)}.exr"
        moment = chance.uniform(began, ended)
        if (kill := _killed(output, moment, began)) is None:
            continue  # it had ended before
        _done(output, PASSES, "--checkpoint", f"{INTERVAL}s", "--resume")
        kill.identical = _same(output, whole)
        found.append(kill)
        output.unlink()
    return found


def _killed(output: Path, moment: float, began: float) -> _Kill | None:
    process = subprocess.Popen(
        _command(output, PASSES, "--checkpoint", f"{INTERVAL}s"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    time.sleep(moment)
    at = time.time()
    process.send_signal(signal.SIGKILL)
    if process.wait() != -signal.SIGKILL:
        output.unlink(missing_ok=True)
        return None
    file = output.with_suffix(".checkpoint")
    if not file.exists() and output.exists():
        return _Kill(moment, PASSES, 0.0, False)  # it was about to end: the picture is written, and needs none any more
    if not file.exists():
        return _Kill(moment, None, max(moment - began, 0.0), False)
    head = read_header(file)
    return _Kill(moment, head.passes, max(at - head.when, 0.0), False)


def _same(one: Path, other: Path) -> bool:
    """All layers, and all metadata but times."""
    (layers, told), (others, told_there) = read_exr(one), read_exr(other)
    same = layers.keys() == others.keys() and all(layers[k].tobytes() == others[k].tobytes() for k in layers)
    return same and all(told.get(k) == told_there.get(k) for k in told.keys() | told_there.keys() if k not in TIMES)


# a full disk --------------------------------------------------------------------------------------------------------


def _full_disk(folder: Path) -> list[tuple[float, int, bool]]:
    """By where in the file the disk is full: passes in the checkpoint that stays, and whether it is the one from before
    and goes on to the same picture."""
    whole, output = folder / "to-12.exr", folder / "full.exr"
    _done(whole, 12)
    _done(output, 6, "--checkpoint", "1h", "--keep-checkpoint")
    file = output.with_suffix(".checkpoint")
    before, found = file.read_bytes(), list[tuple[float, int, bool]]()
    limited = "--checkpoint", "0.001s", "--resume", "--keep-checkpoint"
    for share in (0.0, 0.02, 0.5, 0.999):
        file.write_bytes(before)
        blocks = int(share * len(before)) // 512
        # In sh a block is 512 bytes; Python gets EFBIG, as ENOSPC one of the errors of a full disk.
        done = _rendered(output, 9, *limited, shell=f"ulimit -f {blocks}")
        stays = file.exists() and file.read_bytes() == before and not list(folder.glob(".pmviewer-*"))
        said = done.stderr.count("no room on the disk") - done.stderr.count("pmviewer: error")
        _done(output, 12, "--resume")
        found.append((share, 6 if stays else 0, stays and said == 1 and _same(output, whole)))
    return found


# damaged files ------------------------------------------------------------------------------------------------------


def _renderer(side: int, pool: WorkPool, photons: int = 20_000) -> Renderer:
    values = {"camera.width": side, "camera.height": side, "photons.N": photons}
    return Renderer(open_scene(SCENE), with_values(Settings(), values), pool, StageStore(0))


def _damaged(folder: Path, count: int) -> tuple[int, int, int]:
    """How many of the files are refused by one sentence, are read as what was written, and anything else."""
    pool, path = WorkPool(), folder / "small.checkpoint"
    try:
        renderer = _renderer(8, pool, 1000)
        renderer.step()
        write_checkpoint(path, renderer, Job(SCENE))
        good, told = path.read_bytes(), renderer.state()
    finally:
        pool.close()
    chance, refused, harmless, bad = random.Random(SEED), 0, 0, 0
    for case in range(count):
        data = bytearray(good)
        if case % 3 == 0:
            del data[chance.randrange(len(data)) :]
        elif case % 3 == 1:
            first = chance.randrange(len(data))
            del data[first : first + chance.randrange(1, 64)]
        else:
            data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        path.write_bytes(data)
        try:
            state = read_checkpoint(path).state
        except SceneError as error:
            refused += "\n" not in str(error)
            continue
        same = state.arrays.keys() == told.arrays.keys() and all(
            state.arrays[name].tobytes() == array.tobytes() for name, array in told.arrays.items()
        )
        harmless, bad = harmless + same, bad + (not same)
    return refused, harmless, count - refused - harmless


# what they cost -----------------------------------------------------------------------------------------------------


def _cost(folder: Path, side: int) -> tuple[int, int, float, float]:
    """Side of the picture, bytes of the file, seconds to write it, and bytes of memory that this took more."""
    pool, path = WorkPool(), folder / f"{side}.checkpoint"
    try:
        renderer = _renderer(side, pool)
        renderer.step()
        write_checkpoint(path, renderer, Job(SCENE))
        before, most, seconds, size = _resident(), 0.0, [], 0
        for _ in range(3):
            start = time.perf_counter()
            size = write_checkpoint(path, renderer, Job(SCENE))
            seconds.append(time.perf_counter() - start)
            most = max(most, _resident() - before)
    finally:
        pool.close()
        path.unlink(missing_ok=True)
    return side, size, statistics.median(seconds), most


def _resident() -> float:
    """Most memory that this process has had, in bytes."""
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * unit if os.name == "posix" else 0.0
