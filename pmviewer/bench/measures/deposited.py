"""Pictures and photons by a deposition rule, as rows of a table beside those of storing all photons."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.bench.report import format_cell
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.prepare import prepare
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.store import StageStore
from pmviewer.output.metric import EPSILON, relmse
from pmviewer.photons.deposition.deposited import Deposited
from pmviewer.scene.arrays.flatten import LUMINANCE
from pmviewer.settings.access import Settings, with_values

KELLER_WALD = {"importance.map": "screen", "importance.deposition": "Keller-Wald"}
CONTROL = {"importance.map": "average", "importance.deposition": "density control"}
COLUMNS = ["scene", "method", "rule", "N", "photons in maps", "of all", "relMSE", "relMSE, indirect", "difference %",
           "in the mean %", "mean off %", "discarded %", "CPU light", "CPU all"]  # fmt: skip

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """Pictures of some seeds by one rule: `images` and their `indirect` terms, caustics included, (seeds, h, w, 3);
    `held` photons in the maps of a pass; CPU seconds of `light` (importance, light pass, maps) and of everything, a
    pass; `deposited` of the last."""

    images: Image
    indirect: Image
    held: float
    light: float
    cpu: float
    deposited: dict[str, Deposited]

    @property
    def power_off(self) -> float:
        """Largest relative difference between stored and arrived power of a map."""
        maps = [d for d in self.deposited.values() if d.arrived_power > 0]
        return max((abs(d.stored_power / d.arrived_power - 1) for d in maps), default=0.0)

    @property
    def discarded(self) -> float:
        """Share of the arrived power that was discarded."""
        arrived = sum(d.arrived_power for d in self.deposited.values())
        return sum(d.discarded_power for d in self.deposited.values()) / arrived if arrived > 0 else 0.0

    def error(self, target: Image) -> float:
        """Mean relMSE of the seeds' pictures against `target` (h, w, 3)."""
        return float(np.mean([relmse(image, target) for image in self.images]))

    def indirect_variance(self, target: Image) -> float:
        """Variance of the indirect term between seeds, weighed as by relMSE."""
        return float((self.indirect.var(axis=0, ddof=1) / (target**2 + EPSILON)).mean())


def measure(
    opened: OpenScene, values: dict[str, Any], seeds: range, passes: int, pool: WorkPool, size: tuple[int, int]
) -> Measured:
    """Render the scene with each seed, `size` (width, height)."""
    settings = with_values(Settings(), values | {"camera.width": size[0], "camera.height": size[1]})
    prepare(opened, settings, pool, lambda text, share: None)
    small = with_values(settings, {"camera.width": 8, "camera.height": 8, "photons.N": 1000, "importance.N": 100})
    Renderer(opened, small, pool, StageStore(0)).step()  # what is left to load
    images, indirect, held, light, cpu = [], [], 0.0, 0.0, 0.0
    deposited: dict[str, Deposited] = {}
    for seed in seeds:
        renderer = Renderer(opened, with_values(settings, {"render.seed": seed}), pool, StageStore(0))
        for _ in range(passes):
            renderer.step()
            held += renderer.tally.map_photons / passes / len(seeds)
        frame, spent = renderer.frame(0), renderer.tally.stage_seconds
        images.append(frame.image().astype(np.float64))
        indirect.append(frame.image("indirect").astype(np.float64) + frame.image("caustic"))
        light += sum(spent.get(stage, 0.0) for stage in ("importance", "light pass", "maps")) / passes / len(seeds)
        cpu += renderer.tally.cpu_seconds / passes / len(seeds)
        deposited = renderer.tally.deposited
    return Measured(np.array(images), np.array(indirect), held, light, cpu, deposited)


@dataclass(frozen=True)
class Bias:
    """How far pictures are off in the mean, that is after very many passes: `squared` is the mean over the pixels of
    that difference squared, and `error` its standard error, both over the squared mean luminance."""

    squared: float
    error: float

    @property
    def likely(self) -> float:
        """In percent of the mean luminance; 0 where noise says less than nothing."""
        return 100 * math.sqrt(max(self.squared, 0.0))

    @property
    def at_most(self) -> float:
        """Two standard errors above."""
        return 100 * math.sqrt(max(self.squared + 2 * self.error, 0.0))


def bias(off: Image, mean: float) -> Bias:
    """From differences of luminance (seeds, h, w), noise and all, of at least three seeds; `mean` luminance.

    Noise of two seeds is independent, so that the product of their differences is, in the mean, that of the pictures'
    own difference. The standard error is that of a mean over pairs, of which those with a seed in common agree
    (Hoeffding's formula for U statistics).
    """
    n, flat = len(off), off.reshape(len(off), -1) / mean
    pairs = flat @ flat.T / flat.shape[1]
    others = ~np.eye(n, dtype=bool)
    squared = float(pairs[others].mean())
    around = np.where(others, pairs - squared, 0.0)
    alone = float((around**2).sum()) / (n * (n - 1) - 2)
    shared = float((around.sum(axis=1) ** 2).sum() - (around**2).sum()) / (n * (n - 1) * (n - 2))
    variance = (4 * (n - 2) * max(shared, 0.0) + 2 * alone) / (n * (n - 1))
    return Bias(squared, math.sqrt(variance))


def bias_of(made: Measured, all_: Measured) -> Bias:
    """Of pictures by a rule, against those with all photons of the same seeds."""
    plain = all_.images[: len(made.images)]
    return bias((made.images - plain) @ LUMINANCE, float((plain @ LUMINANCE).mean()))


def row(scene: str, method: str, rule: str, n: int, made: Measured, all_: Measured, target: Image) -> list[Any]:
    """A rule's row by COLUMNS, told right away."""
    plain = all_.images[: len(made.images)]  # of the same seeds
    off, mean = made.images - plain, (plain @ LUMINANCE).mean()
    differs = 100 * float(np.abs(off @ LUMINANCE).mean() / mean)
    variance = made.indirect_variance(target) if len(made.images) > 1 else math.nan
    in_the_mean = bias_of(made, all_).likely if len(made.images) > 2 else math.nan
    cells: list[Any] = [scene, method, rule, n, round(made.held), made.held / all_.held, made.error(target), variance,
                        differs, in_the_mean, 100 * float((off @ LUMINANCE).mean() / mean), 100 * made.discarded,
                        made.light / all_.light, made.cpu / all_.cpu]  # fmt: skip
    tell(", ".join(f"{name} {format_cell(cell)}" for name, cell in zip(COLUMNS, cells, strict=True)))
    return cells


def tell(line: str) -> None:
    """What is known so far, while the rest is measured."""
    print(line, file=sys.stderr, flush=True)


def said(values: dict[str, Any]) -> str:
    """The settings that differ from the defaults, for a target's line."""
    return ", ".join(f"{path}={value}" for path, value in values.items())
