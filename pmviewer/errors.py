"""Every error that a user of pmviewer can see: one sentence of what, where and what to do."""

from __future__ import annotations

from pathlib import Path


class PmviewerError(Exception):
    """Base of all errors shown to users as they are, without a traceback."""


class SceneError(PmviewerError):
    """A scene file that can't be opened.

    Parameters
    ----------
    what: one sentence: what is wrong and what was expected.
    path: the file.
    line: line in that file, when known.
    hint: what to do about it.
    """

    def __init__(self, what: str, path: str | Path | None = None, line: int | None = None, hint: str = "") -> None:
        self.what, self.path, self.line, self.hint = what, path, line, hint
        where = "" if path is None else f"{path}:{line}: " if line is not None else f"{path}: "
        super().__init__(f"{where}{what}" + (f" {hint}" if hint else ""))


class SettingError(PmviewerError):
    """A setting's name or value that the schema refuses."""


class OutputError(PmviewerError):
    """A file that can't be written; what stood there before is untouched."""


class ClusterError(PmviewerError):
    """A cluster that can't be reached, or whose workers can't render what this program would."""


class WindowError(PmviewerError):
    """No window can be opened (no screen, no OpenGL)."""


class PictureWarning(UserWarning):
    """What a picture that was asked for in Python does not show, or shows otherwise than asked for, in one sentence."""
