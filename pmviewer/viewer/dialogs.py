"""File dialogs: the desktop's own where it has a helper for them, otherwise one drawn in the window."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from imgui_bundle import im_file_dialog
from imgui_bundle import portable_file_dialogs as native

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
        self._drawn = ""
        self._chosen: Chosen | None = None
        self._suffix = ""

    @property
    def is_open(self) -> bool:
        return self._chosen is not None

    def open(self, title: str, name: str, patterns: list[str], chosen: Chosen) -> None:
        """Ask for an existing file; `patterns` like "*.xml", called `name`."""
        if self.is_open:
            return
        self._chosen, self._suffix = chosen, ""
        if has_native_dialogs():
            self._native = native.open_file(title, str(Path.cwd()), [name, " ".join(patterns), "All files", "*"])
        else:
            self._drawn = "open"
            extensions = ",".join(p.removeprefix("*") for p in patterns)
            im_file_dialog.FileDialog.instance().open(
                self._drawn, title, f"{name} ({' '.join(patterns)}){{{extensions}}},.*", False, str(Path.cwd())
            )

    def save(self, title: str, default: Path, chosen: Chosen) -> None:
        """Ask where to write; `default` gives folder, name and suffix."""
        if self.is_open:
            return
        self._chosen, self._suffix = chosen, default.suffix
        pattern = f"*{default.suffix}"
        if has_native_dialogs():
            self._native = native.save_file(title, str(default), [default.suffix[1:].upper(), pattern])
        else:
            self._drawn = "save"
            im_file_dialog.FileDialog.instance().save(
                self._drawn, title, f"{default.suffix[1:].upper()} ({pattern}){{{default.suffix}}}", str(default.parent)
            )

    def poll(self) -> None:
        """Draw the dialog when it is ours, and hand over the answer once there is one."""
        if self._native is not None and self._native.ready(0):
            result = self._native.result()
            self._native = None
            self._answer(result[0] if isinstance(result, list) and result else result or "")
        elif self._drawn and im_file_dialog.FileDialog.instance().is_done(self._drawn):
            dialog = im_file_dialog.FileDialog.instance()
            result = dialog.get_result().path() if dialog.has_result() else ""
            dialog.close()
            self._drawn = ""
            self._answer(result)

    def _answer(self, result: Any) -> None:
        chosen, self._chosen = self._chosen, None
        if not result or chosen is None:
            return
        path = Path(str(result))
        if self._suffix and not path.suffix:
            path = path.with_suffix(self._suffix)
        chosen(path)
