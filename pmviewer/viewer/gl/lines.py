"""Light's ways as lines on the GPU: photon paths and gather rays.

A line is two photon records (`pmviewer.maps.record`), so that it is coloured as photons are: by the power on the way,
by bounces or by light. The geometry shader makes it as wide as asked for.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import moderngl
import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.frame import PhotonCloud
from pmviewer.render.camera import Matrix
from pmviewer.viewer.gl.program import load_program, set_uniforms
from pmviewer.viewer.overlays.overlays import COLOUR_BY, CloudSummary, log_range, palettes, summary_of

if TYPE_CHECKING:
    from pmviewer.photons.emission.light_importance import LightImportance
    from pmviewer.photons.light_pass.paths import PhotonPaths


MOST_CIRCLES = 2000
CIRCLE_SIDES = 24
EXPONENT_BASE = 80 << 23
"""Of stored powers, as in `pmviewer.maps.record`, which would bring numba along."""


def flights(paths: PhotonPaths, first: int, length: int) -> NDArray[np.float32]:
    """Ends (2n, 6) of the flights number first … first + length − 1 (from 1) of all paths; both carry the record of
    where the flight ends."""
    vertices = paths.vertices
    ends = np.repeat(vertices[:, 1:, None], 2, axis=2)
    ends[:, :, 0, :3] = vertices[:, :-1, :3]
    number = np.arange(1, vertices.shape[1])
    shown = (number >= first) & (number < first + length) & (number < paths.counts[:, None])
    return np.ascontiguousarray(ends[shown].reshape(-1, 6))


def encoded(values: NDArray[np.floating]) -> NDArray[np.uint32]:
    """Stored powers' 16-bit codes of non-negative values, as `pmviewer.maps.photon_words.encode_power`."""
    bits = np.ascontiguousarray(values, np.float32).view(np.uint32).astype(np.int64)
    return np.clip((bits + 0x1000 - EXPONENT_BASE) >> 13, 0, 0xFFFF).astype(np.uint32)


def gather_lines(rows: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
    """Gather rays (n, 10) of `pmviewer.render.gather.gather_points` as lines (2n, 6) and their unit of radiance. The
    "light" is 0 for rays that follow the BSDF, 1 for those that photons guided."""
    unit = float(rows[:, 6:9].max(initial=0.0)) or 1.0
    ends = np.zeros((len(rows), 2, 6), np.float32)
    ends[:, 0, :3], ends[:, 1, :3] = rows[:, :3], rows[:, 3:6]
    red, green, blue = encoded(rows[:, 6:9] / unit).T
    words = ends.view(np.uint32)
    words[..., 4] = (red | green << 16)[:, None]
    words[..., 5] = (blue | rows[:, 9].astype(np.uint32) << 16)[:, None]
    return ends.reshape(-1, 6), unit


def light_points(lights: LightImportance, places: NDArray[np.float64]) -> PhotonCloud:
    """The lights that have a place as points: red is the share of the picture's light that comes from each, green how
    many times as many photons leave it as by its power."""
    shown = np.flatnonzero(np.isfinite(places).all(axis=1))
    rows = np.zeros((len(shown), 6), np.float32)
    rows[:, :3] = places[shown]
    words = rows.view(np.uint32)
    words[:, 4] = encoded(lights.lit[shown]) | encoded(lights.factor[shown]) << np.uint32(16)
    words[:, 5] = (shown.astype(np.uint32) & np.uint32(0xFFFF)) << np.uint32(16)
    return PhotonCloud(rows, 1.0)


def circles(records: NDArray[np.float32], reach: NDArray[np.float32]) -> NDArray[np.float32]:
    """Lines (2n, 6) of a circle around each of at most MOST_CIRCLES records (n, 6) of a cloud whose directions are
    normals, evenly thinned; `reach` (n,) are their radii."""
    stride = max(1, -(-len(records) // MOST_CIRCLES))
    chosen, radii = np.ascontiguousarray(records[::stride]), reach[::stride]
    n = directions(chosen)
    helper = np.where(np.abs(n[:, :1]) < 0.6, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    s = np.cross(n, helper)
    s /= np.linalg.norm(s, axis=1, keepdims=True)
    t = np.cross(n, s)
    angle = np.linspace(0, 2 * np.pi, CIRCLE_SIDES + 1)
    around = np.cos(angle)[:, None, None] * s + np.sin(angle)[:, None, None] * t
    points = chosen[:, :3] + around * radii[:, None]
    ends = np.empty((CIRCLE_SIDES, len(chosen), 2, 6), np.float32)
    ends[:] = chosen[:, None]
    ends[:, :, 0, :3], ends[:, :, 1, :3] = points[:-1], points[1:]
    return ends.reshape(-1, 6)


def directions(records: NDArray[np.float32]) -> NDArray[np.float64]:
    """Unit directions (n, 3) of records (n, 6), as `pmviewer.maps.record.decode_directions`."""
    codes = records.view(np.uint32)[:, 3].astype(np.int64)
    u, v = ((codes >> 20) - 2047) / 2047, ((codes >> 8 & 0xFFF) - 2047) / 2047
    z = 1 - np.abs(u) - np.abs(v)
    fold = np.maximum(-z, 0)
    d = np.stack([np.where(u >= 0, u - fold, u + fold), np.where(v >= 0, v - fold, v + fold), z], axis=1)
    return d / np.linalg.norm(d, axis=1, keepdims=True)


class LineCloud:
    """Lines that are uploaded once and drawn in any style."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._program = load_program(context, "lines")
        set_uniforms(self._program, **palettes())
        self._buffer: moderngl.Buffer | None = None
        self._array: moderngl.VertexArray | None = None
        self._count = 0
        self._log_range = (0.0, 1.0)
        self._summary = CloudSummary(0, 0, 0.0, 0.0, ())

    def upload(self, ends: NDArray[np.float32] | None, power_unit: float = 1.0) -> None:
        """Take lines (2n, 6), or none."""
        self.release()
        if ends is None or not len(ends):
            return
        self._count = len(ends)
        self._buffer = self._context.buffer(np.ascontiguousarray(ends, np.float32))
        names = [n for n in ("position", "direction_and_flags", "power_and_light") if n in self._program]
        self._array = self._context.vertex_array(self._program, [(self._buffer, "3f4 1u4 2u4", *names)])
        self._log_range = log_range(ends[::2])
        self._summary = summary_of(ends[::2], power_unit, self._count // 2, self._count // 2)

    def release(self) -> None:
        """Free what lies on the GPU."""
        if self._array is not None:
            self._array.release()
        if self._buffer is not None:
            self._buffer.release()
        self._array = self._buffer = None
        self._count = 0
        self._summary = CloudSummary(0, 0, 0.0, 0.0, ())

    def summary(self) -> CloudSummary:
        return self._summary

    def draw(
        self,
        size: float,
        colour: str,
        view: Matrix,
        projection: Matrix,
        viewport: tuple[int, int],
        flow: bool = True,
    ) -> None:
        """Draw lines `size` pixels wide into the bound framebuffer, brightening towards their ends if they `flow`.
        `colour` names a way to colour photons. Depth test is the caller's."""
        if self._array is None:
            return
        set_uniforms(
            self._program,
            view=view,
            projection=projection,
            viewport=(float(viewport[0]), float(viewport[1])),
            size=size,
            start_level=0.55 if flow else 1.0,
            colour_by=COLOUR_BY[colour],
            power_range=self._log_range,
        )
        self._context.enable(moderngl.BLEND)
        self._context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._array.render(moderngl.LINES)
        self._context.disable(moderngl.BLEND)
