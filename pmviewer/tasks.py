"""Work in pieces: who has many tasks is given a function that runs them, on any number of threads."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import Any, TypeVar

Runner = Callable[[list[Callable[[], Any]]], list[Any]]
"""Runs the given functions and returns their results in order."""


def in_turn(tasks: list[Callable[[], Any]]) -> list[Any]:
    """Runs them one after the other."""
    return [task() for task in tasks]


T = TypeVar("T")
Steps = Generator[list[Callable[[], Any]], None, T]
"""Yields tasks that may run side by side, and goes on when they are through; returns what they were for."""


def in_steps(makes: Sequence[Steps[Any]], run: Runner) -> list[Any]:
    """What each returns, in order; tasks that several ask for at the same time run side by side."""
    made: list[Any] = [None] * len(makes)
    going = list(range(len(makes)))
    while going:
        tasks: list[Callable[[], Any]] = []
        still = []
        for number in going:
            try:
                tasks += next(makes[number])
                still.append(number)
            except StopIteration as end:
                made[number] = end.value
        if tasks:
            run(tasks)
        going = still
    return made


def one_step(make: Callable[[], T]) -> Steps[T]:
    """A task that is one."""
    made: list[T] = []
    yield [lambda: made.append(make())]
    return made[0]
