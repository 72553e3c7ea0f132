"""The cold start on two cores: a second process compiles the eye pass while this one builds the tree and what follows.

Numba compiles one function at a time in a process, whatever its threads. The types of all that the eye pass is given
are known as soon as a scene's description is read; by the time that this process gets there, the other one has compiled
it, or is waited for.
"""

from __future__ import annotations

import numpy as np

from pmviewer.engine.ahead.helper import Helper
from pmviewer.engine.ahead.requests import NextSteps
from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OnType
from pmviewer.engine.prepare import eye_steps
from pmviewer.progress import available_threads
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings


def compile_beside(
    helper: Helper | None, of_record: np.dtype, traits: SceneTraits, settings: Settings, threads: int
) -> Helper | None:
    """A process, `helper` if there is one, that compiles the eye pass for such a scene; None where that is done, or
    where there is one processor."""
    steps = eye_steps(np.zeros(1, of_record), traits, settings, plan_of(settings, traits))
    if threads < 2 or steps[-1].is_kept:
        if helper is not None:
            helper.stop()
        return None
    helper = helper or Helper()
    helper.ask(NextSteps(of_record, traits, settings))
    return helper


def beside(settings: Settings, threads: int | None = None) -> OnType:
    """For `open_scene`, of whoever renders without a session: the process ends by itself, or with this one."""

    def on_type(of_record: np.dtype, traits: SceneTraits) -> None:
        compile_beside(None, of_record, traits, settings, threads or available_threads())

    return on_type
