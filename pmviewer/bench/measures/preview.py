"""What the window shows after a change, at 0.1, 0.25, 0.5, 1 and 3 seconds, as error against the converged picture
(P18).

A session refines a scene with something changed; then it is changed back, and every frame that is published from there
on is kept with the time of two cores that do nothing else: half of the process's CPU time and half of the session's own
thread's, which works while the other core waits. The clock of a machine with other users would tell of them. A window
adds up to one of its frames. Coarse frames are shown in the picture's size by bilinear interpolation, as the window's
GPU does it, unless a preview is shown in their place.

The converged picture is rendered twice with other random numbers, A and B; (x − A)(x − B) has the squared error of x as
mean, whatever noise is left in A and B.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import BenchResult, Cell, Target
from pmviewer.engine.auto.choose import Goal, choose
from pmviewer.engine.frame import Frame
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.session import Session
from pmviewer.engine.store import StageStore
from pmviewer.errors import PmviewerError
from pmviewer.output.metric import EPSILON
from pmviewer.render.camera import resolve_camera
from pmviewer.settings.access import Settings, with_values

CACHED = {"render.method": "gather", "gather.cache": "on"}
SCENES: dict[str, tuple[dict[str, Any], float]] = {
    "cornell_caustic": ({}, 40.0),
    "rooms_10x10": (CACHED, 45.0),
    "office": (CACHED, 70.0),
    "museum": (CACHED, 45.0),
}
"""How the converged pictures are made, beside the defaults, and the CPU seconds of each."""
SIZE, QUICK_SIZE, QUICK_SHARE = 512, 256, 0.15
TIMES = (0.1, 0.25, 0.5, 1.0, 3.0)
BOUNDS = {0.25: 0.02, 0.5: 0.01, 3.0: 0.003}
SEEDS = 1001, 2002
BEFORE = 4
"""Passes that the picture has when it is changed."""
ASIDE = 0.06
"""How far the camera is moved, relative to its distance from its target."""
MODES = (
    ("defaults", "off"),
    ("defaults", "coarse"),
    ("defaults", "denoised"),
    ("automatic", "off"),
    ("automatic", "denoised"),
)
"""Settings, and `display.preview`."""
WORKER = "pmviewer session"
F4 = NDArray[np.float32]
F8 = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Truth:
    """Two converged pictures."""

    a: F8
    b: F8

    def error(self, image: F4) -> float:
        """relMSE without their noise; it may be below 0 where there is hardly any."""
        squares = ((self.a + self.b) / 2) ** 2 + EPSILON
        return float(((image - self.a) * (image - self.b) / squares).mean())


class _Watch:
    """Keeps what a session publishes, with the time since `begin`, for its `on_update`."""

    def __init__(self, session: Session) -> None:
        self._session, self._process, self._worker, self._version = session, 0.0, 0.0, -1
        self._spent = 0.0
        self.seen: list[tuple[float, Frame]] = []
        self._lock = threading.Lock()
        session.on_update = self.note

    def begin(self, settings: Settings) -> None:
        """Change the settings, and count from now on."""
        with self._lock:
            self._process, self._worker, self.seen = time.process_time(), self._spent, []
            self._version = self._session.set(settings)

    def note(self) -> None:
        """In any thread; the session's own tells what it has spent."""
        if threading.current_thread().name != WORKER:
            return
        with self._lock:
            self._spent = time.thread_time()
            frame = self._session.frame
            if frame is None or frame.version < self._version or (self.seen and self.seen[-1][1] is frame):
                return
            self.seen.append((self.now(), frame))

    def now(self) -> float:
        """Seconds on two cores since the change."""
        return (time.process_time() - self._process + self._spent - self._worker) / 2


def shown(frame: Frame, size: tuple[int, int]) -> F4:
    """(h, w, 3) what the window shows of the frame's beauty in its full size (w, h)."""
    image = frame.beauty if frame.preview is None else frame.preview.image
    if image.shape[:2] == (size[1], size[0]):
        return image
    for axis, large in ((0, size[1]), (1, size[0])):
        image = _stretched(image, axis, large)
    return image


def _stretched(image: F4, axis: int, large: int) -> F4:
    """Linear interpolation along an axis, from middles of pixels to middles of pixels."""
    small = image.shape[axis]
    place = np.clip((np.arange(large) + 0.5) * small / large - 0.5, 0, small - 1)
    low = np.minimum(place.astype(int), max(small - 2, 0))
    share = (place - low).astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
    return np.take(image, low, axis) * (1 - share) + np.take(image, np.minimum(low + 1, small - 1), axis) * share


def truth_of(opened: OpenScene, size: int, budget: float, folder: Path | None) -> _Truth:
    """The scene's converged pictures, from the folder where they are kept already."""
    values, _ = SCENES[opened.scene.name]
    pictures = []
    for seed in SEEDS:
        kept = folder / f"{opened.scene.name}-{size}-{budget:g}-{seed}.npy" if folder is not None else None
        if kept is None or not kept.exists():
            picture = _converged(opened, size, budget, {**values, "render.seed": seed})
            if kept is not None:
                kept.parent.mkdir(parents=True, exist_ok=True)
                np.save(kept, picture)
        else:
            picture = np.load(kept)
        pictures.append(picture.astype(np.float64))
    return _Truth(*pictures)


