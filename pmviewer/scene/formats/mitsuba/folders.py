"""Where the files that a scene names are looked for, and which files may be included."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PureWindowsPath


class Folders:
    """The search folders of one scene, the first one first.

    Meshes, pictures and spectra are found wherever their names lead to. Included files and the folders of <path> are
    confined, since they decide what else is read: an included file must lie, links followed, in the scene's folder or
    one that a <path> or the user names, and a <path> must not be so wide that it lets everything in.
    """

    def __init__(self, home: Path, named: Iterable[Path] = ()) -> None:
        self.home = home
        self.searched: list[Path] = [home, *named]
        self._roots = [_real(folder) for folder in self.searched]
        self._found: dict[tuple[str, Path | None], Path | None] = {}

    def add(self, folder: Path) -> None:
        """A folder of a <path>: it is searched before those named so far."""
        self.searched.insert(0, folder)
        self._roots.append(_real(folder))
        self._found.clear()

    def put_last(self, before: list[Path]) -> None:
        """Search what was added since the folders were `before` after these."""
        self.searched = before + [folder for folder in self.searched if folder not in before]
        self._found.clear()

    def folder(self, name: str, near: Path) -> Path | None:
        """The existing folder that a <path> in a file of the folder `near` names."""
        return next((c for place in (near, *self.searched) for c in _spellings(place, name) if _is(c, "dir")), None)

    def too_wide(self, folder: Path) -> bool:
        """Is this the root of the file system, or does it hold all that the user has?"""
        real = _real(folder)
        try:
            home = Path.home().resolve()
        except (RuntimeError, OSError):
            return real == Path(real.anchor)
        return real == Path(real.anchor) or home.is_relative_to(real)

    def file(self, name: str, near: Path | None = None) -> Path | None:
        """The existing plain file of that name: in the search folders, or beside the included file in `near`.

        A full path of another machine is looked for by its last parts. Devices and pipes don't count: they would block.
        """
        key = (name, near)
        if key not in self._found:
            places = self.searched if near is None else [*self.searched, near]
            names = [name, *_tails(name)]
            candidates = (c for tried in names for place in places for c in _spellings(place, tried))
            self._found[key] = next((c for c in candidates if _is(c, "file")), None)
        return self._found[key]

    def leads_out(self, name: str, near: Path | None = None) -> bool:
        """Does the name lead out of all folders that files may be included from, whether it exists or not?"""
        places = self.searched if near is None else [*self.searched, near]
        return not any(self.allowed(c) for place in places for c in _spellings(place, name))

    def allowed(self, path: Path) -> bool:
        """May this file be included?"""
        real = _real(path)
        return any(real.is_relative_to(root) for root in self._roots)


def _spellings(folder: Path, name: str) -> tuple[Path, ...]:
    return (folder / name, folder / name.replace("\\", "/")) if "\\" in name else (folder / name,)


def _tails(name: str) -> list[str]:
    """The last parts of a full path, the longest first."""
    windows = PureWindowsPath(name)
    if not (windows.drive or name.startswith("/")):
        return []
    parts = windows.parts[1:]
    return ["/".join(parts[i:]) for i in range(1, len(parts))] if len(parts) > 1 else list(parts)


def _is(path: Path, kind: str) -> bool:
    try:
        return path.is_file() if kind == "file" else path.is_dir()
    except (OSError, ValueError):  # a name with a null character, or too long a one
        return False


def _real(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # links in a circle
        return path.absolute()
