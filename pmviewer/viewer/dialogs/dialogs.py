"""File dialogs: the desktop's own where it has a helper for them, otherwise one drawn in the window."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from imgui_bundle import portable_file_dialogs as native

from pmviewer.viewer.dialogs.file_browser import FileBrowser

Chosen = Callable[[Path], None]
_HELPERS = ("zenity", "kdialog", "matedialog", "qarma")


def has_native_dialogs() -> bool:
    """On Linux the library behind native dialogs answers "cancelled" when none of these programs is there."""
    if sys.platform in ("win32", "darwin"):
        return True
    return any(shutil.which(name) for name in _HELPERS) and bool(os.environ.get("DISPLAY"))


class FileDialogs:
    """At most one dialog at a time. `poll` belongs into every frame."""

    def __init__(self) -> None:
        self._native: Any = None
        self._browser: FileBrowser | None = None
        self._chosen: Chosen | None = None
        self._suffix = ""
        self._folder: Path | None = None
        """Where the last file was chosen."""

    @property
    def is_open(self) -> bool:
        """Whether a file is being asked for; only one dialog is open at a time."""
        return self._chosen is not None

    def open(self, title: str, name: str, patterns: list[str], chosen: Chosen) -> None:
        """Ask for an existing file; `patterns` like "*.xml", called `name`."""
        if self.is_open:
            return
        self._chosen, self._suffix = chosen, ""
        folder = self._start(Path.cwd())
        if has_native_dialogs():
            self._native = native.open_file(title, str(folder), [name, " ".join(patterns), "All files", "*"])
        else:
            self._browser = FileBrowser(title, folder, patterns, self._answer)

    def _start(self, folder: Path) -> Path:
        """The folder to begin in: where the last file was chosen, if there was one and it is still there."""
        return self._folder if self._folder is not None and self._folder.is_dir() else folder

    def save(self, title: str, default: Path, chosen: Chosen) -> None:
        """Ask where to write; `default` gives name and suffix, and the folder of the first dialog."""
        if self.is_open:
            return
        default = self._start(default.parent) / default.name
        self._chosen, self._suffix = chosen, default.suffix
        patterns = [f"*{default.suffix}"]
        if has_native_dialogs():
            self._native = native.save_file(title, str(default), [default.suffix[1:].upper(), *patterns])
        else:
            self._browser = FileBrowser(title, default.parent, patterns, self._answer, saving=True, name=default.name)

    def poll(self) -> None:
        """Draw the dialog when it is ours, and hand over the answer once there is one."""
        if self._native is not None and self._native.ready(0):
            result = self._native.result()
            self._native = None
            text = (result[0] if result else "") if isinstance(result, list) else result
            self._answer(Path(text) if text else None)
        elif self._browser is not None and not self._browser.draw():
            self._browser = None

    def _answer(self, path: Path | None) -> None:
        chosen, self._chosen = self._chosen, None
        if path is None or chosen is None:
            return
        self._folder = path.absolute().parent
        chosen(path if path.suffix or not self._suffix else path.with_suffix(self._suffix))
