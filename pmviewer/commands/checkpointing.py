"""Checkpoints of `pmviewer render`: when they are written, going on from one, and signals."""

from __future__ import annotations

import math
import re
import shlex
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType

from pmviewer.commands.choosing import left_of
from pmviewer.commands.job import Job
from pmviewer.engine.checkpoint import checkpoint as files
from pmviewer.engine.checkpoint.checkpoint import Checkpoint, read_checkpoint, write_checkpoint
from pmviewer.engine.checkpoint.identity import decisive, other_settings
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import OutputError, SettingError
from pmviewer.output.checkpoint_header import SUFFIX, read_header
from pmviewer.output.files import check_target
from pmviewer.output.locked import Lock
from pmviewer.settings.access import Settings, flat, with_values

USUAL_INTERVAL = 60.0
"""Seconds between checkpoints where `--resume` alone is given."""
UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}
LATE = 1.25
"""How much longer than the longest of the latest passes the next one may take."""
LATEST = 4
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}


@dataclass(frozen=True)
class Asked:
    """The command line's words: an interval, a file, whether to go on from it, and whether to keep it at the end.
    `if_cut_short`: one is written if the rendering ends early, as where a cluster is lost."""

    interval: str | None = None
    file: Path | None = None
    resume: bool = False
    keep: bool = False
    if_cut_short: bool = False

    @property
    def any(self) -> bool:
        """Whether checkpoints are asked for at all."""
        return self.interval is not None or self.resume or self.if_cut_short


NO_CHECKPOINTS = Asked()


def seconds_of(text: str) -> float:
    """60s, 10min, 1h or bare seconds. Raises SettingError."""
    found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(s|min|h|)\s*", text)
    if found is None or float(found[1]) <= 0:
        raise SettingError(f"--checkpoint {text} is no time: write 60s, 10min or 1h.")
    return float(found[1]) * UNITS[found[2]]


@contextmanager
def checkpoints_of(asked: Asked, job: Job, outputs: Sequence[Path]) -> Iterator[Keeper | None]:
    """The keeper of what is asked for, None for nothing. Raises what `Keeper` does."""
    if not asked.any:
        if asked.file is not None or asked.keep:
            raise SettingError("--checkpoint-file and --keep-checkpoint go with --checkpoint or --resume.")
        try:
            yield None
        except KeyboardInterrupt:
            print("pmviewer: nothing was kept: --checkpoint 60s keeps what is rendered", file=sys.stderr)
            raise
        return
    keeper = Keeper(asked, job, outputs)
    try:
        yield keeper
    except OutputError:
        keeper.unwritten()
        raise
    finally:
        keeper.release()


