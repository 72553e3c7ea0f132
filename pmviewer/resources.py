"""Where the files that ship with the program are: beside the package in a checkout, inside it in a wheel."""

from __future__ import annotations

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
