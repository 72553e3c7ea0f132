"""Photon maps as point clouds on the GPU.

Photons are uploaded as they are stored, 24 bytes each, and decoded in the vertex shader; thinning is a stride in the
vertex format, so a map of millions costs no work on the CPU.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import PhotonCloud
from pmviewer.output.falsecolour import COLOURS, DIVERGING
from pmviewer.render.camera import Matrix
from pmviewer.settings.access import FateOverlay, ImportonOverlay, PointOverlay, ShadowOverlay
from pmviewer.viewer.gl.program import load_program, set_uniforms

RGB = tuple[float, float, float]

BOUNCE_PALETTE: tuple[RGB, ...] = (
    (0.99, 0.91, 0.15),
    (0.62, 0.85, 0.22),
    (0.29, 0.76, 0.43),
    (0.13, 0.63, 0.53),
    (0.20, 0.53, 0.70),
    (0.35, 0.44, 0.82),
    (0.53, 0.36, 0.80),
    (0.66, 0.30, 0.62),
)
"""None (straight from the light) to seven and more scatterings."""
LIGHT_PALETTE: tuple[RGB, ...] = (
    (0.95, 0.69, 0.15),
    (0.35, 0.71, 0.91),
    (0.10, 0.70, 0.50),
    (0.94, 0.89, 0.36),
    (0.25, 0.52, 0.85),
    (0.88, 0.45, 0.20),
    (0.84, 0.55, 0.72),
    (0.75, 0.75, 0.75),
)
"""Distinct with colour-blind eyes too (after Okabe and Ito); lights beyond the eighth start again."""

LIT_COLOUR: RGB = (1.0, 0.80, 0.25)
SHADOW_COLOUR: RGB = (0.35, 0.30, 0.95)
"""Of shadow photons where the light arrives and where it does not."""

FATE_PALETTE: tuple[RGB, ...] = (
    (0.45, 0.85, 0.40),
    (0.90, 0.35, 0.30),
    (0.35, 0.60, 0.98),
    (0.98, 0.85, 0.25),
)
"""Of photons that are stored, rejected, redistributed and discarded (`pmviewer.photons.deposition.deposited.FATES`)."""
FATES = ("stored", "rejected", "redistributed", "discarded")

COLOUR_BY = {
    "power": 0,
    "bounce": 1,
    "light": 2,
    "lit or shadow": 3,
    "map": 2,
    "brought": 0,
    "source": 2,
    "fate": 5,
}
CHANNELS = {"importance": 0, "screen": 1, "footprint": 2, "average": 3, "picture": 0, "emission": 1}
"""Quantities in false colours: the channel of the stored power that holds each, 3 for the mean of green and blue."""
AROUND_ONE = ("emission",)
"""Those that tell how far they are from 1."""
_EXPONENT_BASE = np.uint32(80 << 23)


def even_thinning(count: int, limit: int) -> int:
    """Stride that leaves at most `limit` of `count` photons."""
    return max(1, -(-count // max(limit, 1)))


def brightest_channel(photons: NDArray[np.float32]) -> NDArray[np.float32]:
    """(n,) brightest of the three channels of photons (n, 6), in units of the map's power."""
    words = photons.view(np.uint32)
    codes = np.maximum(np.maximum(words[:, 4] & 0xFFFF, words[:, 4] >> 16), words[:, 5] & 0xFFFF).astype(np.uint32)
    return np.where(codes == 0, np.float32(0), ((codes << np.uint32(13)) + _EXPONENT_BASE).view(np.float32))


def quantity(photons: NDArray[np.float32], colour: str) -> NDArray[np.float32]:
    """(n,) what photons (n, 6) are coloured by, in units of the map's power."""
    if colour not in CHANNELS:
        return brightest_channel(photons)
    words = photons.view(np.uint32)
    codes = np.stack([words[:, 4] & 0xFFFF, words[:, 4] >> 16, words[:, 5] & 0xFFFF]).astype(np.uint32)
    values = np.where(codes == 0, np.float32(0), ((codes << np.uint32(13)) + _EXPONENT_BASE).view(np.float32))
    channel = CHANNELS[colour]
    return (values[1] + values[2]) / 2 if channel == 3 else values[channel]


def light_mask(style: PointOverlay) -> int:
    """Bits of the lights' ids, or of what stands in their place, that are drawn."""
    if isinstance(style, ImportonOverlay) and style.map != "both":
        return 1 << (style.map == "global")
    if isinstance(style, FateOverlay):
        fates = {"all": 0b1111, "stored": 0b0001, "not stored": 0b1110}[style.only]
        return (fates if style.map != "global" else 0) | (fates << 8 if style.map != "caustic" else 0)
    return 0xFFFFFFFF


def fate_counts(photons: NDArray[np.float32], map_: str = "both") -> tuple[int, ...]:
    """How many of photons (n, 6) of `pmviewer.photons.deposition.fates` met each of FATES, in the maps chosen."""
    ids = photons.view(np.uint32)[:, 5] >> 16
    if map_ != "both":
        ids = ids[(ids >> 3) == (map_ == "global")]
    return tuple(int(n) for n in np.bincount(ids & 7, minlength=len(FATES)))


def palettes() -> dict[str, NDArray[np.float32]]:
    """Uniforms of `shaders/photon.glsl` that never change."""
    colours = {
        "bounce_palette": BOUNCE_PALETTE,
        "light_palette": LIGHT_PALETTE,
        "lit_colour": LIT_COLOUR,
        "shadow_colour": SHADOW_COLOUR,
        "fate_palette": FATE_PALETTE,
        "false_colours": np.concatenate([COLOURS[::17], DIVERGING[::17]]),
    }
    return {name: np.array(value, np.float32) for name, value in colours.items()}