class Keeper:
    """The checkpoint file of one rendering. `found` is what to go on from, None to begin anew."""

    def __init__(self, asked: Asked, job: Job, outputs: Sequence[Path]) -> None:
        """Raises SettingError, OutputError and SceneError, before anything is rendered: for a file that can't be
        written, is another process's, is damaged, or would be overwritten."""
        usual = math.inf if asked.if_cut_short and not asked.resume else USUAL_INTERVAL
        self.interval = usual if asked.interval is None else seconds_of(asked.interval)
        self.path = asked.file or outputs[0].with_suffix(SUFFIX)
        self._asked, self._job = asked, files.Job(job.scene, job.parameters)
        self._kept: int | None = None
        """Passes in the file."""
        self._warned = False
        self._renderer: Renderer | None = None
        """Once it renders."""
        self._came: int | None = None
        self._state_at = self._written_in = self._pass_began = 0.0
        self._passes: list[float] = []
        target = check_target(self.path, (SUFFIX,))
        self._lock = Lock(target, str(self.path))
        self.found: Checkpoint | None = None
        try:
            self._look()
        except BaseException:
            self._lock.release()
            raise

    def _look(self) -> None:
        there = self.path.exists()
        if self._asked.resume and there:
            self.found = read_checkpoint(self.path)
        elif self._asked.resume:
            print(f"pmviewer: there is no {self.path} yet: beginning with the first pass", file=sys.stderr)
        elif there:
            passes = read_header(self.path).passes
            raise OutputError(
                f"{self.path} holds {passes} passes of a rendering: go on with --resume, remove the file, or name "
                "another one (--checkpoint-file)."
            )

    # going on ---------------------------------------------------------------------------------------------------

    def settings(self, asked: Settings) -> Settings:
        """The settings to go on with: those asked for, and with them what automatic mode has chosen before. Raises
        SettingError where others were asked for, or fewer passes than there are."""
        assert self.found is not None
        head = self.found.header
        if said := other_settings(decisive(head.asked), decisive(asked)):
            raise SettingError(
                f"{self.path}: this checkpoint is of another rendering: {said}. Give the same settings, or render "
                "without --resume."
            )
        if head.passes > asked.render.passes:
            raise SettingError(
                f"{self.path}: this checkpoint has {head.passes} passes already, more than the {asked.render.passes} "
                "asked for: ask for more of them."
            )
        before, chosen = decisive(head.asked), flat(head.settings)
        values = {name: chosen[name] for name, value in decisive(head.settings).items() if value != before[name]}
        return with_values(asked, values | left_of(asked.render.time_limit, head.trial_seconds))

    def trial(self, asked: Settings, seconds: float) -> None:
        """What was asked for, and how long automatic mode took to choose, once before."""
        spent = seconds if self.found is None else self.found.header.trial_seconds
        self._job = files.Job(self._job.scene, self._job.parameters, asked, spent)

    def check(self, renderer: Renderer) -> None:
        """Before any work: raises SceneError where what was found is of another rendering than the renderer's."""
        if self.found is not None and (said := self.found.check(renderer)):
            print(f"pmviewer: warning: the last bits of the picture may differ: {said}", file=sys.stderr)

    @contextmanager
    def watching(self, renderer: Renderer) -> Iterator[None]:
        """While passes are rendered: the first SIGINT or SIGTERM waits for the end of the pass, unless the file has all
        that there is; the second doesn't. Begins with what was found, for a renderer that passed `check`."""
        if self.found is not None:
            self.found.resume(renderer)
            self._kept, self.found = renderer.passes, None  # its arrays are the renderer's
            print(f"pmviewer: going on after pass {renderer.passes} of {self.path}", file=sys.stderr)
        self._renderer = renderer
        self._state_at = self._pass_began = time.monotonic()
        before = {number: signal.getsignal(number) for number in STATUS}

        def note(number: int, stack: FrameType | None) -> None:
            if self._came is not None or self._kept == renderer.passes:
                self._came = self._came or number
                self._leave()
            self._came = number
            kept = f"leaves at once with pass {self._kept}" if self._kept else "leaves at once, with nothing"
            print(f"\npmviewer: ending after pass {renderer.passes + 1}; a second time {kept}", file=sys.stderr)

        for number in STATUS:
            signal.signal(number, note)
        try:
            yield
            if self._asked.keep and self._kept != renderer.passes:
                self.write(renderer)
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def cut_short(self, renderer: Renderer) -> None:
        """No more passes come: the file gets all that there are, and stays."""
        self._asked = replace(self._asked, keep=True)
        self.write(renderer)
        if self._kept == renderer.passes:
            print(f"pmviewer: {self._kept} passes are kept in {self.path}: go on with --resume", file=sys.stderr)

    def after_pass(self, renderer: Renderer) -> None:
        """Write a checkpoint after the first pass, which may have had to compile, and when one is due, so that never
        more than an interval is lost, or if the program is to end; then it ends here, by SystemExit."""
        now = time.monotonic()
        self._passes = [*self._passes, now - self._pass_began][-LATEST:]
        by_then = now - self._state_at + LATE * max(self._passes) + self._written_in
        first = self._kept is None and not self._warned and math.isfinite(self.interval)
        if self._came is not None or first or by_then > self.interval:
            self.write(renderer)
        if self._came is not None:
            self._leave()
        self._pass_began = time.monotonic()

    def write(self, renderer: Renderer) -> None:
        """Write one. Where that fails the one before stays, rendering goes on, and that is said once."""
        start = time.monotonic()
        try:
            write_checkpoint(self.path, renderer, self._job, locked=True)
        except OutputError as error:
            if not self._warned:
                kept = f"the checkpoint of pass {self._kept} stays" if self._kept else "there is no checkpoint yet"
                print(f"pmviewer: warning: {error} Rendering goes on; {kept}.", file=sys.stderr)
            self._warned = True
        else:
            self._kept, self._warned = renderer.passes, False
        self._state_at, self._written_in = start, time.monotonic() - start

    def _leave(self) -> None:
        assert self._came is not None
        number = signal.Signals(self._came)
        if self._kept:
            words = [word for word in sys.argv[1:] if word != "--resume"]
            print(
                f"pmviewer: stopped with pass {self._kept} in {self.path}. Go on with:\n"
                f"  pmviewer {shlex.join(words)} --resume",
                file=sys.stderr,
            )
        else:
            print("pmviewer: stopped; no checkpoint was written", file=sys.stderr)
        raise SystemExit(STATUS[number])

    # its end ----------------------------------------------------------------------------------------------------

    def unwritten(self) -> None:
        """An output could not be written: the checkpoint gets all passes, so that they are not rendered again."""
        if self._renderer is not None and self._kept != self._renderer.passes:
            self.write(self._renderer)
        if self._kept:
            print(f"pmviewer: {self._kept} passes are kept in {self.path}: go on with --resume", file=sys.stderr)

    def written(self) -> None:
        """All outputs are written: the checkpoint has done its work."""
        if self._asked.keep:
            print(f"kept {self.path}")
        else:
            self.path.unlink(missing_ok=True)

    def release(self) -> None:
        """Let other processes use the file."""
        self._lock.release()
