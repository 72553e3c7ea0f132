"""What compiled code depends on: the sources that a module imports, directly or not, inside this package."""

from __future__ import annotations

import functools
import hashlib
import re
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2]


_IMPORT = re.compile(rb"^[ \t]*(?:from[ \t]+([\w.]+)[ \t]+)?import[ \t]+(\([^)]*\)|[^\n]*)", re.MULTILINE)
_NAME = re.compile(rb"([\w.]+)(?:\s+as\s+\w+)?")


def imported_names(source: bytes) -> set[str]:
    """Every module that a source may import: of `from a import b` both a and a.b. Text that merely looks like an
    import counts too, which costs a recompile at most. Parsing all sources instead took a quarter of a warm start."""
    names: set[str] = set()
    for module, what in _IMPORT.findall(re.sub(rb"#[^\n]*", b"", source)):
        found = {name.decode() for name in _NAME.findall(what)}
        names |= {module.decode(), *(f"{module.decode()}.{name}" for name in found)} if module else found
    return names


@functools.cache
def _file_of(name: str) -> Path | None:
    """Of a module of this package."""
    first, *rest = name.split(".")
    if first != PACKAGE.name:
        return None
    file = PACKAGE.joinpath(*rest).with_suffix(".py") if rest else PACKAGE / "__init__.py"
    return file if file.is_file() else None


@functools.cache
def _read(path: Path) -> tuple[bytes, frozenset[Path]]:
    """Hash of a source file and its place in the package, and the package's files that it imports."""
    source = path.read_bytes()
    place = path.relative_to(PACKAGE).as_posix() if path.is_relative_to(PACKAGE) else ""
    files = map(_file_of, imported_names(source))
    told = hashlib.sha256(place.encode() + b"\0" + source)
    return told.digest(), frozenset(file for file in files if file is not None)


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
    each = sorted(_read(file)[0] for file in sources_of(path))
    return hashlib.sha256(b"".join(each)).hexdigest()[:16]
