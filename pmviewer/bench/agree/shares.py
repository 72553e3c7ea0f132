"""Which methods a scene is rendered by: the main ones all, of the others one, so that many scenes cover all.

The lot is drawn from the camera's field of view, which nobody chose and simpler scenes keep: a scene that is shrunk is
asked the same questions all the way.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pmviewer.bench.agree.generate import disperses
from pmviewer.bench.agree.materials import is_mapped
from pmviewer.bench.agree.media import emits, has_media
from pmviewer.bench.agree.ours import METHODS, THIN_GLASS, WEIGHTED
from pmviewer.bench.agree.tree import Node, innermost, shapes_of

MAIN = ("gather", "progressive")
"""Photon methods that every scene is rendered by. Others may be compared with the last of them."""
LOTS = ("nearest", "estimation", "virtual", "weighted")
"""What a scene has one of; `weighted` stands for one of WEIGHTED."""
PANES, SCATTERING = 2, 2
"""One in so many scenes with panes has thin glass, one in so many asks for paths of one scattering."""


def asked_methods(scene: Node) -> Iterator[str]:
    """The photon methods that a scene is rendered by. One with media, of which there are few, has all but one: of the
    weighted estimators the single step, since whole paths weigh nothing there."""
    lot, weighted, pane, _ = _drawn(scene)
    of_media = has_media(scene)
    yield from MAIN
    for name in LOTS if of_media else (LOTS[lot % len(LOTS)],):
        yield name if name in METHODS else "single step" if of_media else WEIGHTED[weighted % len(WEIGHTED)]
    if has_panes(scene) and not (disperses(scene) or emits(scene)) and pane % PANES == 0:
        yield from THIN_GLASS


def asks_one_scattering(scene: Node) -> bool:
    """Whether paths of one scattering are compared, too."""
    return bool(_drawn(scene)[3] % SCATTERING == 0)


def _drawn(scene: Node) -> list[int]:
    return [int(x) for x in np.random.SeedSequence(round(1e4 * scene["camera"]["fov"])).generate_state(4)]


def has_panes(scene: Node) -> bool:
    """Whether there is thin glass; a map around it tilts what it reflects, which rays straight through don't see."""
    bsdfs = [shape["bsdf"] for shape in shapes_of(scene) if "bsdf" in shape]
    panes = [bsdf for bsdf in bsdfs if innermost(bsdf)["type"] == "thindielectric"]
    return bool(panes) and not any(map(is_mapped, panes))
