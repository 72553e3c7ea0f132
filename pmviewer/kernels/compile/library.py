"""Native code for what Python calls, and for nothing else.

Numba turns each function that it compiles into native code: it links in the code of all functions that it calls,
optimises the whole and keeps the machine code. A function that is called by kernels alone needs none of that: it is
optimised and translated again as part of each kernel. Here such a function stays what it was after its own, cheap
passes, and a kernel's code is optimised once, when Python first asks for its address. Same machine code (films are
equal bit for bit), in two thirds of the time.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
from numba.core.environment import lookup_environment
from numba.core.registry import cpu_target

ENVIRONMENT = "_ZN08NumbaEnv"
"""How the names of globals begin that hold the address of a function's Python constants."""


class KernelLibrary(JITCodeLibrary):
    """The code of one function with all that it calls. Native from the first call of `get_pointer_to_function` on that
    names one of its own functions."""

    _native = False
    read_again: Callable[[], bytes | None] | None = None
    """Of code that came from disk: its bitcode, None where the file is gone."""

    def finalize(self) -> None:
        """Link in what it calls. After this nothing can be added."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            if hasattr(library, "_reload_init"):  # from numba 0.63 on
                self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Address of a function, 0 if it is not here."""
        self._ensure_finalized()
        if not self._native and self._defines(name):
            self._make_native()
        return super().get_pointer_to_function(name) if self._native else 0

    def _defines(self, name: str) -> bool:
        try:
            return not self._final_module.get_function(name).is_declaration
        except NameError:
            return False

    def _make_native(self) -> None:
        self._codegen._check_llvm_bugs()
        self._optimize_final_module()
        self._final_module.verify()
        self._finalize_final_module()
        self._native = True
        for variable in self._final_module.global_variables:
            if variable.name.startswith(ENVIRONMENT):
                environment = lookup_environment(variable.name)
                if environment is not None:
                    self._codegen.set_env(variable.name, environment)

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """What is kept on disk: of what is native machine code, bitcode, and the names that are asked for; of the rest
        bitcode alone."""
        self._ensure_finalized()
        if self._native:
            name, kind, (machine_code, bitcode) = super().serialize_using_object_code()
            return name, kind, (machine_code, bitcode, self._own_names())
        return self.name, "linkable", self._get_module_for_linking().as_bitcode()

    def _own_names(self) -> tuple[str, ...]:
        """Of the functions that are this library's own, and of the places of Python constants: the code of what it
        calls is asked for in other libraries."""
        module = self._final_module
        functions = (f.name for f in module.functions if not f.is_declaration and f.linkage == llvm.Linkage.external)
        places = (v.name for v in module.global_variables if not v.is_declaration and v.name.startswith(ENVIRONMENT))
        return (*functions, *places)

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> KernelLibrary:
        name, kind, data = state
        if kind == "linkable":
            library: KernelLibrary = codegen.create_library(name)
            library._final_module = library._shared_module = llvm.parse_bitcode(data)
            library._finalized = library._disable_inspection = True
        else:
            machine_code, _, names = data
            library = codegen.create_library(name)
            library.enable_object_caching()
            library._set_compiled_object(machine_code)
            library._finalize_final_module()
            codegen._engine._defined_symbols.update(names)  # read from the bitcode by numba, which took megabytes
            library._native = library._disable_inspection = True
        return library

    def _get_module_for_linking(self) -> Any:
        """What others link in. Of code that came from disk as machine code nobody asks for it but a kernel that calls a
        kernel: it is read again then, for it takes more memory than the machine code, even packed. Raises RuntimeError
        where the file is gone."""
        if self._shared_module is None and self.read_again is not None:
            bitcode = self.read_again()
            if bitcode is None:
                raise RuntimeError(f"The compiled code of {self.name} is gone from the disk.")
            self._shared_module = llvm.parse_bitcode(bitcode)
        return super()._get_module_for_linking()


def bitcode_of(state: tuple[str, str, Any]) -> bytes:
    """Of what `serialize_using_object_code` has kept."""
    _, kind, data = state
    bitcode: bytes = data if kind == "linkable" else data[1]
    return bitcode


class KernelCodegen(JITCPUCodegen):
    """Numba's, whose libraries are `KernelLibrary`."""

    _library_class = KernelLibrary
    _described: tuple[Any, ...] | None = None

    def magic_tuple(self) -> tuple[Any, ...]:
        """What compiled code depends on, part of the name of each file: asked of LLVM once."""
        if self._described is None:
            self._described = super().magic_tuple()
        return self._described

    def set_env(self, env_name: str, env: Any) -> None:
        """Give native code its constants; what is not native gets them as a part of what is."""
        if self._engine.is_symbol_defined(env_name):
            super().set_env(env_name, env)


def install() -> None:
    """From now on all that this process compiles for the processor is compiled so."""
    cpu_target.target_context.codegen().__class__ = KernelCodegen
