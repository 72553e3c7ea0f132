"""Whether a worker renders what this process would: the same program on the same libraries, and on which processor."""

from __future__ import annotations

from collections.abc import Mapping

from pmviewer.engine.program import PROCESSOR

ASK = "__import__('importlib').import_module('pmviewer.engine.program').program()"
"""An expression that gives a worker's program: text, so that a worker without this package can say so."""
NAMES = {"version": "pmviewer", "sources": "pmviewer's sources"}


def refusal(mine: Mapping[str, str], theirs: Mapping[str, str]) -> str:
    """Which versions differ, both named, "" where none does."""
    different = [
        f"{NAMES.get(name, name)} {theirs.get(name, 'unknown')} there, {version} here"
        for name, version in mine.items()
        if name != PROCESSOR and theirs.get(name) != version
    ]
    return "; ".join(different)


def is_other_processor(mine: Mapping[str, str], theirs: Mapping[str, str]) -> bool:
    """Whether kernels are compiled for another kind of processor, which may round otherwise."""
    return mine[PROCESSOR] != theirs.get(PROCESSOR)
