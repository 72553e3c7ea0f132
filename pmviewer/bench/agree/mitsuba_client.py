"""A Mitsuba process that serves one worker (`pmviewer.bench.agree.mitsuba_server`)."""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench import peer
from pmviewer.bench.agree.xml import MAX_DEPTH
from pmviewer.errors import PmviewerError


class MitsubaError(PmviewerError):
    """Mitsuba refused a scene, or ended."""


class Mitsuba:
    """Starts with the first request and again after it ended; to be closed."""

    def __init__(self, folder: Path) -> None:
        """Raises PmviewerError when Mitsuba is not installed. `folder` takes the pictures on their way."""
        if not peer.installed():
            raise PmviewerError(peer.MISSING)
        self._out = folder / "picture.npy"
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Mitsuba:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def images(
        self, path: Path, mode: str, seeds: list[int], spp: int, max_depth: int = MAX_DEPTH + 1
    ) -> NDArray[np.float64]:
        """(n, h, w, 3), one picture a seed, of `spp` samples per pixel. Raises MitsubaError."""
        return self._ask({"path": str(path), "mode": mode, "seeds": seeds, "spp": spp, "max_depth": max_depth})

    def seen_plainly(self, path: Path) -> NDArray[np.bool_]:
        """(h, w): the pixels that see no smooth mirror, glass or coat first. Raises MitsubaError."""
        return self._ask({"path": str(path), "mode": "mask"})

    def _ask(self, request: dict[str, Any]) -> NDArray[Any]:
        if self._process is None:
            command = [sys.executable, "-m", "pmviewer.bench.agree.mitsuba_server"]
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps({**request, "out": str(self._out)}) + "\n")
            self._process.stdin.flush()
            line = self._process.stdout.readline()
        except BrokenPipeError:
            line = ""
        if not line:
            raise MitsubaError(f"Mitsuba 3 ended with status {self._end()}.")
        answer = json.loads(line)
        if "error" in answer:
            raise MitsubaError(f"Mitsuba 3: {answer['error']}")
        array: NDArray[Any] = np.load(self._out)
        return array

    def close(self) -> None:
        """End the process, if there is one."""
        if self._process is not None:
            self._end()

    def _end(self) -> int:
        assert self._process is not None
        process, self._process = self._process, None
        with contextlib.suppress(OSError), process:  # closes its pipes, whatever was not read any more, and waits
            pass
        return process.wait()
