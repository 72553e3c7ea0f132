"""The eye pass: tiles of pixels over the threads, into the film."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.plan import Plan
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.stages.pass_data import RenderedPass
from pmviewer.engine.stages.virtual_lights import lights_asked
from pmviewer.engine.store import StageStore
from pmviewer.render.camera import CameraPose, hidden_from
from pmviewer.render.counts import N_COUNTS
from pmviewer.render.direct.choice import CHOICES
from pmviewer.render.direct.outline import outline_pixels
from pmviewer.render.edges import MOST_EDGED, edged_pixels
from pmviewer.render.eye import eye_pass
from pmviewer.render.film import Film, Spans
from pmviewer.render.filter import BOX, filter_of
from pmviewer.render.gather.gather_points import POINT_COLUMNS, gather_points
from pmviewer.render.given import PassData
from pmviewer.render.mirrored import mirrored_pixels
from pmviewer.render.path import path_pass
from pmviewer.render.pixel_samples import own_eye
from pmviewer.render.share import share_samples, weigh_samples
from pmviewer.settings.access import Settings
from pmviewer.tasks import Runner

PIXELS_A_GATHER = 8
"""At least, where irradiance is cached: the others find it there."""
LEAST_TILE = 4
"""Fewest pixels that a task is divided into."""
SHARED_TILE = 4096
"""Pixels a task that share samples: some milliseconds."""
MOST_POINTS = 1024
"""Most gather rays of a pixel that are told of."""


def render_into(film: Film, given: PassData, marks: NDArray[np.uint8], plan: Plan, pool: WorkPool) -> NDArray[np.int64]:
    """A pass's samples more, of the path tracer or by maps. Returns the counts of `pmviewer.render.counts`."""
    spans = film.spans()
    pixels, lights = sum(last - first for first, last in spans), lights_asked(given.virtual)
    tile = tile_size(pixels, given.eye[0], pool.threads, lights, plan.cache)

    def traced(own: PassData, sums: NDArray[np.float64], counts: NDArray[np.int64], first: int, last: int) -> None:
        if plan.path:
            path_pass(given.scene, given.eye, sums, counts, first, last)
        else:
            eye_pass(own, marks, film.radii, sums, counts, first, last)

    def alone(parts: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
        counts, own = np.zeros(N_COUNTS, np.int64), own_eye(given)
        for first, last in parts:
            with film.one_addition(first, last):
                traced(own, film.sums, counts, first, last)
            if film.moments is not None:
                film.moments.add(film.sums, film.channels, first, last)
        return counts

    def sampled(parts: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
        counts, own = np.zeros(N_COUNTS, np.int64), own_eye(given)
        for first, last in parts:
            film.clear_own_samples(first, last)
            traced(own, samples, counts, first, last)
        return counts

    if not plan.filtered:
        return sum(pool.run([partial(alone, parts) for parts in _tiled(spans, tile)]), np.zeros(N_COUNTS, np.int64))
    around = film.spans(around=int(given.eye[0]["filter_reach"]))
    samples = film.own_samples
    counts = sum(pool.run([partial(sampled, parts) for parts in _tiled(around, tile)]), np.zeros(N_COUNTS, np.int64))
    _share(film, given, marks, spans, pool)
    return counts


def _share(film: Film, given: PassData, marks: NDArray[np.uint8], spans: Spans, pool: WorkPool) -> None:
    """Add what the pixels of the pass have sampled to the film, as its filter shares it."""
    weights = np.empty((2, 2 * int(given.eye[0]["filter_reach"]) + 1), np.float32)
    weigh_samples(given.eye, weights)
    sizes = film.width, film.height, film.latest_alone
    numbered = -1 if film.numbered is None else film.numbered

    def shared(parts: Sequence[tuple[int, int]]) -> None:
        line, beside = np.empty(film.sums.shape[1]), np.empty((weights.shape[1], film.own_samples.shape[1]))
        for first, last in parts:
            share_samples(weights, marks, film.own_samples, film.sums, sizes, numbered, line, beside, first, last)
            if film.moments is not None:
                film.moments.add(film.sums, film.channels, first, last)

    pool.run([partial(shared, parts) for parts in _tiled(spans, SHARED_TILE)])


@lru_cache(maxsize=8)
def _tiled(spans: Spans, tile: int) -> Sequence[Sequence[tuple[int, int]]]:
    """Spans of pixels in tasks of some `tile` pixels, short spans together, long ones divided; the last quarter of all
    pixels in tasks of a quarter, so that threads end together."""
    tasks: list[list[tuple[int, int]]] = []
    left = sum(last - first for first, last in spans)
    quarter, size, room = left // 4, tile, 0
    for first, last in spans:
        begin = first
        while begin < last:
            if left <= quarter:
                size = max(tile // 4, LEAST_TILE)
            end = min(begin + size, last)
            if room < end - begin:
                tasks.append([])
                room = size
            tasks[-1].append((begin, end))
            room -= end - begin
            left -= end - begin
            begin = end
    return tasks


def tile_size(pixels: int, eye: np.void, threads: int, virtual_lights: int = 0, cached: bool = False) -> int:
    """Pixels a task, so that a task takes at most some 15 ms and many threads end together: what a tile costs differs
    by what it shows. The picture does not depend on it."""
    keller_wald = eye["choice"] == CHOICES.index("Keller-Wald")
    light_samples = int(eye["con_samples"] + eye["noncon_samples"] if keller_wald else eye["light_samples"])
    rays = int(eye["gather_rays"])
    work = 1 + (rays // PIXELS_A_GATHER if cached else rays) + light_samples // 4 + virtual_lights // 2
    return max(64 if virtual_lights < 64 else LEAST_TILE, min(4096 // work, -(-pixels // (4 * threads))))


def outline_of(scene: OpenScene, camera: CameraPose, film: Film, settings: Settings, store: StageStore) -> NDArray:
    """Pixels on the outline of a light, where the eye pass looks for emission with rays of its own: uint8, empty where
    it does not. The film may be smaller than the camera's picture."""
    if settings.render.outline_rays == 0 or hidden_from(camera, settings.render):
        return np.zeros(0, np.uint8)
    if (film.width, film.height) != (camera.width, camera.height):
        camera = replace(camera, width=film.width, height=film.height)
    reach = max(filter_of(camera.filter, settings.render).radius - BOX.radius, 0.0)
    key = ("outline", scene.uid, camera, reach)
    return store.get(key, lambda: outline_pixels(scene.scene, camera, reach), lambda pixels: pixels.nbytes)


def marks_of(
    scene: OpenScene, camera: CameraPose, film: Film, settings: Settings, plan: Plan, store: StageStore, run: Runner
) -> NDArray[np.uint8]:
    """What the eye pass does more in which pixels (`pmviewer.render.pixel_samples`): uint8, empty where nothing. The
    film may be smaller than the camera's picture. Raises Cancelled as `run` does."""
    (marks,) = run([partial(outline_of, scene, camera, film, settings, store)])
    glossy = settings.photons.glossy
    small = replace(camera, width=film.width, height=film.height)
    more: list[tuple[Hashable, Callable[[], NDArray[np.uint8]]]] = []
    if plan.mirror_rays > 1:
        mirrored = partial(mirrored_pixels, scene.flat, small, glossy)
        more.append((("mirrors", scene.uid, small, glossy), lambda: run([mirrored])[0]))
    if plan.edge_rays > 1:
        most = MOST_EDGED if settings.render.edge_rays == "auto" else 1.0
        more.append((("edges", scene.uid, small, most), lambda: edged_pixels(scene.flat, small, most, run)))
    for key, found in more:
        also = store.get(key, found, lambda pixels: pixels.nbytes)
        marks = marks | also if len(marks) and len(also) else marks if len(marks) else also
    return marks


def gather_rays_of(rendered: RenderedPass, x: int, y: int, pool: WorkPool) -> NDArray[np.float32]:
    """The gather rays of a pixel of the pass, (n, POINT_COLUMNS), see `pmviewer.render.gather.gather_points`; none
    where the pass does not gather, and for pixels outside of the image."""
    given, eye = own_eye(rendered.given), rendered.given.eye[0]
    width, height = int(eye["width"]), int(eye["height"])
    if eye["gather_rays"] == 0 or not (0 <= x < width and 0 <= y < height):
        return np.empty((0, POINT_COLUMNS), np.float32)
    rows = np.empty((MOST_POINTS, POINT_COLUMNS), np.float32)
    pixel, counts = np.int64(y * width + x), np.zeros(N_COUNTS, np.int64)
    samples = np.int64(rendered.samples(int(pixel)))
    count = pool.run([lambda: gather_points(given, pixel, samples, counts, rows)])[0]
    return rows[:count].copy()
