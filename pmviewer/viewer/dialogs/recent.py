"""The files opened last, remembered in the user's configuration folder."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import platformdirs

LENGTH = 10


class RecentFiles:
    """Newest first. Bundled scenes are kept by name, files by absolute path. Never raises: a list that can't be read
    is empty, one that can't be written is forgotten."""

    def __init__(self, store: Path | None = None) -> None:
        self._store = store or Path(platformdirs.user_config_dir("pmviewer")) / "recent.txt"
        self.entries: list[str] = []
        with contextlib.suppress(OSError, UnicodeDecodeError):
            lines = self._store.read_text(encoding="utf-8").splitlines()
            self.entries = [line for line in lines if line.strip()][:LENGTH]

    @property
    def folder(self) -> Path:
        """Where the list is kept, and what else the window remembers."""
        return self._store.parent

    def add(self, path: str | Path) -> None:
        """Put a file or a bundled scene's name on top, and save the list."""
        entry = str(Path(path).absolute()) if Path(path).exists() else str(path)
        self.entries = [entry, *(e for e in self.entries if e != entry)][:LENGTH]
        self._save()

    def remove(self, entry: str) -> None:
        """Forget one, by the text that `entries` has, and save the list."""
        self.entries = [e for e in self.entries if e != entry]
        self._save()

    def clear(self) -> None:
        """Forget all, on disk too."""
        self.entries = []
        self._save()

    @staticmethod
    def is_missing(entry: str) -> bool:
        """True for a file that has gone; a bundled scene's name is no file and never missing."""
        return Path(entry).is_absolute() and not Path(entry).exists()

    def _save(self) -> None:
        with contextlib.suppress(OSError):
            self._store.parent.mkdir(parents=True, exist_ok=True)
            temporary = self._store.with_suffix(f".{os.getpid()}")
            temporary.write_text("\n".join(self.entries), encoding="utf-8")
            temporary.replace(self._store)
