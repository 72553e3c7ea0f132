"""Work in pieces: who has many tasks is given a function that runs them, on any number of threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Runner = Callable[[list[Callable[[], Any]]], list[Any]]
"""Runs the given functions and returns their results in order."""


def in_turn(tasks: list[Callable[[], Any]]) -> list[Any]:
    """Runs them one after the other."""
    return [task() for task in tasks]
