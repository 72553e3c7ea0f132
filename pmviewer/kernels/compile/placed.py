"""Kernels that come from the disk take the memory of their code and no more (`kernels/compile/image.py`): for programs
that live long.

LLVM's engine stays where code is compiled, where object files are of another kind, and where one can't be placed.
"""

from __future__ import annotations

import ctypes
from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import CodeLibrary
from numba.core.compiler import CompileResult
from numba.core.registry import cpu_target

from pmviewer.kernels.compile import image, jit  # noqa: F401 - which changes the compiler first
from pmviewer.kernels.compile.library import KernelCodegen, KernelLibrary


class _Constants(ctypes.c_void_p):
    """The place where code finds a function's Python constants, which `held` keeps."""

    held: Any = None


_constants: dict[str, _Constants] = {}
"""By name: all kernels that contain the function share the place."""


class PlacedLibrary(KernelLibrary):
    """A kernel whose code is an image in memory, if it came from the disk."""

    _image: image.Image | None = None

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function, 0 if it is not here."""
        if self._image is None:
            return super().get_pointer_to_function(name)
        return self._image.functions.get(name, 0)

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> KernelLibrary:
        name, kind, data = state
        if kind == "linkable":
            return super()._unserialize(codegen, state)
        try:
            placed = image.load(data[0], codegen.address_of, _place_of)
        except (image.Unloadable, OSError):
            return super()._unserialize(codegen, state)
        library = cls.__new__(cls)
        CodeLibrary.__init__(library, codegen, name)  # without the LLVM module of CPUCodeLibrary
        library._linking_libraries, library._final_module, library._shared_module = [], None, None
        library._image = placed
        library._native = library._finalized = library._disable_inspection = True
        return library


def _place_of(constants: str) -> int:
    return ctypes.addressof(_constants.setdefault(constants, _Constants()))


class _PlacedCodegen(KernelCodegen):
    _library_class = PlacedLibrary

    def address_of(self, name: str) -> int:
        """Of a function of the system, of Python or of numba; 0 if there is none of that name."""
        found: int | None = llvm.address_of_symbol(name)
        if not found and self._engine.is_symbol_defined(name):
            found = self._engine.get_function_address(name)
        return found or 0

    def set_env(self, env_name: str, env: Any) -> None:
        """Give native code its constants, wherever it is."""
        if env_name in _constants:
            _constants[env_name].held, _constants[env_name].value = env, id(env)
        super().set_env(env_name, env)


def _rebuild(cls: type[CompileResult], *state: Any) -> CompileResult:
    """What numba makes of a file. It keeps the constants of all functions in a kernel, a hundred each with a long name;
    an image has those that its code asks for."""
    result = _rebuild_all(cls, *state)
    placed = isinstance(result.library, PlacedLibrary) and result.library._image is not None
    return result._replace(referenced_envs=()) if placed else result


_rebuild_all = CompileResult._rebuild.__func__


def install() -> None:
    """From now on, in this process; nothing where object files are of another kind."""
    if image.is_possible():
        cpu_target.target_context.codegen().__class__ = _PlacedCodegen
        CompileResult._rebuild = classmethod(_rebuild)
