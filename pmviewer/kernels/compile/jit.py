"""The two decorators that every compiled function of pmviewer uses, and where compiled code is kept.

Numba decides whether a cached function is stale by looking at that function's own file alone, so an edit in a module
that a cached function *calls* would go unnoticed. Here compiled code lies in a folder named after all sources that its
module imports, directly or not: an edit elsewhere recompiles nothing, and copies of the package share what they have in
common, wherever they lie.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba import njit
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile, UserProvidedCacheLocator
from numba.core.registry import CPUDispatcher
from numba.core.runtime import rtsys

from pmviewer.kernels.compile import collector, elsewhere, library, quicker
from pmviewer.kernels.compile.cache_folder import claim
from pmviewer.kernels.compile.sources import PACKAGE, stamp
from pmviewer.kernels.compile.turns import Turns

FASTMATH = {"nsz", "arcp", "contract", "afn", "reassoc"}
"""Never `nnan`/`ninf`: they delete the checks for non-finite numbers."""


def _versions() -> str:
    """Names the cache under this Python and numba."""
    what = f"{sys.version_info[:2]}{numba.__version__}"
    return hashlib.sha256(what.encode()).hexdigest()[:16]


def user_cache_root() -> Path:
    """The folder for files that can be made again, by the platform's custom."""
    if override := os.environ.get("PMVIEWER_CACHE"):
        return Path(override)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local")) / "pmviewer" / "Cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "pmviewer"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "pmviewer"


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe{os.getpid()}"
        probe.touch()
        probe.unlink()
    except OSError:
        return False
    return True


def _choose_cache() -> Path:
    name = _versions()
    root = user_cache_root() / "kernels"
    if not _writable(root):
        root = Path(tempfile.gettempdir()) / f"pmviewer-kernels-{os.getuid() if hasattr(os, 'getuid') else 'user'}"
        if not _writable(root):
            root = Path(tempfile.mkdtemp(prefix="pmviewer-kernels-"))
    return claim(root, name)


CACHE_FOLDER = _choose_cache()
numba.config.CACHE_DIR = str(CACHE_FOLDER)
_turns = Turns(CACHE_FOLDER)
if not numba.config.DISABLE_JIT:
    library.install()
    collector.install()
    quicker.install()

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": FASTMATH}


_used: set[str] = set()
"""Folders of modules that this process has imported."""


@functools.cache
def folder_of(source: Path) -> Path:
    """Where the code compiled from a source file is kept, for the state of all sources that it depends on."""
    module = source.relative_to(PACKAGE).with_suffix("") if source.is_relative_to(PACKAGE) else Path(source.stem)
    return CACHE_FOLDER / f"{'.'.join(module.parts)}-{stamp(source)}"


@functools.cache
def _resolved(file: str) -> Path:
    return Path(file).resolve()


class _Locator(UserProvidedCacheLocator):
    """One folder for each module and state of the sources that it depends on."""

    def __init__(self, py_func: Any, py_file: str) -> None:
        super().__init__(py_func, py_file)
        self._source = _resolved(py_file)
        self._cache_path = str(folder_of(self._source))

    def ensure_cache_path(self) -> None:
        # Numba's own writes a file for each function that is defined; the folder above is known to be writable.
        if self._cache_path not in _used:
            _used.add(self._cache_path)
            os.makedirs(self._cache_path, exist_ok=True)
            os.utime(self._cache_path)

    def get_source_stamp(self) -> str:
        return stamp(self._source)


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes = (_Locator,)


def _number(name: str) -> int:
    return int(hashlib.sha256(name.encode()).hexdigest()[:15], 16)


class _OneFileEach(IndexDataCacheFile):
    """Compiled code in a file named after its signature. Numba's index of numbered files loses what two processes
    save at the same time, and can hand one signature the other's code."""

    def _name(self, key: Any) -> str:
        return self._data_name_pattern.format(number=_number(str(key)))

    def flush(self) -> None:
        for file in Path(self._cache_path).glob(self._data_name_pattern.replace("{number:d}", "*")):
            file.unlink(missing_ok=True)

    def save(self, key: Any, data: Any) -> None:
        # Not kept is no error: the code runs all the same where the disk is full or somebody emptied the cache.
        with contextlib.suppress(OSError):
            Path(self._cache_path).mkdir(parents=True, exist_ok=True)
            self._save_data(self._name(key), (key, data))

    def load(self, key: Any) -> Any:
        try:
            saved, data = self._load_data(self._name(key))
        except OSError:
            return None
        return data if saved == key else None


