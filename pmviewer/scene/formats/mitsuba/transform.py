"""4×4 transformations of a scene file: column vectors, later operations multiply from the left."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.formats.mitsuba.values import parse_float, parse_numbers, parse_vector
from pmviewer.scene.formats.mitsuba.xml import Element

Matrix = NDArray[np.float64]
OPERATIONS = ("translate", "rotate", "scale", "matrix", "lookat")
_SIMILAR = 1e-5
_EVEN = 1e-3
_NEARLY_UNIT = 0.01
"""Axes are written with few digits."""


def translation(x: float, y: float, z: float) -> Matrix:
    """(4, 4) that moves points and leaves directions."""
    m = np.eye(4)
    m[:3, 3] = x, y, z
    return m


def scaling(x: float, y: float, z: float) -> Matrix:
    """(4, 4) about the origin."""
    return np.diag([x, y, z, 1.0])


def rotation(axis: tuple[float, float, float], degrees: float) -> Matrix:
    """Right-handed rotation about a unit axis through the origin (Rodrigues).

    Mitsuba does not scale other axes to unit length: with them its formula stretches and shears, and so does this one.
    """
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = math.radians(degrees)
    cos, sin = math.cos(angle), math.sin(angle)
    m = np.eye(4)
    m[:3, :3] = cos * np.eye(3) + (1 - cos) * np.outer(axis, axis) + sin * cross
    return m


def look_at(origin: tuple[float, ...], target: tuple[float, ...], up: tuple[float, ...]) -> Matrix:
    """Camera space to world: +x to the left of the image, +y up, +z into the view.

    An `up` that is zero or along the view is replaced as Mitsuba 3 replaces a zero one; ValueError when origin and
    target coincide.
    """
    forward = np.subtract(target, origin, dtype=np.float64)
    length = float(np.linalg.norm(forward))
    if length == 0:
        raise ValueError("expected a lookat whose origin and target differ")
    forward /= length
    left = np.cross(np.asarray(up, float), forward)
    if _along(forward, up):
        left = np.cross(_across(forward), forward)
    left /= np.linalg.norm(left)
    m = np.eye(4)
    m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3] = left, np.cross(forward, left), forward, origin
    return m


def _along(forward: NDArray[np.float64], up: tuple[float, ...]) -> bool:
    """Does `up` say nothing about the roll of a camera that looks along the unit vector?"""
    across = float(np.linalg.norm(np.cross(np.asarray(up, float), forward)))
    return across <= 1e-12 * float(np.linalg.norm(up))


def _across(n: NDArray[np.float64]) -> NDArray[np.float64]:
    """A unit vector at right angles to a unit vector (Duff et al., "Building an orthonormal basis, revisited")."""
    sign = math.copysign(1.0, n[2])
    a = -1.0 / (sign + n[2])
    return np.array([1.0 + sign * n[0] * n[0] * a, sign * n[0] * n[1] * a, -sign * n[0]])


def _components(attributes: dict[str, str], default: float) -> tuple[float, float, float]:
    if "value" in attributes:
        return parse_vector(attributes["value"])
    x, y, z = (parse_float(attributes[c]) if c in attributes else default for c in "xyz")
    return (x, y, z)


def operation(element: Element, warn: Callable[[str], None] = lambda sentence: None) -> Matrix:
    """The matrix of <translate>, <rotate>, <scale>, <matrix> or <lookat>. ValueError says what was expected; what is
    odd but has a meaning goes to `warn`."""
    attributes, tag = element.attributes, element.tag.lower()
    if tag == "translate":
        return translation(*_components(attributes, 0.0))
    if tag == "scale":
        return scaling(*_components(attributes, 1.0))
    if tag == "rotate":
        return _rotate(attributes, warn)
    if tag == "matrix":
        return _matrix(parse_numbers(_required(attributes, "value"), (9, 16)), warn)
    if tag == "lookat":
        up = tuple(parse_numbers(attributes["up"], (3,))) if "up" in attributes else (0.0, 0.0, 0.0)
        origin = tuple(parse_numbers(_required(attributes, "origin"), (3,)))
        target = tuple(parse_numbers(_required(attributes, "target"), (3,)))
        m = look_at(origin, target, up)
        if any(up) and _along(m[:3, 2], up):
            warn("<lookat>: 'up' is along the view, another direction is up in the picture.")
        return m
    raise ValueError(f"expected one of {', '.join(OPERATIONS)} in a transformation, found <{element.tag}>")


def _rotate(attributes: dict[str, str], warn: Callable[[str], None]) -> Matrix:
    axis, angle = _components(attributes, 0.0), parse_float(_required(attributes, "angle"))
    if not any(axis):
        if angle:
            warn("<rotate> has no axis: it was left out.")
        return np.eye(4)
    if abs(math.hypot(*axis) - 1) > _NEARLY_UNIT:
        warn("The axis of <rotate> is not of unit length: it stretches and shears, as it does in Mitsuba 3.")
    return rotation(axis, angle)


def _matrix(numbers: list[float], warn: Callable[[str], None]) -> Matrix:
    if len(numbers) == 9:
        m = np.eye(4)
        m[:3, :3] = np.reshape(numbers, (3, 3))
        return m
    m = np.reshape(numbers, (4, 4)).copy()
    if numbers[12:] != [0.0, 0.0, 0.0, 1.0]:
        warn("The last row of a <matrix> is not 0 0 0 1: it is taken for that, as in Mitsuba 3.")
        m[3] = 0.0, 0.0, 0.0, 1.0
    return m


def _required(attributes: dict[str, str], name: str) -> str:
    if name not in attributes:
        raise ValueError(f"expected the attribute '{name}'")
    return attributes[name]


def apply(m: Matrix, point: tuple[float, float, float]) -> NDArray[np.float64]:
    """The transformed point (3,)."""
    return m[:3, :3] @ np.asarray(point, float) + m[:3, 3]


def cofactor(m: Matrix) -> Matrix:
    """(3, 3) matrix that turns normals (up to length and the determinant's sign); exists for singular matrices too."""
    a, b, c = m[:3, 0], m[:3, 1], m[:3, 2]
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def mirrors(m: Matrix) -> bool:
    """Does the transformation swap left and right?"""
    (a, b, c), (d, e, f), (g, h, i) = m[:3, :3].tolist()
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0


def similar_columns(m: Matrix, count: int = 3) -> float | None:
    """Common length of the first `count` columns if they are orthogonal and equally long, else None."""
    columns = m[:3, :count]
    gram = columns.T @ columns
    square = float(np.trace(gram)) / count
    if np.abs(gram - square * np.eye(count)).max() > _SIMILAR * square:
        return None
    return math.sqrt(square)


def nearest_rotation(m: Matrix) -> tuple[Matrix, bool]:
    """The rotation, or mirroring, nearest to a matrix (3, 3), and whether the matrix keeps angles; the identity where
    the matrix is singular."""
    u, sizes, v = np.linalg.svd(m)
    if not sizes[2] > 1e-12 * sizes[0]:
        return np.eye(3), False
    return np.asarray(u @ v), bool(sizes[0] - sizes[2] <= _EVEN * sizes[0])
