"""An open scene: the description together with everything that is derived from it once."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from pmviewer.engine.memory import check_scene_memory
from pmviewer.engine.stages.hidden_lights import hidden_lights
from pmviewer.photons.projection.projection import Projection
from pmviewer.scene.analysis import SceneTraits, analyse
from pmviewer.scene.arrays.covered_emission import ignored_opacity, without_unseen_lights
from pmviewer.scene.arrays.flatten import FlatScene, flatten
from pmviewer.scene.defaults.completion import completed
from pmviewer.scene.defaults.light_rigs import Rig
from pmviewer.scene.description import Scene
from pmviewer.scene.load import read_scene
from pmviewer.scene.meshes.recentre import recentred

OnType = Callable[[np.dtype, SceneTraits], None]
"""Hears, while a scene is being opened, of what type its record will be and what is in it."""

_uids = itertools.count(1)


def nobody(of_record: np.dtype, traits: SceneTraits) -> None:
    """Nobody needs to know."""


@dataclass(frozen=True)
class OpenScene:
    """`source` is what the user named; `uid` tells scenes apart in stage stores. `projections` keeps projection maps by
    how they were asked for (`pmviewer.engine.stages.projection`)."""

    scene: Scene
    flat: FlatScene
    traits: SceneTraits
    source: str
    uid: int = field(default_factory=lambda: next(_uids))
    content: Scene | None = None
    """What was in the file, before camera and light were added; None for a scene that was no file."""
    rig: Rig = "auto"
    """By which lights the file is seen."""
    exposures: dict[str, float] = field(default_factory=dict, compare=False, repr=False)
    """In EV, by the name of the camera, as first pictures decided; empty where the scene has its own."""
    projections: dict[tuple[str, bool], Projection | None] = field(default_factory=dict, compare=False, repr=False)

    def exposure(self, camera: str) -> float:
        """EV that the picture by that camera is shown with unless the user says otherwise; 0 until it is decided."""
        own = self.scene.exposure
        return self.exposures.get(camera, 0.0) if own is None else own


def open_scene(
    source: str | Path | Scene,
    parameters: Mapping[str, str] | None = None,
    rig: Rig = "auto",
    on_type: OnType = nobody,
    search_paths: Sequence[Path] = (),
) -> OpenScene:
    """Load, add the camera that the file lacks and the lights of the rig, check, move to the origin and flatten. A
    scene that is given instead of a file is taken as it is. `search_paths` as for `read_scene`. Raises SceneError."""
    if isinstance(source, Scene):
        return _opened(source, source.name, None, "auto", on_type)
    content = read_scene(source, parameters or {}, search_paths)
    check_scene_memory(content)
    return _opened(completed(content, rig), str(source), content, rig, on_type)


def relit(opened: OpenScene, rig: Rig) -> OpenScene:
    """The scene with other lights, without reading its file again. Raises SceneError."""
    if opened.content is None:
        return opened
    return _opened(completed(opened.content, rig), opened.source, opened.content, rig)


def _opened(scene: Scene, source: str, content: Scene | None, rig: Rig, on_type: OnType = nobody) -> OpenScene:
    check_scene_memory(scene)
    scene = without_unseen_lights(recentred(scene))
    traits = analyse(scene)
    flat = flatten(scene, lambda of_record: on_type(of_record, traits))
    said = (*hidden_lights(scene, flat), *ignored_opacity(scene))
    if said:
        scene = replace(scene, warnings=(*scene.warnings, *said))
    return OpenScene(scene, flat, traits, source, content=content, rig=rig)