def _converged(opened: OpenScene, size: int, budget: float, values: Mapping[str, Any]) -> F4:
    settings = with_values(Settings(), {"camera.width": size, "camera.height": size, **values})
    pool = WorkPool()
    try:
        prepare(opened, settings, pool, lambda text, share: None)
        renderer = Renderer(opened, settings, pool, StageStore(1 << 28))
        while renderer.tally.cpu_seconds < budget:
            renderer.step()
        return renderer.frame(0).beauty
    finally:
        pool.close()


def changes(opened: OpenScene) -> dict[str, dict[str, Any]]:
    """What is changed back, by name: the camera, a light, a setting."""
    pose = resolve_camera(opened.scene, Settings().camera)
    right = pose.axes()[0]
    step = ASIDE * float(np.linalg.norm(np.subtract(pose.target, pose.origin))) * right
    moved = {"camera.origin": tuple(np.add(pose.origin, step)), "camera.target": tuple(np.add(pose.target, 0.5 * step))}
    return {
        "camera": moved,
        "light": {"edit.changes": {"light.1.power": (0.5,)}},
        "setting": {"photons.N": 250_000},
    }


def measured(name: str, settings: Settings, truth: _Truth, size: int) -> dict[str, list[tuple[float, float, str]]]:
    """By change, for each of TIMES: what is shown then has which error, how old it is, and what it is. Raises
    PmviewerError when the session fails."""
    found: dict[str, list[tuple[float, float, str]]] = {}
    session = Session(2, settings)
    watch = _Watch(session)
    try:
        session.open(name)
        _wait(session)
        assert session.opened_scene is not None
        for change, values in changes(session.opened_scene).items():
            for _ in range(1 if found else 2):  # the first time kernels are loaded
                session.set(with_values(settings, values))
                session.resume()
                _wait(session)
                before = session.frame
                watch.begin(settings)
                while watch.now() < TIMES[-1] and session.status.state != "failed":
                    time.sleep(0.005)
            session.pause()
            assert before is not None
            found[change] = [_at(when, watch.seen, before, truth, size) for when in TIMES]
    finally:
        session.close()
    return found


def _wait(session: Session) -> None:
    if not session.wait(passes=BEFORE, timeout=600):
        raise PmviewerError(f"The session did not get there: {session.status.text}")


def _at(
    when: float, seen: list[tuple[float, Frame]], before: Frame, truth: _Truth, size: int
) -> tuple[float, float, str]:
    """What is shown at that time: its error, since when, and what it is."""
    there = [(then, frame) for then, frame in seen if then <= when]
    then, frame = there[-1] if there else (0.0, replace(before, preview=None))
    what = "the picture before" if not there else "coarse" if frame.coarse else f"pass {frame.statistics.passes}"
    return truth.error(shown(frame, (size, size))), then, what if frame.preview is None else frame.preview.caption


def run(quick: bool = False, scenes: int | None = None, keep: Path | None = None) -> BenchResult:
    """A row for each scene, mode, change and time. `scenes`: how many of SCENES; the folder `keep` has the converged
    pictures from run to run."""
    size, share = (QUICK_SIZE, QUICK_SHARE) if quick else (SIZE, 1.0)
    rows: list[list[Cell]] = []
    targets: list[Target] = []
    for name in list(SCENES)[: 1 if quick else scenes]:
        opened = open_scene(name)
        print(f"{name}: the converged pictures", file=sys.stderr, flush=True)
        truth = truth_of(opened, size, share * SCENES[name][1], keep)
        base = with_values(Settings(), {"camera.width": size, "camera.height": size, "render.passes": 100_000})
        for chosen, preview in MODES:
            values = _chosen(opened, base) if chosen == "automatic" else {}
            settings = with_values(base, {**values, "display.preview": preview})
            mode = f"{chosen}, preview {preview}"
            print(f"{name}: {mode}", file=sys.stderr, flush=True)
            found = measured(name, settings, truth, size)
            for change, errors in found.items():
                for when, (error, then, what) in zip(TIMES, errors, strict=True):
                    rows.append([name, mode, change, when, error, then, what])
            for when, bound in BOUNDS.items():
                worst = max((errors[TIMES.index(when)][0], change) for change, errors in found.items())
                note = f"{name}, {mode}: relMSE of what is shown after {when:g} s, worst change: {worst[1]}"
                targets.append(Target("P18", worst[0], bound, "", False, note))
    columns = ["scene", "mode", "change", "s after it", "relMSE shown", "shown since", "what"]
    notes = [
        f"{size}×{size}, two threads; seconds are those of two cores that do nothing else, by CPU times",
        "previews are no estimates: rows that name one say what it is",
    ]
    return BenchResult("What the window shows after a change", columns, rows, targets, notes)


def _chosen(opened: OpenScene, settings: Settings) -> dict[str, Any]:
    pool = WorkPool(2)
    try:
        return dict(choose(opened, settings, Goal(), pool, lambda text, share: None).values)
    finally:
        pool.close()
