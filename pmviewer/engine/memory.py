"""Refusing what would not fit into memory before it is tried: an overcommitting system would end the whole program."""

from __future__ import annotations

import os
import sys

from pmviewer.errors import SettingError
from pmviewer.render.planes import CHANNELS

BYTES_PER_PIXEL = CHANNELS * (8 + 3 * 4)
"""The film's float64 sums and three float32 frames: the one shown, the one being made, the one being exported."""

BYTES_PER_TRAJECTORY = 250
"""Some three photons stored, twice while batches are joined, and their map."""


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


def check_memory(width: int, height: int, N: int) -> None:
    """Raises SettingError when an image of that size with N trajectories a pass can't fit."""
    available = available_memory()
    if available is None:
        return
    image, photons = width * height * BYTES_PER_PIXEL, N * BYTES_PER_TRAJECTORY
    if image + photons <= available:
        return
    if image >= photons:
        what, hint = f"An image of {width} × {height} pixels", "Lower camera.width and camera.height."
    else:
        what, hint = f"A pass of {N:,} trajectories", "Lower photons.N."
    needed, free = (image + photons) / 1e9, available / 1e9
    raise SettingError(f"{what} needs about {needed:.1f} GB of memory and {free:.1f} GB are free. {hint}")
