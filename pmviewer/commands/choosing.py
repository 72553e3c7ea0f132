"""Automatic mode on the command line: when it chooses, and what it says."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

from pmviewer.commands.job import Job, Stop
from pmviewer.commands.progress_bar import progress_bar
from pmviewer.engine.auto.bias import Bias
from pmviewer.engine.auto.choose import Goal, choose
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.errors import SettingError
from pmviewer.settings.access import Settings, with_values
from pmviewer.settings.presets import given

LEAST_LEFT = 0.5
"""Share of the time asked for that is rendered whatever the trial took."""


def wants_choice(stop: Stop, job: Job) -> bool:
    """Whether automatic mode chooses how such a job is rendered: what a session file's picture was made with is chosen,
    be it the defaults. Raises SettingError where it was asked to and has been told already."""
    told = given(job.settings, job.told)
    if stop.auto and told:
        names = ", ".join(told[:3]) + (" …" if len(told) > 3 else "")
        raise SettingError(f"--auto chooses {names} itself: leave out what is set of them, or --auto.")
    if stop.auto is not None:
        return stop.auto
    return not told and not job.passes and (stop.seconds is not None or stop.error is not None)


@dataclass(frozen=True)
class Chosen:
    """The settings to render with, the bias that a trial has measured, and the seconds that it took."""

    settings: Settings
    bias: Bias | None = None
    seconds: float = 0.0


def with_choice(opened: OpenScene, settings: Settings, pool: WorkPool, apart: bool) -> Chosen:
    """The settings with what automatic mode chooses for their time or error, by passes that can be rendered `apart`
    where that is asked. The trial's time counts."""
    render = settings.render
    goal = Goal(render.time_limit * pool.threads, render.error, apart)
    with progress_bar() as bar:
        choice = choose(opened, settings, goal, pool, bar.update)
    for number, sentence in enumerate(choice.sentences):
        print(f"{'automatic: ' if number == 0 else '  '}{sentence}", file=sys.stderr)
    values = dict(choice.values) | left_of(render.time_limit, choice.trial.seconds)
    return Chosen(with_values(settings, values), choice.bias, choice.trial.seconds)


def left_of(limit: float, spent: float) -> dict[str, Any]:
    """The setting of how long is rendered, of a time limit in seconds of which a trial has taken some; none for no
    limit."""
    return {"render.time_limit": max(limit - spent, LEAST_LEFT * limit)} if limit > 0 else {}
