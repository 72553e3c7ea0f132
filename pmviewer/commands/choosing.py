"""Automatic mode on the command line: when it chooses, and what it says."""

from __future__ import annotations

import sys
from collections.abc import Callable

from pmviewer.commands.job import Stop
from pmviewer.commands.progress_bar import progress_bar
from pmviewer.engine.auto.candidates import given
from pmviewer.engine.auto.choose import Goal, choose
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.errors import SettingError
from pmviewer.settings.access import Settings, with_values

LEAST_LEFT = 0.5
"""Share of the time asked for that is rendered whatever the trial took."""


def wants_choice(stop: Stop, settings: Settings) -> bool:
    """Whether automatic mode chooses how such a job is rendered. Raises SettingError where it was asked to and has been
    told already."""
    told = given(settings)
    if stop.auto and told:
        names = ", ".join(told[:3]) + (" …" if len(told) > 3 else "")
        raise SettingError(f"--auto chooses {names} itself: leave out what is set of them, or --auto.")
    if stop.auto is not None:
        return stop.auto
    return not told and (stop.seconds is not None or stop.error is not None)


def with_choice(
    opened: OpenScene, settings: Settings, pool: WorkPool
) -> tuple[Settings, Callable[[int], float] | None]:
    """The settings with what automatic mode chooses for their time or error, and the squared bias by passes, where a
    trial has measured it. The trial's time counts."""
    render = settings.render
    goal = Goal(render.time_limit * pool.threads, render.error)
    with progress_bar() as bar:
        choice = choose(opened, settings, goal, pool, bar.update)
    for number, sentence in enumerate(choice.sentences):
        print(f"{'automatic: ' if number == 0 else '  '}{sentence}", file=sys.stderr)
    values = dict(choice.values)
    if render.time_limit > 0:
        values["render.time_limit"] = max(render.time_limit - choice.trial.seconds, LEAST_LEFT * render.time_limit)
    return with_values(settings, values), choice.bias
