"""What the program finds around it: the files that ship with it (beside the package in a checkout, inside it in a
wheel) and free memory."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from pmviewer.errors import PmviewerError

PACKAGE = Path(__file__).resolve().parent


def data_folder(name: str) -> Path:
    """Folder `name` ("scenes", "shaders") of the installed wheel or of the source checkout.

    Raises PmviewerError when neither has it.
    """
    installed = PACKAGE / "_data" / name
    if installed.is_dir():
        return installed
    checkout = PACKAGE.parent / name
    # The marker keeps a stray folder of that name in site-packages from being taken for ours.
    if checkout.is_dir() and (PACKAGE.parent / "pyproject.toml").is_file():
        return checkout
    raise PmviewerError(f"The folder '{name}' that belongs to pmviewer is missing from {PACKAGE}: install it again.")


def available_memory() -> int | None:
    """Bytes that can still be used without swapping; None where the system doesn't tell."""
    if sys.platform.startswith("linux"):
        try:
            with open("/proc/meminfo") as lines:
                for line in lines:
                    if line.startswith("MemAvailable:"):
                        return int(line.split()[1]) * 1024
        except OSError:
            return None
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None
