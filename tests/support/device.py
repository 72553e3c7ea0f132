"""Calling device functions from Python, where tests need it."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from numba import njit


@functools.cache
def from_python(function: Any) -> Callable[..., Any]:
    """A function that calls the device function; it compiles for the types of its arguments."""
    return njit(lambda *arguments: function(*arguments))
