"""A helping process that starts before this one has imported what renders. Imports nothing that takes time."""

from __future__ import annotations

from pmviewer.engine.ahead.helper import Helper
from pmviewer.kernels.compile.jit import folder_of
from pmviewer.kernels.compile.sources import PACKAGE
from pmviewer.progress import available_threads


def early_helper(threads: int | None = None) -> Helper | None:
    """A process that gets ready to compile, before it is known what, where it looks like a first start on several
    processors: nobody has compiled the eye pass for anything."""
    folder = folder_of(PACKAGE / "render" / "eye.py")
    if (threads or available_threads()) < 2 or any(folder.glob("*.eye_pass-*")):
        return None
    return Helper()
