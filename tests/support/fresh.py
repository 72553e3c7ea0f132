"""Python processes that know nothing of pmviewer yet, in a third of the time of a start: each is forked from one that
has imported numba and what its compiler needs (0.7 of 0.8 CPU seconds). pmviewer reads its environment when it is
imported, which only the forked one does.

For scripts that ask what a process finds, compiles and keeps. What depends on how Python itself starts (its options,
hashes of strings, what is imported without numba) has to start it."""

from __future__ import annotations

import atexit
import functools
import gc
import json
import os
import runpy
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 300
"""Seconds that a script may take."""
spent = 0.0
"""CPU seconds of all that were run, for `--costs`: they are not this process's children."""


class Done(NamedTuple):
    """What a process said, and its status."""

    stdout: str
    stderr: str
    returncode: int


def python(script: Path | str, *words: str, env: Mapping[str, str] | None = None, check: bool = True) -> Done:
    """Run a script, its text or its file, with these words in `sys.argv` and these variables beside the environment's.
    Raises RuntimeError with all that it said where its status is not 0, unless `check` is False."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), **(env or {})}
    with tempfile.TemporaryDirectory() as folder:
        if isinstance(script, str):
            file = Path(folder, "script.py")
            file.write_text(script, "utf-8")
        else:
            file = script
        run = _forked if hasattr(os, "fork") else _started
        done = run(Path(folder), [str(file), *words], environment)
    if check and done.returncode != 0:
        raise RuntimeError(f"The process ended with status {done.returncode}.\n{done.stdout}{done.stderr}")
    return done


def _forked(folder: Path, arguments: list[str], environment: dict[str, str]) -> Done:
    global spent
    requests, answers = _server().stdin, _server().stdout
    assert requests is not None
    assert answers is not None
    asked = {"arguments": arguments, "environment": environment, "cwd": os.getcwd(), "folder": str(folder)}
    requests.write(json.dumps(asked) + "\n")
    requests.flush()
    answer = json.loads(answers.readline())
    spent += answer["seconds"]
    return Done(*((folder / name).read_text("utf-8") for name in ("stdout", "stderr")), answer["status"])


def _started(folder: Path, arguments: list[str], environment: dict[str, str]) -> Done:
    """Where processes can't be forked."""
    done = subprocess.run(
        [sys.executable, *arguments], env=environment, capture_output=True, text=True, check=False, timeout=LONGEST
    )
    return Done(done.stdout, done.stderr, done.returncode)


@functools.cache
def _server() -> subprocess.Popen[str]:
    """One for this process, which it ends with: its standard input is closed then."""
    command = [sys.executable, "-P", __file__]
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    atexit.register(server.communicate)
    return server


def _serve() -> dict[str, Any] | None:
    """Answer requests until there are none; in each forked process, what it is asked for."""
    from numba.core.registry import cpu_target

    cpu_target.typing_context.refresh()
    cpu_target.target_context.refresh()
    gc.freeze()
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            signal.alarm(LONGEST)
            return json.loads(line)
        _, status, usage = os.wait4(child, 0)
        answer = {"status": os.waitstatus_to_exitcode(status), "seconds": usage.ru_utime + usage.ru_stime}
        print(json.dumps(answer), flush=True)
    return None


def _become(asked: dict[str, Any]) -> None:
    """Take what a start would have had: files, environment, arguments and paths."""
    os.chdir(asked["folder"])
    for descriptor, place in enumerate((os.devnull, "stdout", "stderr")):
        opened = os.open(place, os.O_RDWR | os.O_CREAT)
        os.dup2(opened, descriptor)
        os.close(opened)
    os.chdir(asked["cwd"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    sys.argv = asked["arguments"]
    sys.path[0:0] = [os.path.dirname(sys.argv[0]), *os.environ["PYTHONPATH"].split(os.pathsep)]


if __name__ == "__main__":
    request = _serve()
    if request is not None:
        _become(request)
        runpy.run_path(sys.argv[0], run_name="__main__")
        atexit._run_exitfuncs()
        sys.stdout.flush()
        os._exit(0)  # numba's thousands of objects need not be taken down one by one
