"""Photon look-ups: against scipy's cKDTree (P7), over the number of photons (P12), memory (P13), building."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from pmviewer.bench.report import BenchResult, Target
from pmviewer.maps.estimate.estimate import RIM_LEFT_OUT, irradiance_at_knn, irradiance_at_radius
from pmviewer.maps.estimate.filters import CONSTANT, Filter
from pmviewer.maps.estimate.nearest import Neighbours
from pmviewer.maps.search.grid import PhotonGrid, build_grid, count_in_radius
from pmviewer.maps.search.k_nearest import nearest_at
from pmviewer.maps.search.kdtree import PhotonKdTree, build_kdtree
from pmviewer.maps.search.stored import ALL_CLASSES

K = 50
COUNT = 30
"""Photons expected within the fixed radius where the walls are evenly lit."""

WALLS = 22.67
"""Area that four fifths of the photons lie on."""

THREADS = 2
CHUNK = 4096
FACING = "photons' surfaces face as look-ups do, so that few are tested for being apart"
_f4, _i4 = np.float32, np.int32
EVEN = Filter(_i4(CONSTANT), _f4(1))


def clustered(n: int, seed: int) -> np.ndarray:
    """Positions (n, 3) float32 as a light pass leaves them: four fifths evenly on the walls of a box and two spheres in
    it, one fifth in a caustic on the floor."""
    rng = np.random.default_rng(seed)
    wall = rng.choice(7, n, p=np.array([4, 4, 4, 4, 4, 1.54, 1.13]) / WALLS)
    position = rng.uniform(-1, 1, (n, 3))
    for side, (axis, value) in enumerate([(1, -1), (1, 1), (2, -1), (0, -1), (0, 1)]):
        position[wall == side, axis] = value
    direction = rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    position[wall == 5] = [0.4, -0.6, 0.3] + 0.35 * direction[wall == 5]
    position[wall == 6] = [-0.4, -0.7, 0.5] + 0.3 * direction[wall == 6]
    caustic = rng.random(n) < 0.2
    position[caustic] = np.array([0.2, -1, 0.5]) + rng.normal(size=(n, 3))[caustic] * [0.14, 0, 0.14]
    return position.astype(_f4)


def morton_order(points: np.ndarray) -> np.ndarray:
    """Indices that bring points (n, 3) into Z-order, 10 bits an axis."""
    low = points.min(axis=0)
    cells = ((points - low) * (1023.9 / (points.max(axis=0) - low).max())).astype(np.uint32)
    code = np.zeros(len(points), np.uint32)
    for bit in range(10):
        for axis in range(3):
            code |= (cells[:, axis] >> bit & 1) << np.uint32(3 * bit + axis)
    return np.argsort(code, kind="stable")


def _photons(n: int, seed: int) -> np.ndarray:
    """Photons (n, 6) float32: clustered positions, directions from everywhere to surfaces that face up, as look-ups do,
    powers about one."""
    photons = np.empty((n, 6), _f4)
    photons[:, :3] = clustered(n, seed)
    rng = np.random.default_rng(seed)
    words = photons.view(np.uint32)
    up = 4 << 20 | 7 << 8  # `pmviewer.maps.record`
    words[:, 3] = rng.integers(0, 511, n) << 23 | rng.integers(0, 511, n) << 11 | up
    words[:, 4] = 0xBC00BC00
    words[:, 5] = 0xBC00
    return photons


def _radius(n: int) -> float:
    """Radius of a disc that holds `COUNT` of n photons on the walls."""
    return float(np.sqrt(COUNT * WALLS / (np.pi * 0.8 * n)))


class _Queries:
    """Points in Z-order with room for results, and ways to look them up on a thread pool in chunks."""

    def __init__(self, m: int, pool: ThreadPoolExecutor) -> None:
        points = clustered(m, 2)
        self.points = np.ascontiguousarray(points[morton_order(points)])
        self.normals = np.tile(np.array([0, 1, 0], _f4), (m, 1))
        self.counts, self.irradiance, self.radii = np.empty(m, _i4), np.empty((m, 3), _f4), np.empty(m, _f4)
        self.indices, self.squared = np.empty((m, K), _i4), np.empty((m, K), _f4)
        self.pool = pool

    def _run(self, look_up: Callable[[int, int], None]) -> None:
        m = len(self.points)
        list(self.pool.map(lambda i: look_up(i, min(i + CHUNK, m)), range(0, m, CHUNK)))

    def count(self, grid: PhotonGrid) -> None:
        self._run(lambda i, j: count_in_radius(grid.record, self.points, _f4(grid.radius), i, j, self.counts))

    def estimate(self, grid: PhotonGrid) -> None:
        shape = _f4(grid.radius), _f4(1), _i4(ALL_CLASSES), EVEN
        out = self.irradiance, self.counts
        self._run(lambda i, j: irradiance_at_radius(grid.record, self.points, self.normals, *shape, i, j, *out))

    def nearest(self, tree: PhotonKdTree, ordered: bool) -> None:
        k, reach, out = _i4(K), _f4(np.inf), (self.indices, self.squared)
        self._run(lambda i, j: nearest_at(tree.record, self.points, k, reach, ordered, i, j, *out))

    def estimate_nearest(self, tree: PhotonKdTree, max_radius: float) -> None:
        neighbours = Neighbours(_i4(K), _f4(max_radius), _i4(RIM_LEFT_OUT), _f4(1))
        shape = neighbours, _f4(1), _i4(ALL_CLASSES), EVEN
        out = self.irradiance, self.counts, self.radii
        self._run(lambda i, j: irradiance_at_knn(tree.record, self.points, self.normals, *shape, i, j, *out))


def _best(tasks: dict[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """Least CPU time in seconds, of all threads together, of each task. The tasks take turns, so that a busy moment of
    the machine hits them all; the first turn, which compiles, doesn't count."""
    best = dict.fromkeys(tasks, np.inf)
    for turn in range(repeats + 1):
        for name, task in tasks.items():
            start = time.process_time()
            task()
            if turn > 0:
                best[name] = min(best[name], time.process_time() - start)
    return best


