"""The program that renders, by what tells it from others: of checkpoints, and of a cluster's workers.

Version and sources decide about the picture, libraries and the processor about the last bits of compiled code.
"""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from pathlib import Path

import llvmlite
import llvmlite.binding
import numba
import numpy as np

from pmviewer.kernels.compile.sources import PACKAGE, sources_of
from pmviewer.version import __version__

ROOMS = ("engine", "importance", "kernels", "maps", "photons", "render", "scene", "settings")
"""Whose sources decide about a picture."""
DECISIVE = ("version", "sources")
PROCESSOR = "processor"


@cache
def program() -> dict[str, str]:
    """This one. `sources` is a hash of those that the renderer imports; `processor` its name and what it can do."""
    files = sorted(
        f for f in sources_of(Path(__file__).parent / "renderer.py") if f.relative_to(PACKAGE).parts[0] in ROOMS
    )
    content = hashlib.sha256()
    for file in files:
        content.update(file.relative_to(PACKAGE).as_posix().encode() + b"\0" + file.read_bytes())
    features = llvmlite.binding.get_host_cpu_features()
    can = ",".join(sorted(name for name, has in features.items() if has))
    return {
        "version": __version__,
        "sources": content.hexdigest()[:16],
        "Python": ".".join(platform.python_version_tuple()[:2]),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
        PROCESSOR: f"{llvmlite.binding.get_host_cpu_name()} {can}",
    }
