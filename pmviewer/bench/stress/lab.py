"""What stress cases have in common: rendering from independent seeds, and judging the mean against its truth."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr

from pmviewer.engine.frame import Frame
from pmviewer.engine.opened import OpenScene, open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.errors import PmviewerError
from pmviewer.scene.description import Scene
from pmviewer.settings.access import Settings, with_values

SIGNIFICANCE = 1e-5
"""Below this a mean is not the expected one. Of some hundred and fifty means chance makes one fail in 700 seeds."""
ROUNDING = 2e-4
"""Relative difference of means that float32 and 16-bit powers explain where nothing varies."""
SEEDS = 48
"""Of which means and standard errors are made."""
SMALL = {"photons.N": 8000, "photons.sequence": "independent", "camera.width": 16, "camera.height": 16}
"""Settings of all cases unless they change them: independent photons have standard errors."""


@dataclass(frozen=True)
class Outcome:
    """A mean over independent seeds with its standard error, what it should be, and what the program said.

    `bias` is the part of `expected` by which the method differs from the truth and why, "" for an unbiased one. A case
    without a number has `expected` None: it is right when it is finite and, where it makes no sense, a sentence is
    `said`."""

    value: float = float("nan")
    error: float = 0.0
    expected: float | None = None
    expected_error: float = 0.0
    samples: int = SEEDS
    finite: bool = True
    bias: str = ""
    said: tuple[str, ...] = ()
    problem: str = ""
    """What else is wrong; "" for nothing."""

    @property
    def agrees(self) -> bool:
        """Is the mean the expected one, by a t-test?"""
        if self.expected is None:
            return True
        off = abs(self.value - self.expected) - ROUNDING * abs(self.expected)
        if not off > 0:
            return bool(np.isfinite(self.value))
        spread = float(np.hypot(self.error, self.expected_error))
        return bool(spread > 0 and 2 * stdtr(self.samples - 1, -off / spread) > SIGNIFICANCE)


@dataclass(frozen=True)
class Case:
    """`truth` says where the expectation comes from. A `nonsense` case has to be answered with a sentence."""

    group: str
    name: str
    truth: str
    run: Callable[[Lab], Outcome]
    nonsense: bool = False
    long: bool = False
    """Left out by `--quick`; it takes much time or memory, and runs alone."""


@dataclass(frozen=True)
class Row:
    """A case that has been run: seconds by the clock and of all processors, peak memory in MiB above what was held
    before."""

    case: Case
    outcome: Outcome
    seconds: float
    cpu: float
    memory: float

    @property
    def wrong(self) -> str:
        """What is wrong, "" for nothing."""
        o = self.outcome
        if o.problem:
            return o.problem
        if not o.finite:
            return "not finite"
        if self.case.nonsense and not o.said:
            return "silent"
        return "" if o.agrees else "off"

    @property
    def verdict(self) -> str:
        """What is wrong, or why nothing is: nonsense was answered in words, a bias is as stated, or the mean agrees."""
        return self.wrong or ("said" if self.case.nonsense else "biased as stated" if self.outcome.bias else "ok")


@dataclass
class Lab:
    """Renders scenes on its own threads, cases that don't say otherwise from so many seeds. `said` collects the
    sentences of the case that runs."""

    pool: WorkPool
    seeds: int = SEEDS
    said: list[str] = field(default_factory=list)
    _known: dict[Any, Outcome] = field(default_factory=dict)

    def once(self, key: Any, measure: Callable[[], Outcome]) -> Outcome:
        """An outcome that several cases are compared with, measured for the first of them."""
        if key not in self._known:
            self._known[key] = measure()
        return self._known[key]

    def open(self, scene: Scene | OpenScene) -> OpenScene:
        """The scene, with its warnings heard."""
        opened = scene if isinstance(scene, OpenScene) else open_scene(scene)
        self.said += [s for s in opened.scene.warnings if s not in self.said]
        self.said += [f"{n} × {what} left out" for what, n in opened.scene.dropped.items()]
        return opened

    def renderer(self, scene: Scene | OpenScene, passes: int = 1, **values: Any) -> Renderer:
        """After that many passes of small pictures; `values` by setting, "__" for dots."""
        opened = self.open(scene)
        settings = with_values(Settings(), SMALL | {k.replace("__", "."): v for k, v in values.items()})
        prepare(opened, settings, self.pool, lambda text, share: None)
        made = Renderer(opened, settings, self.pool, StageStore(0))
        for _ in range(passes):
            made.step()
        return made

    def frame(self, renderer: Renderer) -> Frame:
        """Its picture, with its warnings heard."""
        frame = renderer.frame(0)
        self.said += [s for s in frame.statistics.warnings if s not in self.said]
        return frame

    def means(
        self,
        scene: Scene | OpenScene,
        seeds: int | None = None,
        passes: int = 1,
        terms: Sequence[str] = ("beauty",),
        where: NDArray[np.bool_] | None = None,
        **values: Any,
    ) -> tuple[NDArray[np.float64], bool]:
        """Mean over pixels (those of `where`) and channels of the sum of the terms, one for each seed; and whether
        every plane is finite."""
        opened, found, finite = self.open(scene), [], True
        for seed in range(1, (seeds or self.seeds) + 1):
            frame = self.frame(self.renderer(opened, passes, render__seed=seed, **values))
            finite = finite and bool(np.isfinite(frame.planes).all())
            image = np.sum([frame.image(term).astype(np.float64) for term in terms], axis=0)
            found.append(float((image if where is None else image[where]).mean()))
        return np.array(found), finite

    def measure(
        self, scene: Scene | OpenScene, expected: float | None, bias: str = "", scale: float = 1.0, **options: Any
    ) -> Outcome:
        """The mean picture over `scale` against its truth."""
        found, finite = self.means(scene, **options)
        found = found / scale
        error = float(found.std(ddof=1) / np.sqrt(len(found))) if len(found) > 1 else 0.0
        return Outcome(float(found.mean()), error, expected, samples=len(found), finite=finite, bias=bias)

    def compare(self, scene: Scene | OpenScene, seeds: int | None = None, bias: str = "", **values: Any) -> Outcome:
        """The photon method that `values` describe against the path tracer with four samples as many a pixel."""
        opened = self.open(scene)
        one = self.measure(opened, None, bias, seeds=seeds, **values)
        shared = {k: v for k, v in values.items() if k not in ("render__method", "passes")}
        passes = 8 * int(values.get("passes", 1))
        two = self.measure(opened, None, seeds=seeds, passes=passes, **{**shared, "render__method": "path"})
        return replace(one, expected=two.value, expected_error=two.error, finite=one.finite and two.finite)


METHODS = ("path", "gather", "progressive")


def run_case(lab: Lab, case: Case) -> Row:
    """The case with its time and memory. Whatever it raises is its outcome."""
    lab.said.clear()
    before = _start_peak()
    start, cpu = time.perf_counter(), time.process_time()
    try:
        outcome = case.run(lab)
    except PmviewerError as error:
        outcome = Outcome(said=(str(error),), problem="" if case.nonsense else "refused")
    except MemoryError:
        outcome = Outcome(problem="out of memory")
    except Exception as error:
        outcome = Outcome(problem=f"{type(error).__name__}: {error}"[:120])
    seconds, cpu = time.perf_counter() - start, time.process_time() - cpu
    outcome = replace(outcome, said=tuple(dict.fromkeys((*outcome.said, *lab.said))))
    return Row(case, outcome, seconds, cpu, max(_peak() - before, 0.0))


def _start_peak() -> float:
    """Forget the peak so far, where the system can; MiB held now."""
    with contextlib.suppress(OSError), open("/proc/self/clear_refs", "w") as file:
        file.write("5")
    return _peak()


def _peak() -> float:
    """Largest memory held, in MiB."""
    with contextlib.suppress(OSError), open("/proc/self/status") as lines:
        for line in lines:
            if line.startswith("VmHWM:"):
                return float(line.split()[1]) / 1024
    if sys.platform == "win32":
        return 0.0
    import resource

    unit = 2**20 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
