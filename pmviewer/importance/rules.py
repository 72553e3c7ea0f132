"""What deposition rules ask of importance: the probability of storing a photon, and the density required around it.

Keller and Wald (2000, §2.2) store a photon with p = min(1, f·ΣW) over the importons nearest to it. f comes from test
rays of the camera: with the inverse of the smallest ΣW that they find, p is 1 wherever the camera looks directly.
Density control wants D_r = Γ·M_r/A_pix photons per unit area (course guide, eq. 3.2).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Lock
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from pmviewer.maps.density.growing_tree import M
from pmviewer.maps.importance.facets import Facets, facets_of, sums_on
from pmviewer.maps.importance.importance_map import ImportanceMap, required_density
from pmviewer.maps.importance.look_up import importance_sums
from pmviewer.maps.importance.nearest_of_all import nearest_importances, node_boxes
from pmviewer.maps.importance.together import importances_on
from pmviewer.maps.record import decode_directions

Float = NDArray[np.float32]
Codes = NDArray[np.uint32]
Evaluate = Callable[[Float, Codes], Float]

NEAREST = 50
"""Importons summed for a photon. The camera sees fewer within the radius of the sum in most pictures' farthest corner,
which sets f; summing more would not change p."""
TESTS = 1024
"""Test rays."""

_made: WeakKeyDictionary[ImportanceMap, Facets] = WeakKeyDictionary()
_making = Lock()


def _evaluated(kernel: Any, importance: ImportanceMap, positions: Float, normals: Codes, *more: Any) -> Float:
    out = np.zeros(len(positions), np.float32)
    if importance.n and len(positions):
        points, directions = np.ascontiguousarray(positions, np.float32), decode_directions(normals)
        kernel(importance.record, points, directions, *more, out, 0, len(points))
    return out


def _facets(importance: ImportanceMap) -> Facets:
    """The map's facets, made once."""
    with _making:
        found = _made.get(importance)
        if found is None:
            found = _made[importance] = facets_of(importance)
        return found


def _gamma_of(importance: ImportanceMap) -> Evaluate:
    """Γ in pixels per unit area."""
    if not importance.n:
        return lambda positions, normals: np.zeros(len(positions), np.float32)
    facets = _facets(importance)

    def evaluate(positions: Float, normals: Codes) -> Float:
        out = np.zeros(len(positions), np.float32)
        on = facets.maps, facets.shapes, facets.boxes, facets.reached
        importances_on(*on, np.ascontiguousarray(positions, np.float32), normals, out, 0, len(out))
        return out

    return evaluate


def important_weight(importance: ImportanceMap, positions: Float, normals: Codes) -> Float:
    """ΣW in pixels at positions (n, 3) with normal codes (n,)."""
    return _evaluated(importance_sums, importance, positions, normals, np.int32(NEAREST))


def probability_of(importance: ImportanceMap, f: float) -> Evaluate:
    """f·ΣW: the probability of storing a photon where it is below 1.

    Once importons found add up to 1/f, others are not searched for.
    """
    least = f * float(importance.weights.min()) if importance.n else 0.0
    enough = math.ceil(1.001 / least) if least > 0 else NEAREST + 1
    if enough > NEAREST:  # which ones are the nearest decides

        def evaluate(positions: Float, normals: Codes) -> Float:
            return np.float32(f) * important_weight(importance, positions, normals)

        return evaluate

    facets = _facets(importance)

    def soon(positions: Float, normals: Codes) -> Float:
        out = np.zeros(len(positions), np.float32)
        points, directions = np.ascontiguousarray(positions, np.float32), decode_directions(normals)
        sums_on(facets.maps, facets.shapes, points, directions, np.int32(enough), out, 0, len(points))
        return np.float32(f) * out

    return soon


def density_of(importance: ImportanceMap, M_r: float) -> Evaluate:
    """D_r in photons per unit area, 0 where nothing looks; M_r photons a pixel."""
    gamma = _gamma_of(importance)

    def evaluate(positions: Float, normals: Codes) -> Float:
        return np.asarray(required_density(gamma(positions, normals), M_r), np.float32)

    return evaluate


def density_beyond(importance: ImportanceMap, M_r: float, reach: float) -> Callable[[Float], Float]:
    """Density (n,) for positions (n, 3) where nothing is required, so that power that is shared out there does not come
    near important places: M photons within `reach` times the distance of the nearest importon, or what that one asks
    for, if that is less. 0 without importons."""

    boxes = node_boxes(importance)

    def evaluate(positions: Float) -> Float:
        gamma, distances = np.zeros(len(positions), np.float32), np.full(len(positions), np.inf, np.float32)
        if importance.n and len(positions):
            points = np.ascontiguousarray(positions, np.float32)
            nearest_importances(importance.record, boxes, points, gamma, distances, 0, len(points))
        with np.errstate(divide="ignore"):
            near = M / (np.pi * (np.float32(reach) * distances) ** 2)
        return np.asarray(np.minimum(required_density(gamma, M_r), near), np.float32)

    return evaluate


def automatic_f(importance: ImportanceMap, positions: Float, normals: Codes) -> tuple[float, str | None]:
    """f from the places (n, 3), with normal codes (n,), where test rays end, and a sentence where they tell nothing.

    Places without importance are left out: p stays below 1 there, as at everything else that importons missed.
    """
    found = important_weight(importance, positions, normals)
    found = found[found > 0]
    if len(found):
        return 1.0 / float(found.min()), None
    if importance.n:
        typical = float(np.median(important_weight(importance, importance.positions, importance.tree.payload[:, 0])))
        if typical > 0:
            return 1.0 / typical, (
                "Keller-Wald: no test ray of the camera met an important place; f is set by the importons themselves."
            )
    return 0.0, "Keller-Wald: there is no importance; every photon is stored with the cut-off probability ε."


def full_importance(importance: ImportanceMap) -> float:
    """Γ that nine importons in ten exceed; 0 without any. Christensen takes the largest for 1, but one corner near the
    camera would then make everything else unimportant."""
    return float(np.quantile(importance.gamma, 0.1)) if importance.n else 0.0


def relative_importance(importance: ImportanceMap, full: float, most: float = 1.0) -> Evaluate:
    """Γ relative to `full`, at most `most`; 0 everywhere if `full` is."""
    gamma = _gamma_of(importance)

    def evaluate(positions: Float, normals: Codes) -> Float:
        if not full > 0:
            return np.zeros(len(positions), np.float32)
        return np.minimum(gamma(positions, normals) / np.float32(full), np.float32(most))

    return evaluate
