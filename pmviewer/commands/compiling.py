"""Compiling ahead for the window: what its first click would need."""

from __future__ import annotations

from functools import partial

from pmviewer.engine.ahead.ahead import finished_mark, mark
from pmviewer.engine.ahead.helper import Helper
from pmviewer.engine.ahead.requests import Clicks
from pmviewer.engine.opened import open_scene
from pmviewer.errors import PmviewerError
from pmviewer.progress import available_threads
from pmviewer.scene.load import load_scene
from pmviewer.scene.miniature import miniature
from pmviewer.settings.access import Settings


def compile_clicks(scene: str) -> None:
    """Compile what a click in that scene's window needs, another kind of scene too, in as many processes as there are
    processors, with a line for each part. Nothing is done where all was compiled before. Raises PmviewerError when a
    process failed."""
    settings, processes = Settings(), available_threads()
    small = miniature(load_scene(scene))
    of_record = open_scene(small).flat.record.dtype
    done = finished_mark(of_record, settings)
    if done.exists():
        return
    helpers = [Helper() for _ in range(processes)]
    for offset, helper in enumerate(helpers):
        helper.ask(Clicks(small, of_record, settings, processes, offset), partial(_tell, helper))
    for helper in helpers:
        helper.wait()
    if not all(helper.finished for helper in helpers):
        raise PmviewerError("Some kernels were not compiled ahead; they will be when they are needed.")
    mark(done)


def _tell(helper: Helper) -> None:
    progress = helper.progress
    if progress is not None:
        print(f"compiling {progress.text or 'what every picture needs'}", flush=True)
