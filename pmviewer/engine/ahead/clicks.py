"""What a click would need: every setting changed alone, of which those remain that run something else, and a first
picture of every other kind of scene."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pmviewer.engine.auto.ready import ways
from pmviewer.engine.effects import facts_of
from pmviewer.engine.inspection import Wanted
from pmviewer.engine.inspector.report import Pinned
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare, steps_of
from pmviewer.engine.preview.previews import prepare_previews
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.engine.wanted import wanted_of
from pmviewer.errors import PmviewerError
from pmviewer.scene.analysis import SceneTraits
from pmviewer.scene.description import Scene
from pmviewer.scene.load import bundled_scenes, load_scene
from pmviewer.scene.miniature import miniature
from pmviewer.settings.access import SETTINGS, SettingInfo, Settings, get, with_values

FIRST = ("render", "estimate", "gather", "photons", "importance", "direct")
"""Groups of settings in the order in which they are most likely clicked; the others follow."""
PINNED = FIRST[:3]
"""Those that decide how photons are looked up."""
SIDE = 8
"""Pixels of the picture that a click is tried with, across and down."""
FEW = {
    "photons.N": 200,
    "importance.N": 100,
    "gather.rays": 4,
    "gather.cache_samples": 8,
    "gather.estimation_samples": 8,
}
"""No more than these where it is tried."""


@dataclass(frozen=True, eq=False)
class Click:
    """Settings, or a scene, one click away; `text` says which, "" for none. `pins`: and then a click on the picture."""

    text: str
    opened: OpenScene
    settings: Settings
    pins: bool = False

    def run(self, pool: WorkPool) -> None:
        """Render one small picture of the scene as the window would, with what its display asks for."""
        prepare(self.opened, self.settings, pool, lambda text, share: None)
        few = {path: most for path, most in FEW.items() if get(self.settings, path) > most}
        small = {"camera.width": SIDE, "camera.height": SIDE, **few}
        renderer = Renderer(self.opened, with_values(self.settings, small), pool, StageStore(0))
        renderer.coarse_frame(1)
        prepare_previews()
        renderer.step()
        pinned = Pinned(SIDE // 2, SIDE // 2) if self.pins else None
        renderer.frame(2, replace(wanted_of(renderer.facts), pixel=(SIDE // 2, SIDE // 2), pinned=pinned))


def clicks(opened: OpenScene, settings: Settings) -> list[Click]:
    """The settings as they are, with a pinned pixel, then each that is one click away and runs something that none
    before it runs; last a pixel pinned after such a click on what decides about look-ups."""
    seen: set[Hashable] = set()
    found = []
    for click in _all(opened, settings):
        try:
            needs = _needs(opened, click.settings)
        except PmviewerError:  # nothing that the scene can be seen with
            continue
        if needs not in seen:
            seen.add(needs)
            found.append(click)
    pinned = [replace(click, text=f"a pinned pixel, {click.text}", pins=True) for click in found if _looks_up(click)]
    return [*found, *pinned]


def _looks_up(click: Click) -> bool:
    """Whether it may change what the inspector runs."""
    return click.text.split(".")[0] in PINNED


@dataclass(frozen=True, eq=False)
class OtherKind:
    """A first picture of another kind of scene, which is opened no sooner: that compiles, too."""

    text: str
    scene: Scene
    settings: Settings

    def run(self, pool: WorkPool) -> None:
        """Open the scene and render one small picture of it."""
        Click(self.text, open_scene(self.scene), self.settings).run(pool)


def other_kinds(of_record: np.dtype, settings: Settings) -> list[OtherKind]:
    """A bundled scene's miniature for every other type of record that bundled scenes have."""
    seen, found = {of_record}, []
    for bundled in bundled_scenes():
        scene = miniature(load_scene(bundled.name))
        kind = type_of_record(scene)
        if kind not in seen:
            seen.add(kind)
            found.append(OtherKind(f"scenes like {bundled.name}", scene, settings))
    return found


class _Known(Exception):
    """The type of a scene's record is known, and nothing else is wanted."""


def type_of_record(scene: Scene) -> np.dtype:
    """Of what type the scene's record is when it is opened, without that."""

    def known(of_record: np.dtype, traits: SceneTraits) -> None:
        raise _Known(of_record)

    try:
        return open_scene(scene, on_type=known).flat.record.dtype
    except _Known as told:
        kind: np.dtype = told.args[0]
        return kind


def _needs(opened: OpenScene, settings: Settings) -> Hashable:
    """What decides about the kernels that run."""
    facts = facts_of(settings, opened.traits)
    wanted = wanted_of(facts)
    shown = replace(wanted, paths=min(wanted.paths, 1), fates=min(wanted.fates, 1), cells=None)
    keys = frozenset(step.key for step in steps_of(opened, settings))
    return replace(facts.plan, skipped=(), warnings=()), keys, shown if shown != Wanted() else None


def _all(opened: OpenScene, settings: Settings) -> Iterator[Click]:
    yield Click("", opened, settings, pins=True)
    order = sorted(SETTINGS.values(), key=lambda info: _rank(info.path))
    methods = [info for info in order if _rank(info.path) == 0]
    yield from _changed(opened, settings, methods)
    for way in ways(opened, settings):
        yield Click(f"automatic mode: {way.render.method}", opened, way)
    yield from _changed(opened, settings, order[len(methods) :])


def _changed(opened: OpenScene, settings: Settings, order: Iterable[SettingInfo]) -> Iterator[Click]:
    """Each of those settings changed alone."""
    for info in order:
        if info.stage in ("scene", "stop"):
            continue
        for value in _others(info, get(settings, info.path)):
            try:
                yield Click(_text(info, value), opened, with_values(settings, {info.path: value}))
            except PmviewerError:
                continue


def _rank(path: str) -> int:
    group = path.split(".")[0]
    return FIRST.index(group) if group in FIRST else len(FIRST)


def _others(info: SettingInfo, value: Any) -> list[Any]:
    """Values that a setting may be given by one click or drag: all of a choice, the ends of a range."""
    values: list[Any] = [*info.choices]
    if info.kind is bool:
        values = [not value]
    elif info.kind in (int, float):
        values = [end for end in (info.lower, info.upper) if end is not None]
    return [*values, *(["auto"] if info.auto else [])]


def _text(info: SettingInfo, value: Any) -> str:
    """Which setting, and what it becomes: of a number which end of its range."""
    if info.kind in (int, float) and value in (info.lower, info.upper):
        return f"{info.path}: {'least' if value == info.lower else 'most'}"
    return f"{info.path} = {('on' if value else 'off') if isinstance(value, bool) else value}"
