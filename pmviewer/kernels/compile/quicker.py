"""Numba's compiler does less of what nobody asks for: the same machine code in less time.

Nearly all of that time is spent in Python, some of it needlessly: an event for each call of LLVM, which a timer hears
for every function that is being compiled; sizes of types for debug information that is off, each by a module for LLVM
to read; the same question about loops of universal functions for every `+` of two float32; tables of options made
anew to be compared; all members of nested tuples taken out, wherever one is assigned, to find that none is counted by
references; old values read and dead ones overwritten with zeros for the sake of such counts; lifetimes of variables
after each of nine passes, of which two ask; every `+` resolved anew among thirty candidates; an annotated listing of
each function that is saved. Whatever a version of numba does not have stays as it is.
"""

from __future__ import annotations

import functools
import hashlib
from typing import Any

from llvmlite.binding import ffi
from numba.core import base, funcdesc, ir, itanium_mangler, postproc, targetconfig, transforms, types
from numba.core.annotations import type_annotations
from numba.core.lowering import Lower
from numba.core.runtime.context import NRTContext
from numba.core.typing import npydecl
from numba.np import npyimpl

LONG_NAME = 64
"""Letters of argument types that are kept as they are."""


def install() -> None:
    """From now on, in this process."""
    _without_lock_events()
    for step in (
        _names,
        _records,
        _sizes,
        _loops,
        _options,
        _variables,
        _references,
        _places,
        _lifetimes,
        _calls,
        _listings,
    ):
        step()


def _without_lock_events() -> None:
    """Numba times how long LLVM is at work and shows it nowhere but in a function's metadata."""
    callbacks = getattr(getattr(ffi.lib, "_lock", None), "_cblist", [])
    callbacks[:] = [pair for pair in callbacks if getattr(pair[0], "__module__", "") != base.__name__]


def _names() -> None:
    """A name has the argument types written out, and nested tuples write out theirs: two thirds of a kernel's object
    file were names, which LLVM, Python and the disk each keep. Long ones give way to their hash."""
    original = funcdesc.default_mangler

    def default_mangler(name: str, argtypes: Any, *, abi_tags: Any = (), uid: Any = None) -> str:
        written = itanium_mangler.mangle_args(argtypes)
        if len(written) <= LONG_NAME:
            return original(name, argtypes, abi_tags=abi_tags, uid=uid)
        hashed = hashlib.sha256(written.encode()).hexdigest()[:32]
        return original(name, (), abi_tags=(*abi_tags, hashed), uid=uid)

    funcdesc.default_mangler = default_mangler


def _records() -> None:
    """Numba names a record by a number that each process hands out anew. Code that another process has compiled then
    has names of this one's own code for other records, and the linker takes the one for the other: pictures without a
    surface, or the end of the program. The number is one of what is in the record instead."""

    def mangling_args(self: Any) -> tuple[str, tuple[int]]:
        return type(self).__name__, (_number_of(str(self)),)

    types.Record.mangling_args = property(mangling_args)


@functools.cache
def _number_of(written: str) -> int:
    return int(hashlib.sha256(written.encode()).hexdigest()[:15], 16)


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


@functools.cache
def _is_plain(kind: Any) -> bool:
    """A type of numbers, records and tuples of them."""
    if isinstance(kind, types.BaseTuple):
        return all(map(_is_plain, kind))
    return isinstance(kind, types.Number | types.Boolean | types.NoneType | types.Record)


def _references() -> None:
    """What is counted by references in a value: in plain ones nothing."""
    original = NRTContext.get_meminfos

    def get_meminfos(self: Any, builder: Any, ty: Any, val: Any) -> Any:
        return [] if _is_plain(ty) else original(self, builder, ty, val)

    NRTContext.get_meminfos = get_meminfos


def _places() -> None:
    """A variable's place in memory is read before it is written and cleared when the variable is not used any more, so
    that references are counted. Plain values have none."""
    store, delete = Lower.storevar, Lower.delvar

    def storevar(self: Any, value: Any, name: str, argidx: int | None = None) -> None:
        kind = self.typeof(name)
        if argidx is not None or name in self._singly_assigned_vars or not _is_plain(kind):
            store(self, value, name, argidx)
            return
        self._alloca_var(name, kind)
        self.builder.store(value, self.getvar(name))

    def delvar(self: Any, name: str) -> None:
        kind = self.typeof(name)
        if not _is_plain(kind):
            delete(self, name)
            return
        if name not in self._blk_local_varmap:
            self._singly_assigned_vars.discard(name)
        self._alloca_var(name, kind)

    Lower.storevar, Lower.delvar = storevar, delvar


def _lifetimes() -> None:
    """Lifetimes of variables are found out when somebody asks; variables alive where a block begins concern
    generators and Python's objects alone."""
    original, canonical = postproc.PostProcessor.run, transforms.canonicalize_cfg

    def canonicalize_cfg(blocks: Any) -> Any:
        """The same blocks where no jump leads back: there is no loop to be brought into shape."""
        leads_back = any(
            target <= label for label, block in blocks.items() for target in block.terminator.get_targets()
        )
        return canonical(blocks) if leads_back else blocks.copy()

    def run(self: Any, emit_dels: bool = False, extend_lifetimes: bool = False) -> None:
        function = self.func_ir
        if emit_dels or function.is_generator:
            original(self, emit_dels, extend_lifetimes)
            return
        function.blocks = canonicalize_cfg(function.blocks)
        function.variable_lifetime = postproc.VariableLifetime(function.blocks)
        function.generator_info = None

    postproc.PostProcessor.run, transforms.canonicalize_cfg = run, canonicalize_cfg


def _calls() -> None:
    """What a function of numba's returns for plain arguments, once found, stays: its candidates never change."""
    original = types.BaseFunction.get_call_type
    found: dict[int, tuple[Any, dict[Any, Any]]] = {}  # by identity: types are saved with all that they hold

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(map(_is_plain, args)):
            return original(self, context, args, kws)
        _, known = found.setdefault(id(self), (self, {}))
        answer = known.get((context, args))
        if answer is None:
            answer = known[context, args] = original(self, context, args, kws)
        return answer

    types.BaseFunction.get_call_type = get_call_type


def _listings() -> None:
    """A listing of types line by line is part of all that is saved, to be read by `inspect_types` alone."""
    type_annotations.TypeAnnotation.__str__ = lambda self: ""
