"""Kernels are compiled by a process of their own, and this one loads what it has saved.

Numba keeps what it learned while compiling for as long as the process lives: intermediate code, types, templates, some
ten megabytes for a kernel whose machine code has a few hundred kilobytes. A window that is used for hours would only
grow. It also stays fluent: compiling holds Python's lock most of the time.

`install` is for programs that live long; without it everything is compiled where it is called. What the other process
can't do (it died, nothing can be saved) is done here as before.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from typing import Any

from pmviewer.kernels.compile.sources import PACKAGE

IDLE = 60.0
"""Seconds without work after which the process ends, and the memory that it has taken is free."""


class Compiler:
    """The other process, begun when there is something to compile and begun again when it has ended. `count` tells how
    many kernels it has compiled."""

    def __init__(self) -> None:
        self.count = 0
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._timer: threading.Timer | None = None

    def compile(self, module: str, name: str, signature: Any) -> bool:
        """Compile a kernel, which is a name in a module, for such types. False if that was not possible."""
        with self._lock:
            if self._timer is not None:
                self._timer.cancel()
            try:
                done = self._ask(module, name, signature)
            except (OSError, EOFError, pickle.PickleError, ValueError, TypeError, AttributeError):
                self._end()
                return False
            self.count += done
            self._timer = threading.Timer(IDLE, self.rest)
            self._timer.daemon = True
            self._timer.start()
            return done

    def begin(self) -> None:
        """Have the process import what it needs: it will be asked soon."""
        with self._lock, contextlib.suppress(OSError):
            if self._process is None:
                self._process = _begin()

    def rest(self) -> None:
        """End the process if nobody is waiting for it."""
        if self._lock.acquire(blocking=False):
            try:
                self._end()
            finally:
                self._lock.release()

    def _ask(self, module: str, name: str, signature: Any) -> bool:
        words = pickle.dumps((module, name, signature))
        process = self._process
        if process is None or process.poll() is not None:
            process = self._process = _begin()
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(len(words).to_bytes(8, "little") + words)
        process.stdin.flush()
        return process.stdout.read(1) == b"1"

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()


def _begin() -> subprocess.Popen[bytes]:
    paths = [str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")]
    return subprocess.Popen(
        [sys.executable, "-m", "pmviewer.kernels.compile.elsewhere"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))},
    )


_compiler: Compiler | None = None


def install() -> Compiler:
    """From now on, in this process."""
    global _compiler
    if _compiler is None:
        _compiler = Compiler()
    return _compiler


def uninstall() -> None:
    """From now on this process compiles again what it calls."""
    global _compiler
    if _compiler is not None:
        _compiler.rest()
    _compiler = None


def compiled(dispatcher: Any, signature: Any) -> bool:
    """Have a kernel compiled and saved. False where that is not asked for, or was not possible."""
    if _compiler is None:
        return False
    module, name = dispatcher.py_func.__module__, dispatcher.py_func.__qualname__
    if getattr(sys.modules.get(module), name, None) is not dispatcher:
        return False  # one that no other process can find
    return _compiler.compile(module, name, signature)


def _hear(asked: queue.SimpleQueue[bytes]) -> None:
    """Standard input ends when the parent does, and so does this process, whatever it is doing."""
    while header := sys.stdin.buffer.read(8):
        asked.put(sys.stdin.buffer.read(int.from_bytes(header, "little")))
    os._exit(0)


def _serve() -> None:
    """Compile what standard input asks for, and answer each with a byte."""
    asked: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_hear, args=(asked,), daemon=True).start()
    importlib.import_module(f"{PACKAGE.name}.kernels.compile.jit")  # what takes time, before anybody asks

    while True:
        try:
            module, name, signature = pickle.loads(asked.get())
            getattr(importlib.import_module(module), name).compile(signature)
            done = b"1"
        except Exception:  # it is compiled where it was asked for, and its error told there
            done = b"0"
        os.write(sys.stdout.fileno(), done)


if __name__ == "__main__":
    _serve()
