"""A process that compiles: `python -m pmviewer.engine.ahead.child` reads one pickled request, compiles what it asks for
and writes a line of JSON before each part. It ends when its work is done or its parent is gone."""

from __future__ import annotations

import json
import os
import pickle
import select
import sys
import threading
from typing import IO

import numpy as np

from pmviewer.engine.ahead.requests import Clicks, NextSteps, Request
from pmviewer.engine.method import plan_of
from pmviewer.engine.pool import lower_priority
from pmviewer.engine.prepare import eye_steps, grid_step
from pmviewer.kernels.accel.bvh import builder_kernels


def _say(**what: object) -> None:
    print(json.dumps(what), flush=True)


def while_waiting() -> None:
    """Compile what every scene needs until there is a request: the parent, which is reading its scene, builds a tree
    next."""
    for compile_one in builder_kernels():
        if _is_asked():
            return
        compile_one()


def _is_asked() -> bool:
    """Whether a request has begun to arrive. Where the system can't tell, one is assumed to have."""
    try:
        return bool(select.select([sys.stdin], [], [], 0)[0])
    except (OSError, ValueError):
        return True


def next_steps(request: NextSteps) -> None:
    """Compile the eye pass for a record of that type, which is all that its kernels are compiled for, and what the
    parent comes to last."""
    record = np.zeros(1, request.record)
    plan = plan_of(request.settings, request.traits)
    for step in eye_steps(record, request.traits, request.settings, plan):
        step.run()
    if plan.photons:
        grid_step().run()


def all_clicks(request: Clicks) -> None:
    """Try every click on the miniature."""
    # The renderer, which the eye pass does not wait for.
    from pmviewer.engine.ahead.clicks import Click, OtherKind, clicks, other_kinds
    from pmviewer.engine.opened import open_scene
    from pmviewer.engine.pool import WorkPool
    from pmviewer.errors import PmviewerError

    opened = open_scene(request.scene)
    if opened.flat.record.dtype != request.record:
        _say(failed="the stand-in compiles other kernels")
        return
    pool = WorkPool(1)
    try:
        todo: list[Click | OtherKind] = [*clicks(opened, request.settings)]
        todo += other_kinds(request.record, request.settings)
        todo = todo[request.offset :: request.every]
        for i, click in enumerate(todo):
            _say(part=i + 1, of=len(todo), text=click.text)
            try:
                click.run(pool)
            except PmviewerError:  # the window says so when it is clicked
                continue
    finally:
        pool.close()
    _say(done=True)


def _end_with(parent: IO[bytes]) -> None:
    """Standard input ends when the parent does."""
    parent.read()
    os._exit(0)


def main() -> int:
    """Returns 0; what can't be compiled ahead is compiled when it is needed, and its error told there."""
    lower_priority()
    while_waiting()
    request: Request = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with, args=(sys.stdin.buffer,), daemon=True).start()
    if isinstance(request, NextSteps):
        next_steps(request)
    else:
        all_clicks(request)
    sys.stdout.flush()
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main())
