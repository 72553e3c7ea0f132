"""A screen for benches that open the real window: the user's, or a virtual one that is closed afterwards."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pmviewer.errors import PmviewerError, WindowError


@contextmanager
def screen() -> Iterator[dict[str, str]]:
    """The environment for a process that opens a window. Raises WindowError without screen and Xvfb."""
    environment = dict(os.environ)
    if os.environ.get("DISPLAY") or not sys.platform.startswith("linux"):
        yield environment
        return
    server = shutil.which("Xvfb")
    if server is None:
        raise WindowError("There is no screen. Install a virtual one: apt-get install xvfb.")
    read, write = os.pipe()
    command = [server, "-displayfd", str(write), "-screen", "0", "1600x1000x24", "-noreset", "-nolisten", "tcp"]
    process = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as pipe:
            environment["DISPLAY"] = f":{pipe.readline().strip()}"
        yield environment
    finally:
        process.terminate()
        process.wait()


def probe(environment: dict[str, str], *arguments: str, folder: Path | None = None) -> dict[str, Any]:
    """Run `pmviewer.viewer.probe`, of the checkout in `folder` if that is given, and return what it measured. Raises
    PmviewerError when it fails."""
    if folder is not None:
        environment = {**environment, "PYTHONPATH": str(folder)}
    command = [sys.executable, "-m", "pmviewer.viewer.probe", *arguments]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300, cwd=folder)
    lines = [line for line in run.stdout.splitlines() if line.startswith("{")]
    if run.returncode != 0 or not lines:
        raise PmviewerError(f"The window did not run: {run.stderr.strip()[-400:] or run.stdout.strip()[-400:]}")
    result: dict[str, Any] = json.loads(lines[-1])
    return result
