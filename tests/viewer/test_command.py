"""The command as users start it: a real process, a real window, real keys."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from pmviewer.output.png import read_png

SIZE = ["--set=camera.width=48", "--set=camera.height=48", "--set=photons.N=1000", "--set=render.passes=4"]
PATIENCE = 480.0
"""Seconds: a cold start compiles everything first."""


def xdotool(*words: str) -> str:
    """Standard output of xdotool; empty when it found nothing."""
    return subprocess.run(["xdotool", *words], capture_output=True, text=True, check=False, timeout=30).stdout.strip()


def wait_for(found: Callable[[], object], process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + PATIENCE
    while not found():
        assert process.poll() is None, f"the program ended: {process.communicate()}"
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.2)


def test_window_opens_takes_a_screenshot_and_closes_by_keys(tmp_path):
    if shutil.which("xdotool") is None:
        pytest.fail("This test presses keys: install xdotool (apt-get install xdotool).")
    work = tmp_path / "work"
    work.mkdir()
    # Nothing of the user's: a killed window's session would be offered first, in a dialog that takes all keys.
    homes = {f"XDG_{name}_HOME": str(tmp_path / name) for name in ("CONFIG", "STATE", "DATA")}
    environment = os.environ | homes | {"PYTHONPATH": str(Path(__file__).resolve().parents[2])}
    process = subprocess.Popen(
        [sys.executable, "-m", "pmviewer", "cornell_diffuse", *SIZE],
        cwd=work,
        env=environment,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        search = ("search", "--all", "--pid", str(process.pid), "--name", "cornell_diffuse · pmviewer")
        wait_for(lambda: xdotool(*search), process)
        window = xdotool(*search).split()[0]

        def screenshot() -> list[Path]:
            xdotool("windowfocus", window)
            xdotool("key", "--window", window, "F12")
            time.sleep(1.0)
            return list(work.glob("*.png"))

        wait_for(screenshot, process)
        pixels, _ = read_png(screenshot()[0])
        assert pixels.shape[0] > 400
        assert len({tuple(p) for p in pixels[::9, ::9].reshape(-1, pixels.shape[-1])}) > 20
        end = time.monotonic() + 60
        while process.poll() is None:
            assert time.monotonic() < end, "Ctrl+Q does not close the window"
            xdotool("key", "--window", window, "ctrl+q")
            time.sleep(1.0)
        _, told = process.communicate(timeout=60)
        assert process.returncode == 0, told
        assert "Traceback" not in told
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
