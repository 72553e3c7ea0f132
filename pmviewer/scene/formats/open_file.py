"""Reading a file that somebody else named: never a device, a pipe or a directory, and never more than there is."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from typing import BinaryIO

from pmviewer.errors import SceneError

_POINTER, _LONGEST_POINTER = b"version https://git-lfs.github.com/spec/", 1024
"""What stands in a large file's place where a repository was cloned without Git LFS: its first bytes, and its longest
length, by the specification."""


def open_regular(path: Path, what: str = "The file") -> tuple[BinaryIO, int]:
    """A regular file, opened, and its size in bytes.

    What it is is looked up on the opened file, so that nothing else can take its place behind the check; opening does
    not wait for a pipe's other end. Raises SceneError.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    except (OSError, ValueError) as error:
        raise _unreadable(what, error, path) from None
    about = os.fstat(descriptor)
    if not stat.S_ISREG(about.st_mode):
        os.close(descriptor)
        raise SceneError(f"{what} is not a regular file.", path)
    file = os.fdopen(descriptor, "rb")
    if about.st_size <= _LONGEST_POINTER:
        try:
            start = file.read(len(_POINTER))
        except OSError as error:  # a process's memory, say, which is a regular file of no size
            file.close()
            raise _unreadable(what, error, path) from None
        if start == _POINTER:
            file.close()
            hint = "Fetch it with 'git lfs pull'."
            raise SceneError(f"{what} was not downloaded: this is Git LFS's note of where it is.", path, hint=hint)
        file.seek(0)
    return file, about.st_size


def read_regular(path: Path, what: str = "The file") -> bytes:
    """The content of a regular file. Raises SceneError."""
    file, _ = open_regular(path, what)
    with file:
        try:
            return file.read()
        except OSError as error:
            raise _unreadable(what, error, path) from None


def _unreadable(what: str, error: Exception, path: Path) -> SceneError:
    return SceneError(f"{what} can't be read: {getattr(error, 'strerror', None) or error}.", path)


def found_beside(folder: Path, name: str) -> Path:
    """The file of that name in the folder, written with / or \\ and, where there is none, in another case."""
    wanted = folder / name.strip().strip('"').replace("\\", "/")
    try:
        if wanted.exists():
            return wanted
        at = Path(wanted.anchor) if wanted.is_absolute() else Path()
        for part in wanted.parts[1:] if wanted.is_absolute() else wanted.parts:
            here = at / part
            if part != ".." and not here.exists():
                same = [entry for entry in sorted(os.listdir(at)) if entry.lower() == part.lower()]
                here = at / same[0] if same else here
            at = here
        return at
    except (OSError, ValueError):
        return wanted
