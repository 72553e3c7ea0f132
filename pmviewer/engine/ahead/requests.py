"""What a helping process is asked to compile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pmviewer.scene.analysis import SceneTraits
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings


@dataclass(frozen=True, eq=False)
class NextSteps:
    """The eye pass of a scene whose tree is still being built: `record` is its type."""

    record: np.dtype
    traits: SceneTraits
    settings: Settings


@dataclass(frozen=True, eq=False)
class Clicks:
    """What is one click away from these settings of a scene: its miniature, and the type of its record, which the
    miniature must share; other kinds of scenes are a click away too. `every` and `offset`: of all that, one of so
    many."""

    scene: Scene
    record: np.dtype
    settings: Settings
    every: int = 1
    offset: int = 0


Request = NextSteps | Clicks
