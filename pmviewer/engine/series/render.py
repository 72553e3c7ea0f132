"""One picture after the other, each by settings of its own, of one scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from pmviewer.engine.frame import Frame
from pmviewer.engine.opened import OpenScene, arrangement_of, rearranged
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import BUDGET, StageStore
from pmviewer.engine.wanted import wanted_of
from pmviewer.resources import available_memory
from pmviewer.settings.access import Settings

Tell = Callable[[str, float], None]
Steps = Callable[[Renderer], AbstractContextManager[Callable[[], object]]]
"""Gives what renders a renderer's next pass into its film, wherever it does."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a series before it is rendered: its `number` from 1, the scene as it is edited, its settings, and
    the exposure in EV that it is shown with."""

    number: int
    opened: OpenScene
    settings: Settings
    exposure: float


@contextmanager
def here(renderer: Renderer) -> Iterator[Callable[[], object]]:
    """Passes are rendered by this process."""
    yield renderer.step


def series(opened: OpenScene, pictures: Sequence[Settings], pool: WorkPool, tell: Tell) -> Iterator[Frame]:
    """The finished frames, in order; `tell(text, share)` hears of each pass.

    Random numbers are the same in all of them: what differs is what the settings change. An exposure that the first
    picture decides is that of all. Photons and maps are kept from picture to picture where they don't change. Raises
    PmviewerError for what can't be rendered, Cancelled when the pool is cancelled.
    """
    for _, frame in missing(opened, pictures, pool, tell, lambda picture: False):
        assert frame is not None
        yield frame


def missing(
    opened: OpenScene,
    pictures: Sequence[Settings],
    pool: WorkPool,
    tell: Tell,
    is_there: Callable[[Picture], bool],
    steps: Steps = here,
    share: bool = True,
) -> Iterator[tuple[Picture, Frame | None]]:
    """The same with what each is a picture of; None for those that are there already, which are not rendered. With
    `share` false nothing is kept from picture to picture, so that their times can be compared."""
    store = StageStore(0 if not share else max(BUDGET, (available_memory() or 0) // 4))
    for number, settings in enumerate(pictures):
        before, opened = opened, rearranged(opened, arrangement_of(settings))
        if opened is not before:
            store.clear()
            opened.exposures.update(before.exposures)

        def said(text: str, share: float, number: int = number) -> None:
            tell(f"picture {number + 1} of {len(pictures)}, {text}", (number + share) / len(pictures))

        renderer = None
        if number == 0 and opened.scene.exposure is None and settings.display.exposure == "auto":
            renderer = _prepared(opened, settings, pool, store, said)
            renderer.coarse_frame(0)
        picture = Picture(number + 1, opened, settings, shown_with(opened, settings))
        if is_there(picture):
            yield picture, None
            continue
        others = pictures[number + 1 : number + 2]
        keep = any(_light_alike(settings, other) for other in others)
        yield picture, _picture(renderer or _prepared(opened, settings, pool, store, said), said, steps, keep)


def shown_with(opened: OpenScene, settings: Settings) -> float:
    """The exposure, in EV, of a picture by these settings."""
    asked = settings.display.exposure
    return opened.exposure(settings.camera.name) if asked == "auto" else float(asked)


def _prepared(opened: OpenScene, settings: Settings, pool: WorkPool, store: StageStore, said: Tell) -> Renderer:
    prepare(opened, settings, pool, lambda text, share: said(text, 0.0))
    return Renderer(opened, settings, pool, store)


def _light_alike(one: Settings, other: Settings) -> bool:
    """Whether both pictures may have the same photons."""
    same_scene = arrangement_of(one) == arrangement_of(other)
    return same_scene and (one.photons, one.render.seed) == (other.photons, other.render.seed)


def _picture(renderer: Renderer, said: Tell, steps: Steps, keep: bool) -> Frame:
    """The finished frame of one picture; `keep`: the next one may have use for the photons of all its passes."""
    with steps(renderer) as step:
        while not renderer.finished:
            said(f"pass {renderer.passes + 1}", min(renderer.passes / renderer.settings.render.passes, 1.0))
            before = renderer.store.bytes
            step()
            if keep:
                _make_room(renderer.store, renderer.passes, renderer.store.bytes - before)
    return renderer.frame(1, wanted_of(renderer.facts))


def _make_room(store: StageStore, done: int, needed: int) -> None:
    """After a pass whose photons and maps needed so many bytes, keep those of the next one if they fit, too. More would
    drive each other out: every picture asks for the first pass first."""
    if needed > 0:
        store.passes = max(store.passes, done + 1) if store.bytes + needed <= store.budget else done
