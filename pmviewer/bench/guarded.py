"""A Python program in a process of its own that may hang, grow or die: asked line by line, ended when it exceeds.

Requests and answers are lines of JSON (as `pmviewer.bench.agree.mitsuba_server` speaks them). The watchdog looks at the
clock, and where the system tells (Linux) at CPU time and resident memory, every `LOOK` seconds.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import IO, Any

LOOK = 0.1
"""Seconds between two looks at a process that works."""
LAST_WORDS = 2000
"""Characters of its standard error that are kept."""


@dataclass(frozen=True)
class Limits:
    """Of one request: CPU seconds, seconds in which no thread works or waits for a processor, bytes of resident memory
    of the whole process. `wall`: seconds by the clock, which a busy machine stretches; the only one that holds where
    the system doesn't tell the others."""

    cpu: float = 60.0
    idle: float = 20.0
    wall: float = 3600.0
    memory: int = 4 << 30


class Ended(Exception):
    """The process did not answer. `kind` is "time" (it waits for what never comes, or by the clock), "cpu", "memory" or
    "died"; the text is a sentence."""

    def __init__(self, kind: str, text: str) -> None:
        self.kind = kind
        super().__init__(text)


class Guarded:
    """Runs `python -m MODULE`, starts with the first request and again after it ended; to be closed. `nice` lowers its
    priority where the system can."""

    def __init__(self, module: str, arguments: Sequence[str] = (), nice: int = 0) -> None:
        self._command = [sys.executable, "-m", module, *arguments]
        self._nice = nice
        self._process: subprocess.Popen[str] | None = None
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._words: list[str] = []

    def __enter__(self) -> Guarded:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def ask(self, request: dict[str, Any], limits: Limits) -> dict[str, Any]:
        """The answer. Raises Ended, after the process is gone, when there is none within the limits."""
        process = self._running()
        assert process.stdin is not None
        started, cpu_before = time.monotonic(), cpu_seconds(process.pid)
        try:
            process.stdin.write(json.dumps(request) + "\n")
            process.stdin.flush()
        except OSError:
            raise self._death() from None
        at_work = started
        while True:
            try:
                line = self._lines.get(timeout=LOOK)
            except queue.Empty:
                line = None
            if line == "":
                raise self._death()
            if line is not None:
                answer: dict[str, Any] = json.loads(line)
                return answer
            now = time.monotonic()
            if works(process.pid):
                at_work = now
            if now - started > limits.wall:
                raise self._kill("time", f"no answer after {limits.wall:g} s")
            if now - at_work > limits.idle:
                raise self._kill("time", f"no answer, and no work for {limits.idle:g} s")
            if cpu_seconds(process.pid) - cpu_before > limits.cpu:
                raise self._kill("cpu", f"no answer after {limits.cpu:g} s of CPU time")
            if resident_bytes(process.pid) > limits.memory:
                raise self._kill("memory", f"more than {limits.memory / 2**20:.0f} MiB of memory")

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            self._process = subprocess.Popen(
                self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                errors="replace",
            )  # fmt: skip
            if self._nice and hasattr(os, "setpriority"):
                nice = max(self._nice, os.getpriority(os.PRIO_PROCESS, 0))
                os.setpriority(os.PRIO_PROCESS, self._process.pid, nice)
            self._lines, self._words = queue.SimpleQueue(), []
            self._readers = [
                threading.Thread(target=_forward, args=(self._process.stdout, self._lines), daemon=True),
                threading.Thread(target=_keep, args=(self._process.stderr, self._words), daemon=True),
            ]
            for reader in self._readers:
                reader.start()
        return self._process

    def _kill(self, kind: str, text: str) -> Ended:
        self._end(kill=True)
        return Ended(kind, text)

    def _death(self) -> Ended:
        status = self._end(kill=False)
        words = [line for line in "".join(self._words).splitlines() if line.strip()]
        said = f": {words[-1].strip()[:300]}" if words else ""
        return Ended("died", f"the process ended with status {status}{said}")

    def _end(self, kill: bool) -> int:
        assert self._process is not None
        if kill:
            self._process.kill()
        status = self._process.wait()
        for reader in self._readers:
            reader.join(5)
        # Whoever keeps an error of this process keeps, by its traceback, the pipes.
        with contextlib.suppress(OSError), self._process:  # closes them, whatever was not read any more
            self._process = None
        return status

    def renew(self, above: int) -> None:
        """End the process if it holds more than so many bytes; the next request starts another."""
        if self._process is not None and resident_bytes(self._process.pid) > above:
            self._end(kill=True)

    def close(self) -> None:
        """End the process, if there is one."""
        if self._process is not None:
            self._end(kill=True)


def requests() -> Iterator[dict[str, Any]]:
    """For the process that is asked: the requests, one after another. It ends at once, even in the midst of one, when
    there is nobody left to ask: a bench that was ended leaves no process behind."""
    lines: queue.SimpleQueue[str] = queue.SimpleQueue()

    def read() -> None:
        for line in sys.stdin:
            lines.put(line)
        os._exit(0)

    threading.Thread(target=read, daemon=True).start()
    while True:
        yield json.loads(lines.get())


def _forward(stream: IO[str], lines: queue.SimpleQueue[str]) -> None:
    for line in stream:
        lines.put(line)
    lines.put("")


def _keep(stream: IO[str], words: list[str]) -> None:
    for line in stream:
        words.append(line[:LAST_WORDS])
        del words[:-20]


def cpu_seconds(pid: int) -> float:
    """User and system time of a process, all threads together; 0 where the system doesn't tell."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError, AttributeError):
        return 0.0


def works(pid: int) -> bool:
    """Whether a thread of a process runs, waits for a processor or for a disk, or was stopped by somebody; true where
    the system doesn't tell."""
    try:
        stats = [path.read_text() for path in Path(f"/proc/{pid}/task").glob("*/stat")]
        return not stats or any(text.rsplit(")", 1)[1].split()[0] in "RDT" for text in stats)
    except (OSError, IndexError):
        return True


def resident_bytes(pid: int | str = "self", peak: bool = False) -> int:
    """Memory that a process holds, or the most it held since `forget_peak`; 0 where the system doesn't tell."""
    try:
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmHWM:" if peak else "VmRSS:"):
                return int(line.split()[1]) * 1024
    except (OSError, IndexError, ValueError):
        pass
    return 0


def forget_peak() -> None:
    """Let the peak of this process' memory count from now on, where the system can."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
