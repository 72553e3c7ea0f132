"""Series of pictures: what keeping photons from picture to picture saves on a camera's way, and how much pictures
flicker with the same random numbers and with new ones.

Flicker is the mean square of the difference of two successive pictures' noise over the sum of the mean squares of
both: 1 for independent noise, 0 for one that stands still. Noise is a picture less its own reference of many passes, in
the units of relMSE. What is left in the mean of all pictures, over one of them, tells the other side: noise that stands
still is not averaged away, neither by the eye nor by a temporal filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Target
from pmviewer.engine.frame import Frame
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.series.keys import orbits
from pmviewer.engine.series.render import missing
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import EPSILON
from pmviewer.settings.access import Settings, with_values

SCENE = "cornell_caustic"
PICTURES, PASSES = 6, 16
TRUTH = 64
"""Passes of a reference for each pass of a picture."""
SAVED = 1.3
"""CPU time of single pictures over that of a series of theirs, at least."""
STILL = 0.1
"""Flicker at most where only an object moves."""
SAME = 0.02
"""Relative difference up to which a pixel has not changed."""
METHODS = ("progressive", "gather")
F8 = NDArray[np.float64]
WAYS: Mapping[str, float | None] = {
    "an object moves elsewhere": None,
    "camera, 0.1° a picture": 0.1,
    "camera, 0.5°": 0.5,
    "camera, 2°": 2.0,
}


class Lab:
    """The scene at one size, and series of it."""

    def __init__(self, size: int, pool: WorkPool) -> None:
        self.opened, self.pool = open_scene(SCENE), pool
        self.small = {"camera.width": size, "camera.height": size, "estimate.radius": 0.03}

    def settings(self, values: Mapping[str, Any]) -> Settings:
        """With these values."""
        return with_values(Settings(), {**self.small, **values})

    def way(self, method: str, way: float | None, count: int, values: Mapping[str, Any]) -> list[Settings]:
        """Pictures of a camera that turns by so many degrees a picture, or of a ball that moves behind the other."""
        settings = self.settings({"render.method": method, **values})
        if way is not None:
            return orbits(self.opened.scene, settings, count, way * (count - 1))
        moves = np.linspace(0.0, 0.1, count)
        return [with_values(settings, {"edit.changes": {"object.5.move": (0.0, float(y), 0.0)}}) for y in moves]

    def pictures(self, settings: Sequence[Settings], share: bool = True) -> list[Frame]:
        """Rendered one after the other."""
        told = missing(self.opened, settings, self.pool, lambda text, part: None, lambda one: False, share=share)
        return [frame for _, frame in told if frame is not None]

    def images(self, settings: Sequence[Settings]) -> F8:
        """The same as radiance (n, h, w, 3)."""
        return np.array([frame.image() for frame in self.pictures(settings)], np.float64)


def flicker(noise: F8) -> float:
    """Of pictures' noise (n, …), see the module."""
    changes = np.mean((noise[1:] - noise[:-1]) ** 2)
    return float(changes / np.mean(noise[1:] ** 2 + noise[:-1] ** 2))


def left_in_mean(noise: F8) -> float:
    """The mean square of the mean of pictures' noise over that of one."""
    return float(np.mean(noise.mean(axis=0) ** 2) / np.mean(noise**2))


def unchanged(exact: F8) -> NDArray[np.bool_]:
    """Pixels (h, w) whose true value is the same in all pictures, within the noise of the references."""
    off = np.abs(exact - exact[0]) / (exact[0] + EPSILON)
    return np.asarray(off.max(axis=(0, 3)) < SAME)


def cpu_seconds(frames: Sequence[Frame]) -> float:
    """Of all pictures."""
    return sum(frame.statistics.cpu_seconds for frame in frames)


def saved(lab: Lab, method: str, passes: int) -> tuple[float, float, float]:
    """CPU seconds of the pictures of a camera's way: each by itself, with the first passes' photons kept, and as a
    series."""
    way = lab.way(method, 1.0, PICTURES, {"render.passes": passes, "photons.N": 150_000})
    alone = cpu_seconds(lab.pictures(way, share=False))
    store, some = StageStore(), []
    for settings in way:
        renderer = Renderer(lab.opened, settings, lab.pool, store)
        while not renderer.finished:
            renderer.step()
        some.append(renderer.frame(1))
    return alone, cpu_seconds(some), cpu_seconds(lab.pictures(way))


def run(quick: bool = False) -> BenchResult:
    """Time and flicker of both methods."""
    size, count, truth = (48, 3, 16) if quick else (128, PICTURES, TRUTH)
    pool = WorkPool()
    rows: list[list[str | float | int]] = []
    targets: list[Target] = []
    try:
        lab = Lab(size, pool)
        for method in METHODS:
            lab.pictures(lab.way(method, 1.0, 1, {"render.passes": 1}))  # compiles
            alone, some, series = saved(lab, method, 4 if quick else PASSES)
            rows.append([method, "CPU s: alone, four passes kept, all kept", alone, some, series])
            note = f"{method}: CPU time of {PICTURES} pictures of {PASSES} passes on a camera's way, alone over series"
            if not quick:
                targets.append(Target("series", alone / series, SAVED, "×", True, note))
            for name, way in WAYS.items():
                few: dict[str, Any] = {"render.passes": 2, "photons.N": 20_000}
                many = {"render.passes": 2 * truth, "photons.N": 20_000, "render.seed": 99}
                exact = lab.images(lab.way(method, way, count, many))
                same = lab.way(method, way, count, few)
                new = [with_values(one, {"render.seed": 10 + number}) for number, one in enumerate(same)]
                noises = [(lab.images(some) - exact) / np.sqrt(exact**2 + EPSILON) for some in (same, new)]
                if way is None:
                    noises = [noise[:, unchanged(exact)] for noise in noises]
                told = [flicker(noise) for noise in noises]
                kept = left_in_mean(noises[0])
                rows.append([method, f"flicker, {name}: same numbers, new ones, left in mean", *told, kept])
                if way is None:
                    note = f"{method}: flicker with the same numbers where {name}"
                    targets.append(Target("series", told[0], STILL, "", False, note))
    finally:
        pool.close()
    notes = [
        f"{SCENE}, {size} × {size}, {count} pictures; flicker of pictures of 2 passes of 20,000 photons, against "
        f"references of {2 * truth} passes; 'left in mean': of noise with the same numbers, in the mean of {count} "
        f"pictures (1/{count} = {1 / count:.2f} with new ones)",
    ]
    columns = ["method", "what", "1st", "2nd", "3rd"]
    return BenchResult("Series of pictures", columns, rows, targets, notes)
