"""An open scene: the description together with everything that is derived from it once."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from pmviewer.engine.auto.bias import Bias
from pmviewer.engine.memory import check_scene_memory
from pmviewer.engine.stages.hidden_lights import hidden_lights
from pmviewer.engine.stages.sky_seen import SeenSky, seen_sky, sees_as
from pmviewer.photons.projection.aim import may_aim
from pmviewer.photons.projection.projection import Projection, aimed
from pmviewer.scene.analysis import SceneTraits, analyse
from pmviewer.scene.arrays.covered_emission import ignored_opacity, without_unseen_lights
from pmviewer.scene.arrays.flatten import FlatScene, bounding_sphere, flatten
from pmviewer.scene.arrays.tree_ahead import TreeAhead, tree_ahead
from pmviewer.scene.defaults.completion import completed
from pmviewer.scene.defaults.light_rigs import Rig
from pmviewer.scene.description import Scene
from pmviewer.scene.editing.apply import edited
from pmviewer.scene.load import read_scene
from pmviewer.scene.meshes.recentre import lies_far, recentred
from pmviewer.settings.access import Settings
from pmviewer.settings.edits import Edits

OnType = Callable[[np.dtype, SceneTraits], None]
"""Hears, while a scene is being opened, of what type its record will be and what is in it."""

BY_DEFAULT = ("auto", False)
"""The key of projection maps as settings have them by default: no trajectories for the caustic map alone."""
_uids = itertools.count(1)


def nobody(of_record: np.dtype, traits: SceneTraits) -> None:
    """Nobody needs to know."""


@dataclass(frozen=True)
class Arrangement:
    """What settings make of a file's content: by which lights it is seen, and what is edited."""

    rig: Rig = "auto"
    edits: Edits = field(default_factory=dict)


def arrangement_of(settings: Settings) -> Arrangement:
    """What these settings ask for."""
    return Arrangement(settings.light.rig, settings.edit.changes)


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
    whole: Scene | None = None
    """With camera and light, before it was edited and moved."""
    arrangement: Arrangement = field(default_factory=Arrangement)
    exposures: dict[str, float] = field(default_factory=dict, compare=False, repr=False)
    """In EV, by the name of the camera, as first pictures decided; empty where the scene has its own."""
    biases: dict[Hashable, Bias] = field(default_factory=dict, compare=False, repr=False)
    """What trials have measured, by the way of rendering (`pmviewer.engine.auto.bias.way_of`)."""
    projections: dict[tuple[str, bool], Projection | None] = field(default_factory=dict, compare=False, repr=False)
    seen_sky: SeenSky | None = field(default=None, compare=False, repr=False)
    """Which part of the sky is seen from where, for as long as the record points there."""

    def is_arranged(self, arrangement: Arrangement) -> bool:
        """Is it arranged like that? A scene that was no file has no other lights than its own."""
        own = self.arrangement
        return own.edits == arrangement.edits and (self.content is None or own.rig == arrangement.rig)

    def exposure(self, camera: str) -> float:
        """EV that the picture by that camera is shown with unless the user says otherwise; 0 until it is decided."""
        own = self.scene.exposure
        return self.exposures.get(camera, 0.0) if own is None else own


def open_scene(
    source: str | Path | Scene,
    parameters: Mapping[str, str] | None = None,
    arrangement: Arrangement = Arrangement(),
    on_type: OnType = nobody,
    search_paths: Sequence[Path] = (),
) -> OpenScene:
    """Load, add the camera that the file lacks and the lights of the rig, edit, check, move to the origin and flatten.
    A scene that is given instead of a file keeps its camera and lights. `search_paths` as for `read_scene`. Raises
    SceneError."""
    if isinstance(source, Scene):
        return _opened(source, source.name, None, replace(arrangement, rig="auto"), on_type)
    content = read_scene(source, parameters or {}, search_paths)
    check_scene_memory(content)
    stays = not arrangement.edits and not lies_far(content)
    with tree_ahead(content, wanted=stays and not content.cameras) as ahead:
        whole = completed(content, arrangement.rig)
        return _opened(whole, str(source), content, arrangement, on_type, ahead=ahead)


def rearranged(opened: OpenScene, arrangement: Arrangement) -> OpenScene:
    """The scene with other lights or edits, without reading its file again. Raises SceneError."""
    if opened.is_arranged(arrangement):
        return opened
    whole = opened.whole
    assert whole is not None
    if opened.content is None or arrangement.rig == opened.arrangement.rig:
        arrangement = replace(arrangement, rig=opened.arrangement.rig)
        again = _opened(whole, opened.source, opened.content, arrangement, like=opened)
        return replace(again, exposures=opened.exposures)  # edits shall be seen, not adapted to
    return _opened(completed(opened.content, arrangement.rig), opened.source, opened.content, arrangement)


def is_edited(before: OpenScene | None, after: OpenScene) -> bool:
    """Is it the scene from before, with other edits?"""
    return before is not None and before.whole is after.whole


def expected_traits(scene: Scene) -> SceneTraits:
    """Of a scene that isn't flattened yet. Photons that may aim do so unless lights' own maps spare as many."""
    return replace(analyse(scene), aims=may_aim(scene, bounding_sphere(scene)[1]))


def opened_of(
    scene: Scene, flat: FlatScene, expected: SceneTraits, source: str, like: OpenScene | None = None, **more: Any
) -> OpenScene:
    """The flattened scene, of which those traits were expected, with `more` fields. Maps that tell whether photons aim
    are kept for the light pass. What is seen of the sky may be as in the scene `like` it."""
    made = aimed(flat, confined=not expected.lit_media) if expected.aims else None
    traits = replace(expected, aims=made is not None)
    seen = like.seen_sky if like is not None and sees_as(flat, like.flat) else seen_sky(scene, flat)
    if seen is not None:
        seen.store(flat.record[0])
    maps: dict[tuple[str, bool], Projection | None] = {} if made is None else {BY_DEFAULT: made}
    return OpenScene(scene, flat, traits, source, projections=maps, seen_sky=seen, **more)


def _opened(
    whole: Scene,
    source: str,
    content: Scene | None,
    arrangement: Arrangement,
    on_type: OnType = nobody,
    like: OpenScene | None = None,
    ahead: TreeAhead | None = None,
) -> OpenScene:
    scene = edited(whole, arrangement.edits)
    check_scene_memory(scene)
    scene = without_unseen_lights(recentred(scene))
    traits = expected_traits(scene)
    flat = flatten(
        scene, lambda of_record: on_type(of_record, traits), None if like is None else like.flat, ahead=ahead
    )
    said = (*hidden_lights(scene, flat), *ignored_opacity(scene), *flat.said)
    if said:
        scene = replace(scene, warnings=(*scene.warnings, *said))
    return opened_of(scene, flat, traits, source, like, content=content, whole=whole, arrangement=arrangement)
