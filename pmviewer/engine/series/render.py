"""One picture after the other, each by settings of its own, of one scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from pmviewer.engine.frame import Frame
from pmviewer.engine.opened import OpenScene, arrangement_of, rearranged
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.engine.wanted import wanted_of
from pmviewer.settings.access import Settings

Tell = Callable[[str, float], None]


def series(opened: OpenScene, pictures: Sequence[Settings], pool: WorkPool, tell: Tell) -> Iterator[Frame]:
    """The finished frames, in order; `tell(text, share)` hears of each pass.

    Random numbers are the same in all of them: what differs is what the settings change. An exposure that the first
    picture decides is that of all. Photons and maps are kept from picture to picture where they don't change. Raises
    PmviewerError for what can't be rendered, Cancelled when the pool is cancelled.
    """
    store = StageStore()
    for number, settings in enumerate(pictures):
        before, opened = opened, rearranged(opened, arrangement_of(settings))
        if opened is not before:
            store.clear()
            opened.exposures.update(before.exposures)

        def said(text: str, share: float, number: int = number) -> None:
            tell(f"picture {number + 1} of {len(pictures)}, {text}", (number + share) / len(pictures))

        prepare(opened, settings, pool, lambda text, share: said(text, 0.0))
        renderer = Renderer(opened, settings, pool, store)
        if number == 0 and opened.scene.exposure is None and settings.display.exposure == "auto":
            renderer.coarse_frame(0)
        while not renderer.finished:
            said(f"pass {renderer.passes + 1}", min(renderer.passes / settings.render.passes, 1.0))
            renderer.step()
        yield renderer.frame(1, wanted_of(renderer.facts))
