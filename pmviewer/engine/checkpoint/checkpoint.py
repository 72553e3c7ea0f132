"""A checkpoint: the state of a renderer with what it is of, in one file.

`write_checkpoint` replaces the file atomically; `read_checkpoint` reads it whole or not at all; `Checkpoint.check`
refuses what is of another scene, program or setting, and says what differs.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from weakref import WeakKeyDictionary

from pmviewer.engine.checkpoint.identity import (
    decisive,
    differences,
    other_bits,
    other_program,
    other_scene,
    other_settings,
    scene_hashes,
)
from pmviewer.engine.program import program
from pmviewer.engine.renderer import Renderer
from pmviewer.errors import OutputError, SceneError
from pmviewer.output.array_file import read_arrays, write_arrays
from pmviewer.output.checkpoint_header import KIND, SUFFIX, Header, header_of
from pmviewer.settings.access import Settings
from pmviewer.state import State


@dataclass(frozen=True)
class Job:
    """What a renderer does not know of its job: the scene's file as it was named, its parameters, the settings as they
    were `asked` for, where automatic mode has chosen others, and the seconds that it took to choose."""

    scene: str
    parameters: Mapping[str, str] = field(default_factory=dict)
    asked: Settings | None = None
    trial_seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """What was read of a file. `state` is whole: its checksums hold."""

    path: Path
    header: Header
    state: State

    def check(self, renderer: Renderer) -> str:
        """What may make the last bits of the picture differ from here on, "" for nothing.

        Raises SceneError, naming what differs, where the renderer is of another scene, program or setting.
        """
        head, now = self.header, program()
        found = (
            other_program(head.program, now),
            other_settings(decisive(head.settings), decisive(renderer.settings)),
            other_scene(head.hashes, _hashes(renderer)),
        )
        if said := differences(found):
            raise SceneError(
                f"This checkpoint is of another rendering: {said}.", self.path, hint="Render without --resume."
            )
        return other_bits(head.program, now)

    def resume(self, renderer: Renderer) -> None:
        """Go on with a renderer that `check` lets pass. Raises SceneError where the state is none of such a renderer,
        which is unusable then."""
        try:
            renderer.restore(self.state)
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise SceneError(f"This checkpoint does not fit its own settings ({error}).", self.path) from None


def write_checkpoint(path: Path, renderer: Renderer, job: Job, *, locked: bool = False) -> int:
    """Write one between two passes; returns its size in bytes. On any failure the file before is whole. `locked`: by a
    lock nobody else writes it. Raises OutputError."""
    settings = renderer.settings
    header = Header(
        scene=job.scene,
        scene_name=renderer.scene.scene.name,
        parameters=dict(job.parameters),
        passes=renderer.passes,
        seconds=renderer.tally.seconds,
        width=renderer.camera.width,
        height=renderer.camera.height,
        when=time.time(),
        settings=settings,
        asked=job.asked or settings,
        trial_seconds=job.trial_seconds,
        program=program(),
        hashes=_hashes(renderer),
    )
    try:
        return write_arrays(path, SUFFIX, header.tree(), renderer.state(), alone=locked)
    except MemoryError:
        raise OutputError(f"{path}: not enough memory to write a checkpoint.") from None


def read_checkpoint(path: str | Path) -> Checkpoint:
    """Read one whole. Raises SceneError for a file that is missing, damaged or no checkpoint."""
    about, state = read_arrays(path, KIND)
    return Checkpoint(Path(path), header_of(about, path), state)


_hashes_of: WeakKeyDictionary[Renderer, dict[str, str]] = WeakKeyDictionary()


def _hashes(renderer: Renderer) -> dict[str, str]:
    """Of the renderer's scene, which never changes; those of large scenes take a while."""
    if renderer not in _hashes_of:
        _hashes_of[renderer] = scene_hashes(renderer.scene, renderer.camera, renderer.render_camera)
    return _hashes_of[renderer]
