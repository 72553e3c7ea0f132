"""Closing the window while kernels are compiled: the process is gone at once, and nothing is lost.

A kernel that is being compiled can't be interrupted, and a cold compile takes as long as the machine is slow: here it
is work on the session's pool that keeps a core and Python's lock for a minute.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

from PIL import Image

from pmviewer.kernels.compile.jit import user_cache_root

SECONDS = 15.0
"""From the request to close to the end of the process, with a screenshot to be written; under a second on an idle
machine, 4 s with twelve busy processes on two cores."""
COMPILE_SECONDS = 90.0

PROGRAM = """
import sys, threading, time
from pathlib import Path
from pmviewer.engine import session
from pmviewer.settings.access import Settings, with_values
from pmviewer.viewer import app as viewer

made, compiling = [], threading.Event()

class App(viewer.ViewerApp):
    def __init__(self, *arguments, **options):
        super().__init__(*arguments, **options)
        made.append(self)

def prepare(scene, settings, pool, tell):
    def compile_something():
        compiling.set()
        end = time.monotonic() + float(sys.argv[1])
        while time.monotonic() < end:
            pass

    pool.run([compile_something])

def close_while_it_compiles():
    compiling.wait()
    while not made:  # scenes are opened while the window is being made
        time.sleep(0.02)
    made[0].commands.window_shot = Path("window.png")
    while made[0].commands.window_shot is not None:
        made[0].wake()
        time.sleep(0.02)
    print("asked", time.monotonic(), flush=True)
    made[0].commands.table["quit"]()
    made[0].wake()

session.prepare = prepare
threading.Thread(target=close_while_it_compiles, daemon=True).start()
settings = with_values(Settings(), {"photons.N": 1000})
sys.exit(viewer.run_viewer("cornell_diffuse", settings, threads=1, make=App))
"""


def test_closing_during_a_compile_takes_no_time_and_loses_nothing(tmp_path):
    folders = {"HOME": "", "XDG_CONFIG_HOME": "config"}
    cache = {"PMVIEWER_CACHE": str(user_cache_root())}
    environment = os.environ | cache | {name: str(tmp_path / folder) for name, folder in folders.items()}
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(COMPILE_SECONDS)],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    gone = time.monotonic()
    assert process.returncode == 0, process.stderr
    assert process.stderr == ""
    asked = float(next(line.split()[1] for line in process.stdout.splitlines() if line.startswith("asked")))
    assert gone - asked < SECONDS
    print(f"gone after {gone - asked:.2f} s")
    assert Image.open(tmp_path / "window.png").size[0] > 900, "the screenshot that was being written is whole"
    kept = {path.name: path.read_text() for path in (tmp_path / "config").rglob("*") if path.is_file()}
    assert "cornell_diffuse" in kept["recent.txt"]
    assert "Viewport" in kept["window.ini"], "the layout is remembered"