class _KernelCache(FunctionCache):
    _impl_class = _KernelCacheImpl

    def __init__(self, py_func: Callable[..., Any]) -> None:
        super().__init__(py_func)
        impl = self._impl
        self._cache_file = _OneFileEach(self._cache_path, impl.filename_base, impl.locator.get_source_stamp())
        self._held: list[int] = []

    def has(self, sig: Any, target_context: Any) -> bool:
        """Whether there is compiled code on disk."""
        name = self._cache_file._name(self._index_key(sig, target_context.codegen()))
        return Path(self._cache_path, name).is_file()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled code, or None when it is this process's turn to compile it: until `give_back`."""
        loaded = self._loaded(sig, target_context)
        if loaded is not None:
            return loaded
        key = self._index_key(sig, target_context.codegen())
        number = _number(f"{self._cache_path}{self._cache_file._name(key)}")
        if _turns.take(number):
            self._held.append(number)
            loaded = self._loaded(sig, target_context)
        return loaded

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        # Not numba's own, which first takes up all that a compiler needs, a fifth of a second: whoever compiles does.
        rtsys.initialize(target_context)
        loaded = None
        with self._guard_against_spurious_io_errors():
            loaded = self._load_overload(sig, target_context)
        if loaded is not None and isinstance(loaded.library, library.KernelLibrary):
            key = self._index_key(sig, target_context.codegen())
            loaded.library.read_again = functools.partial(self._bitcode, key)
        return loaded

    def _bitcode(self, key: Any) -> bytes | None:
        saved = self._cache_file.load(key)
        return None if saved is None else library.bitcode_of(saved[0])

    def give_back(self, count: int) -> None:
        """End all turns but the first `count`."""
        while len(self._held) > count:
            _turns.give(self._held.pop())

    @property
    def turns(self) -> int:
        """How many are held: more than one where a function compiles itself for other types."""
        return len(self._held)


class _KernelDispatcher(CPUDispatcher):
    """Compiles what no other process is compiling, or has it compiled (`elsewhere`)."""

    _cache: _KernelCache
    _is_entry = True

    def is_kept(self, *arguments: Any) -> bool:
        """Whether code for such arguments is compiled already, by any process."""
        types = tuple(self.typeof_pyval(argument) for argument in arguments)
        return types in self.overloads or self._cache.has(types, self.targetctx)

    def compile(self, sig: Any) -> Any:
        before = self._cache.turns
        if before == 0 and self._is_entry and not (sig in self.overloads or self._cache.has(sig, self.targetctx)):
            elsewhere.compiled(self, sig)
        try:
            return super().compile(sig)
        finally:
            self._cache.give_back(before)


def _cached(dispatcher: Any, kind: type[_KernelDispatcher]) -> Any:
    if not numba.config.DISABLE_JIT:
        dispatcher._cache = _KernelCache(dispatcher.py_func)
        dispatcher.__class__ = kind
    return dispatcher


class _DeviceDispatcher(_KernelDispatcher):
    """Without a wrapper numba would jump to address 0."""

    _is_entry = False

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        raise TypeError(f"{self.py_func.__name__} is a device function: call it from a kernel.")


def loaded() -> int:
    """Functions whose code this process holds, each set of argument types by itself."""
    # isinstance asks the object itself, which a weak reference to what has gone answers with an error; issubclass asks
    # numba's abstract class, which remembers every type: a megabyte and a half
    return sum(len(one.overloads) for one in gc.get_objects() if _KernelDispatcher in type(one).__mro__)


def device(function: Callable[..., Any]) -> Any:
    """A function that kernels call. It has no wrapper for Python, which halves the time to compile; a call from Python
    raises TypeError."""
    return _cached(njit(no_cpython_wrapper=True, no_cfunc_wrapper=True, **_OPTIONS)(function), _DeviceDispatcher)


def inlined(function: Callable[..., Any]) -> Any:
    """A function whose statements take the place of a call to it, before types are known."""
    return njit(inline="always", **_OPTIONS)(function)


def kernel(function: Callable[..., Any]) -> Any:
    """An entry point that Python calls: serial, without the GIL, on one tile or batch."""
    if numba.config.DISABLE_JIT:
        return functools.wraps(function)(lambda *arguments: function(*map(_readable, arguments)))
    return _cached(njit(no_cfunc_wrapper=True, **_OPTIONS)(function), _KernelDispatcher)


def _readable(argument: Any) -> Any:
    """An argument whose records have their fields as attributes, as they have in compiled code."""
    if isinstance(argument, tuple):
        fields = map(_readable, argument)
        return type(argument)(*fields) if hasattr(argument, "_fields") else tuple(fields)
    if isinstance(argument, np.ndarray) and argument.dtype.names:
        return argument.view(np.recarray)
    if isinstance(argument, np.void) and argument.dtype.names:
        return argument.view(np.dtype((np.record, argument.dtype)))
    return argument