@dataclass(frozen=True)
class CloudSummary:
    """For the legend: photons in the map, photons drawn, and the 1st and 99th percentile of their power in watts."""

    total: int
    drawn: int
    power_low: float
    power_high: float
    lights: tuple[int, ...]
    """Ids of the lights they came from, of a sample."""


def _percentiles(photons: NDArray[np.float32], colour: str = "power") -> tuple[float, float]:
    """1st and 99th percentile of the powers of photons (n, 6) that have any, or of another quantity."""
    power = quantity(photons, colour)
    low, high = np.percentile(power[power > 0], [1, 99]) if np.any(power > 0) else (1.0, 1.0)
    if colour in AROUND_ONE:
        reach = max(2.0, 1.0 / low, high)
        return 1.0 / reach, reach
    if colour == "picture":  # every light counts, down to a thousandth of the most important one
        high = float(power.max(initial=1e-6))
        low = max(float(power[power > 0].min(initial=high)), 1e-3 * high)
    if colour in CHANNELS:
        low = min(low, 0.8 * high)
    return float(low), float(high)


def log_range(photons: NDArray[np.float32], colour: str = "power") -> tuple[float, float]:
    """Logarithms (base 2) of the powers that are drawn dim and bright; those that hardly differ are all bright. Other
    quantities are drawn in false colours between their percentiles."""
    low, high = _percentiles(photons, colour)
    return float(np.log2(low if colour in CHANNELS else min(low, high / 16))), float(np.log2(high))


def summary_of(
    sample: NDArray[np.float32], power_unit: float, total: int, drawn: int, colour: str = "power"
) -> CloudSummary:
    """What the legend says of `total` photons of which `sample` (n, 6) are some."""
    low, high = _percentiles(sample, colour)
    lights = tuple(int(i) for i in np.unique(sample.view(np.uint32)[:, 5] >> 16)[:64])
    return CloudSummary(total, drawn, low * power_unit, high * power_unit, lights)


class PointCloud:
    """One map's photons."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = load_program(context, "points")
        set_uniforms(self._program, **palettes())
        self._buffer: moderngl.Buffer | None = None
        self._arrays: dict[int, moderngl.VertexArray] = {}
        self._count = 0
        self._uploaded: PhotonCloud | None = None
        self._sample = np.empty((0, 6), np.float32)
        self._ranges: dict[str, tuple[float, float]] = {}
        self._summaries: dict[str, CloudSummary] = {}

    def upload(self, cloud: PhotonCloud | None) -> bool:
        """Take this cloud; False when it is the one that is there already."""
        if cloud is self._uploaded:
            return False
        self.release()
        self._uploaded = cloud
        self._count = 0 if cloud is None else len(cloud.photons)
        if cloud is None or self._count == 0:
            return True
        photons = np.ascontiguousarray(cloud.photons, np.float32)
        self._buffer = self._context.buffer(photons)
        self._sample = photons[:: even_thinning(self._count, 20_000)]
        return True

    def release(self) -> None:
        """Free what lies on the GPU."""
        for array in self._arrays.values():
            array.release()
        self._arrays.clear()
        if self._buffer is not None:
            self._buffer.release()
        self._buffer, self._uploaded, self._count = None, None, 0
        self._ranges.clear()
        self._summaries.clear()

    def summary(self, limit: int, colour: str = "power") -> CloudSummary:
        if self._uploaded is None or not self._count:
            return CloudSummary(0, 0, 0.0, 0.0, ())
        drawn = -(-self._count // even_thinning(self._count, limit))
        if colour not in self._summaries:
            self._summaries[colour] = summary_of(self._sample, self._uploaded.power_unit, self._count, 0, colour)
        return replace(self._summaries[colour], total=self._count, drawn=drawn)

    def draw(self, style: PointOverlay, view: Matrix, projection: Matrix, limit: int, pixel_ratio: float) -> None:
        """Draw at most `limit` photons into the bound framebuffer. Depth test and viewport are the caller's."""
        if self._buffer is None:
            return
        stride = even_thinning(self._count, limit)
        size, colour = style.size * pixel_ratio, style.colour
        if colour not in self._ranges:
            self._ranges[colour] = log_range(self._sample, colour)
        set_uniforms(
            self._program,
            view=view,
            projection=projection,
            size=size,
            colour_by=4 if colour in CHANNELS else COLOUR_BY[colour],
            channel=CHANNELS.get(colour, 0),
            colour_row=int(colour in AROUND_ONE),
            light_mask=light_mask(style),
            only_shadow=int(isinstance(style, ShadowOverlay) and not style.lit),
            power_range=self._ranges[colour],
            round_points=int(size >= 3),
        )
        self._array(stride).render(moderngl.POINTS, vertices=-(-self._count // stride))

    def _array(self, stride: int) -> moderngl.VertexArray:
        if stride not in self._arrays:
            assert self._buffer is not None
            rest = f" {24 * (stride - 1)}x1" if stride > 1 else ""
            names = [n for n in ("position", "direction_and_flags", "power_and_light") if n in self._program]
            layout = f"3f4 1u4 2u4{rest}"
            self._arrays[stride] = self._context.vertex_array(self._program, [(self._buffer, layout, *names)])
        return self._arrays[stride]
