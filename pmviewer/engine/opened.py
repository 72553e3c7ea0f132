"""An open scene: the description together with everything that is derived from it once."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from pmviewer.engine.hidden_lights import hidden_lights
from pmviewer.engine.memory import check_scene_memory
from pmviewer.photons.projection import Projection
from pmviewer.scene.analysis import SceneTraits, analyse
from pmviewer.scene.covered_emission import ignored_opacity, without_unseen_lights
from pmviewer.scene.description import Scene
from pmviewer.scene.flatten import FlatScene, flatten
from pmviewer.scene.load import load_scene
from pmviewer.scene.recentre import recentred

_uids = itertools.count(1)


@dataclass(frozen=True)
class OpenScene:
    """`source` is what the user named; `uid` tells scenes apart in caches. `projections` keeps projection maps by how
    they were asked for (`pmviewer.engine.projection`)."""

    scene: Scene
    flat: FlatScene
    traits: SceneTraits
    source: str
    uid: int = field(default_factory=lambda: next(_uids))
    projections: dict[tuple[str, bool], Projection | None] = field(default_factory=dict, compare=False, repr=False)


def open_scene(source: str | Path | Scene, parameters: Mapping[str, str] | None = None) -> OpenScene:
    """Load, check, move to the origin and flatten. Raises SceneError."""
    scene = source if isinstance(source, Scene) else load_scene(source, parameters or {})
    check_scene_memory(scene)
    scene = without_unseen_lights(recentred(scene))
    name = scene.name if isinstance(source, Scene) else str(source)
    flat = flatten(scene)
    said = (*hidden_lights(scene, flat), *ignored_opacity(scene))
    if said:
        scene = replace(scene, warnings=(*scene.warnings, *said))
    return OpenScene(scene, flat, analyse(scene), name)
