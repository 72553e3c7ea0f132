"""The package's sources, parsed once a process: the garbage collector rests meanwhile, for it would search the hundred
thousands of nodes, which all live, again and again, for two thirds of the time."""

from __future__ import annotations

import ast
import functools
import gc
from pathlib import Path

import pmviewer

PACKAGE = Path(pmviewer.__file__).parent


@functools.cache
def parsed(file: Path) -> ast.Module:
    """The syntax tree of one of the package's files; nobody may change it."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        return ast.parse(file.read_text(encoding="utf-8"))
    finally:
        if was_on:
            gc.enable()


def package_files() -> list[Path]:
    """Every source of the package."""
    return sorted(PACKAGE.rglob("*.py"))
