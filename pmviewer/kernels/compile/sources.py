"""What compiled code depends on: the sources that a module imports, directly or not, inside this package."""

from __future__ import annotations

import ast
import functools
import hashlib
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2]


@functools.cache
def _read(path: Path) -> tuple[bytes, frozenset[Path]]:
    """Hash of a source file, and the package's files that it imports."""
    source = path.read_bytes()
    found: set[Path] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            first, *rest = name.split(".")
            file = PACKAGE.joinpath(*rest).with_suffix(".py") if rest else PACKAGE / "__init__.py"
            if first == PACKAGE.name and file.is_file():
                found.add(file)
    return hashlib.sha256(source).digest(), frozenset(found)


@functools.cache
def sources_of(path: Path) -> frozenset[Path]:
    """The file itself and all files of the package that it imports, directly or through others."""
    reached: set[Path] = set()
    waiting = [path]
    while waiting:
        file = waiting.pop()
        if file not in reached:
            reached.add(file)
            waiting += _read(file)[1]
    return frozenset(reached)


@functools.cache
def stamp(path: Path) -> str:
    """Hash of the sources that a file depends on (16 hex digits): changes when compiled code of it may be stale."""
    digest = hashlib.sha256()
    for file in sorted(sources_of(path)):
        digest.update(file.relative_to(PACKAGE).as_posix().encode() if file.is_relative_to(PACKAGE) else b"")
        digest.update(_read(file)[0])
    return digest.hexdigest()[:16]