def _against_ckdtree(queries: _Queries, n: int, repeats: int) -> tuple[list[list[str | float | int]], list[Target]]:
    photons = _photons(n, 1)
    radius, m = _radius(n), len(queries.points)
    grid, tree = build_grid(photons, radius), build_kdtree(photons)
    positions, points = photons[:, :3].astype(np.float64), queries.points.astype(np.float64)
    theirs = cKDTree(positions)
    tasks: dict[str, Callable[[], object]] = {
        "cKDTree, k nearest": lambda: theirs.query(points, K, workers=THREADS),
        "kd-tree, k nearest": lambda: queries.nearest(tree, False),
        "kd-tree, k nearest, by distance": lambda: queries.nearest(tree, True),
        "kd-tree, irradiance of k nearest": lambda: queries.estimate_nearest(tree, 5 * radius),
        "cKDTree, count in radius": lambda: theirs.query_ball_point(
            points, radius, workers=THREADS, return_length=True
        ),
        "grid, count in radius": lambda: queries.count(grid),
        "grid, irradiance in radius": lambda: queries.estimate(grid),
    }
    seconds = _best(tasks, repeats)
    reference = {
        name: seconds["cKDTree, k nearest" if "nearest" in name else "cKDTree, count in radius"] for name in tasks
    }
    rows: list[list[str | float | int]] = [
        [name, n, 1e6 * t / m, reference[name] / t, ""] for name, t in seconds.items()
    ]
    note = f"{n} photons, {m} points in Z-order, {THREADS} threads; {FACING}"
    k_ratio = seconds["cKDTree, k nearest"] / seconds["kd-tree, k nearest"]
    r_ratio = seconds["cKDTree, count in radius"] / seconds["grid, count in radius"]
    return rows, [
        Target("P7", k_ratio, 5.0, "x", True, f"k = {K}, {note}"),
        Target("P7", r_ratio, 8.0, "x", True, f"fixed radius, {note}"),
    ]


def _over_n(queries: _Queries, sizes: list[int], repeats: int) -> tuple[list[list[str | float | int]], list[Target]]:
    rows: list[list[str | float | int]] = []
    tasks: dict[str, Callable[[], object]] = {}
    bytes_per_photon = 0.0
    for n in sizes:
        photons = _photons(n, 1)
        start = time.process_time()
        grid = build_grid(photons, _radius(n))
        middle = time.process_time()
        tree = build_kdtree(photons)
        end = time.process_time()
        rows.append(["grid, building, a photon", n, 1e6 * (middle - start) / n, "", grid.bytes / n])
        rows.append(["kd-tree, building, a photon", n, 1e6 * (end - middle) / n, "", tree.bytes / n])
        bytes_per_photon = max(bytes_per_photon, grid.bytes / n, tree.bytes / n)
        tasks[f"grid, irradiance in radius {n}"] = partial(queries.estimate, grid)
        tasks[f"kd-tree, k nearest {n}"] = partial(queries.nearest, tree, False)
    seconds = _best(tasks, repeats)
    growth: dict[str, list[float]] = {}
    for label, t in seconds.items():
        name, size = label.rsplit(" ", 1)
        rows.append([name, int(size), 1e6 * t / len(queries.points), "", ""])
        growth.setdefault(name, []).append(t)
    span = f"from {sizes[0]} to {sizes[-1]} photons"
    return rows, [
        *(Target("P12", t[-1] / t[0], 1.5, "x", False, f"{name}, {span}; {FACING}") for name, t in growth.items()),
        Target("P13", bytes_per_photon, 31.0, "bytes", False, "photon with structure, the larger of grid and kd-tree"),
    ]


def run(quick: bool = False) -> BenchResult:
    """Look-ups of 200 000 points among up to ten million photons; `quick`: 50 000 points, up to one million."""
    repeats = 2 if quick else 5
    with ThreadPoolExecutor(THREADS) as pool:
        queries = _Queries(50_000 if quick else 200_000, pool)
        rows, targets = _against_ckdtree(queries, 1_000_000, repeats)
        more_rows, more_targets = _over_n(queries, [100_000, 1_000_000] + [10_000_000] * (not quick), repeats)
    columns = ["look-up", "photons", "CPU us", "times cKDTree", "bytes a photon"]
    return BenchResult("Photon look-ups", columns, rows + more_rows, targets + more_targets)
