"""The package's sources, parsed once a process: the garbage collector rests meanwhile and leaves them alone afterwards,
for it would search the hundred thousands of nodes, which all live, again and again, for two thirds of the time."""

from __future__ import annotations

import ast
import functools
import gc
from collections.abc import Iterator
from pathlib import Path

import pmviewer

PACKAGE = Path(pmviewer.__file__).parent


@functools.cache
def _trees() -> dict[Path, ast.Module]:
    was_on = gc.isenabled()
    gc.disable()
    try:
        return {file: ast.parse(file.read_text(encoding="utf-8")) for file in package_files()}
    finally:
        gc.freeze()
        if was_on:
            gc.enable()


def parsed(file: Path) -> ast.Module:
    """The syntax tree of one of the package's files; nobody may change it."""
    return _trees()[file]


def package_files() -> list[Path]:
    """Every source of the package."""
    return sorted(PACKAGE.rglob("*.py"))


def within(node: ast.AST) -> Iterator[ast.AST]:
    """The statements of a statement's blocks, and handlers and cases, which have blocks of their own. Nine tenths of a
    tree are expressions, in which nothing is defined or imported."""
    for block in ("body", "handlers", "orelse", "finalbody", "cases"):
        yield from getattr(node, block, ())


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """Those of all blocks in it, at any depth."""
    for statement in within(node):
        yield statement
        yield from statements(statement)
