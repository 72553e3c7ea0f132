"""Whether a worker renders what this process would: the same program on the same libraries, and on which processor."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from pathlib import Path

PROCESSOR = "processor"
ASK = "__import__('importlib').import_module('pmviewer.engine.cluster.identity').identity()"
"""An expression that gives a worker's identity: text, so that a worker without this package can say so."""


def identity() -> dict[str, str]:
    """Versions of all that a pass depends on, and the processor that kernels are compiled for here."""
    import llvmlite
    import numba
    import numpy as np
    from llvmlite import binding

    import pmviewer
    from pmviewer.engine.cluster import worker
    from pmviewer.kernels.compile.sources import stamp

    features = ",".join(sorted(name for name, has in binding.get_host_cpu_features().items() if has))
    return {
        "pmviewer": pmviewer.__version__,
        "pmviewer's sources": stamp(Path(worker.__file__).resolve()),
        "Python": ".".join(platform.python_version_tuple()[:2]),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "llvmlite": llvmlite.__version__,
        PROCESSOR: f"{binding.get_host_cpu_name()} {features}",
    }


def refusal(mine: Mapping[str, str], theirs: Mapping[str, str]) -> str:
    """Which versions differ, both named, "" where none does."""
    different = [
        f"{name} {theirs.get(name, 'unknown')} there, {version} here"
        for name, version in mine.items()
        if name != PROCESSOR and theirs.get(name) != version
    ]
    return "; ".join(different)


def is_other_processor(mine: Mapping[str, str], theirs: Mapping[str, str]) -> bool:
    """Whether kernels are compiled for another kind of processor, which may round otherwise."""
    return mine[PROCESSOR] != theirs.get(PROCESSOR)
