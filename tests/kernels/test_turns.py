"""Two processes that need the same function at the same time compile it once between them."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("fcntl", reason="the system has no locks that end with their process")

MODULE = """
import sys, time
from numba.core import event
from pmviewer.kernels.compile.jit import device, kernel

@device
def inner(x):
    return x * 2.0

@kernel
def outer(x):
    return inner(x) + 1.0

class Count(event.Listener):
    def on_start(self, of):
        names.append(of.data["dispatcher"].py_func.__name__)
        time.sleep(0.5)
    def on_end(self, of):
        pass

names = []
event.register("numba:compile", Count())
print("ready", flush=True)
sys.stdin.readline()
print(outer(3.0), *names, flush=True)
"""


def start(folder):
    (folder / "slow_kernels.py").write_text(MODULE)
    env = {**os.environ, "PMVIEWER_CACHE": str(folder / "cache"), "PYTHONPATH": os.getcwd()}
    return subprocess.Popen(
        [sys.executable, str(folder / "slow_kernels.py")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=env,
    )


def test_no_function_is_compiled_by_two_processes(tmp_path):
    processes = [start(tmp_path) for _ in range(2)]
    for process in processes:
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        process.stdin.write("go\n")
        process.stdin.flush()
    said = [process.communicate(timeout=300)[0].split() for process in processes]
    assert [words[0] for words in said] == ["7.0", "7.0"]
    assert sorted(said[0][1:] + said[1][1:]) == ["inner", "outer"]


def test_whoever_waits_for_a_process_that_dies_compiles_itself(tmp_path):
    first, second = start(tmp_path), start(tmp_path)
    for process in (first, second):
        assert process.stdout.readline() == "ready\n"
    first.stdin.write("go\n")
    first.stdin.flush()
    locked = tmp_path / "cache"
    while not list(locked.glob("kernels/*/.compiling")):
        assert first.poll() is None
    second.stdin.write("go\n")
    second.stdin.flush()
    first.kill()
    first.communicate()
    assert second.communicate(timeout=300)[0].split() == ["7.0", "outer", "inner"]
