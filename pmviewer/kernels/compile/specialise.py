"""One function that stands for several: which one is decided by the types of its arguments, before anything runs.

A kernel is compiled for the records that it is given, and what a record has no field for is not compiled. The choice is
made by one function, in compiled code and in plain Python (NUMBA_DISABLE_JIT=1) alike:

    @specialised
    def cached(cache, eye, p):
        '''What it does.'''
        if absent(cache):
            return lambda cache, eye, p: BLACK

        def from_records(cache, eye, p):
            …

        return from_records

The choosing function sees types where code is compiled, and values in plain Python; it asks them with `has`, `part`,
`absent` and `is_a` alone. What it returns takes arguments of the same names.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import overload


def specialised(choose: Callable[..., Callable[..., Any]]) -> Any:
    """A function for kernels, made from one that returns the implementation for its arguments."""

    @functools.wraps(choose)
    def chosen(*arguments: Any) -> Any:
        return choose(*arguments)(*arguments)

    overload(chosen, jit_options={"no_cfunc_wrapper": True})(choose)
    return chosen


def has(record: Any, field: str) -> bool:
    """Whether a record or a named tuple, or its type, has that field."""
    if isinstance(record, types.BaseNamedTuple):
        return field in record.fields
    if isinstance(record, tuple):
        return field in getattr(record, "_fields", ())
    if isinstance(record, types.Record):
        return field in record.fields
    return field in (record.dtype.names or ())


def part(argument: Any, name: str) -> Any:
    """A field of a named tuple, or of its type."""
    if isinstance(argument, types.BaseNamedTuple):
        return argument.types[argument.fields.index(name)]
    return getattr(argument, name)


def absent(argument: Any) -> bool:
    """Whether an argument is None or the record of nothing (`pmviewer.maps.variant.ABSENT`), or its type is that of
    one."""
    if argument is None or isinstance(argument, types.NoneType):
        return True
    if isinstance(argument, types.Record):
        return "absent" in argument.fields
    return "absent" in (getattr(getattr(argument, "dtype", None), "names", None) or ())


def is_a(argument: Any, kind: type[tuple[Any, ...]]) -> bool:
    """Whether an argument is a named tuple of that class, or its type is that of one."""
    if isinstance(argument, types.BaseNamedTuple):
        return argument.instance_class is kind
    return isinstance(argument, kind)
