"""Writing files so that there is always a whole one: the old file, or the new one."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from pmviewer.errors import OutputError, SceneError

_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}
_FORBIDDEN = {errno.EACCES, errno.EPERM, errno.EROFS}


def check_target(path: str | Path, suffixes: Sequence[str]) -> Path:
    """The file that writing to `path` would replace (symbolic links followed), before any work is done for it.

    Raises OutputError for an ending other than `suffixes` (lower case, with dot), a missing folder, or something that
    is not a regular file.
    """
    path = Path(path)
    try:
        target = Path(os.path.realpath(path))
        if path.suffix.lower() not in suffixes:
            raise OutputError(f"{path}: unknown format '{path.suffix}'. Use {' or '.join(suffixes)}.")
        if target.is_dir():
            raise OutputError(f"{path}: this is a folder. Name a file in it.")
        if target.exists() and not target.is_file():
            raise OutputError(f"{path}: this is not a regular file. Choose another name.")
        if not target.parent.is_dir():
            raise OutputError(f"{path}: the folder {target.parent} does not exist. Create it first.")
    except (OSError, ValueError) as error:
        raise _explained(path, error) from None
    return target


def write_file(path: str | Path, data: bytes, suffixes: Sequence[str]) -> None:
    """Write `data` beside the file, bring it to the disk, and rename it over the file.

    On any failure what stood there before is whole and nothing else is left in the folder. A file that its owner
    made read-only stays. Raises OutputError; see `check_target` for `suffixes`.
    """
    with replacing(path, suffixes, len(data)) as file:
        file.write(data)


@contextmanager
def replacing(path: str | Path, suffixes: Sequence[str], size: int = 0, *, alone: bool = False) -> Iterator[BinaryIO]:
    """The same for what is written piece by piece, `size` bytes in all: gives a file that takes the other's place
    when the context ends, and goes when it is left by an exception. What a process that was killed has left lies about
    for ever, unless whoever is `alone` in writing the file, by a lock, writes it again."""
    target = check_target(path, suffixes)
    temporary = target.parent / f".pmviewer-{target.name if alone else secrets.token_hex(8)}.tmp"
    try:
        if alone:
            temporary.unlink(missing_ok=True)
        if target.exists() and not os.access(target, os.W_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        try:
            # os.open rather than mkstemp: the file gets the permissions that the user's umask asks for.
            handle = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666)
            with os.fdopen(handle, "wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            if target.exists():
                os.chmod(temporary, target.stat().st_mode & 0o777)
            os.replace(temporary, target)
        except BaseException:
            with suppress(OSError):
                temporary.unlink()
            raise
    except OSError as error:
        raise _explained(Path(path), error, size) from None
    _sync_folder(target.parent)


def read_file(path: str | Path) -> bytes:
    """The whole file. Raises SceneError when it can't be read; pipes and devices are refused, they may never end."""
    path = check_readable(path)
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        raise SceneError(f"The file can't be read: {_reason(error)}.", path) from None


def check_readable(path: str | Path) -> Path:
    """Raises SceneError for what is not there, or is not a regular file: pipes and devices may never end."""
    path = Path(path)
    try:
        if not path.exists():
            raise SceneError("There is no such file.", path)
        if not path.is_file():
            raise SceneError("This is not a regular file.", path)
    except (OSError, ValueError) as error:
        raise SceneError(f"The file can't be read: {_reason(error)}.", path) from None
    return path


def _sync_folder(folder: Path) -> None:
    """Bring the rename to the disk where the system lets folders be opened; the data is safe either way."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _reason(error: OSError | ValueError) -> str:
    text = getattr(error, "strerror", None) or str(error)
    return text[:1].lower() + text[1:]


def _explained(path: Path, error: OSError | ValueError, size: int = 0) -> OutputError:
    number = getattr(error, "errno", None)
    if number in _FULL:
        need = f"{max(size / 1e6, 0.1):.1f} MB"
        return OutputError(f"{path}: no room on the disk for {need}. Make room or choose another folder.")
    if number in _FORBIDDEN:
        return OutputError(f"{path}: no permission to write there. Choose another folder or change its permissions.")
    if number == errno.ENAMETOOLONG:
        return OutputError(f"{str(path)[:80]}…: the name is too long. Choose a shorter one.")
    return OutputError(f"{str(path)[:200]!r} can't be written: {_reason(error)}. Choose another name or folder.")
