"""Where to look from at a file that has no camera.

Candidates are rated by what they see. Around the scene stand cameras at several azimuths and heights, as near as has
everything in the picture; inside, where rays into nearly all directions meet something, cameras stand with their back
to what is behind them. A picture's rating is its viewpoint entropy (Vázquez, Feixas, Sbert and Heidrich, "Viewpoint
selection using viewpoint entropy", 2001), −Σ pᵢ log pᵢ over the shares of the surface patches in it, times what speaks
against it: backs of surfaces, things in front of the lens, much empty background, an unusual angle.

A scene is looked at from inside if that shows what can't be seen from outside. The inside of a bunny can: the hull that
is seen is the same from both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pmviewer.scene.defaults.framing import AZIMUTH, ELEVATION, Up, axes_of, direction, fitted, looking
from pmviewer.scene.defaults.picture_rating import Rated, picture_rays, rated_pictures
from pmviewer.scene.defaults.proxy import Proxy
from pmviewer.scene.description import Camera

Float = NDArray[np.float64]
INSIDE_FOV = 75.0
_ENCLOSED = 0.7
"""Share of the directions in which a place inside must see something."""
_SOME_FRONT = 0.05
"""Share of the directions in which it must see the front of something: within a solid there are backs alone."""
_HIDDEN, _HIDDEN_FRONTS, _HIDDEN_WALLS = 0.25, 0.1, 0.05
"""Share of what is seen inside that must be hidden from outside."""
_A_LINE = 0.06
"""Share of the picture."""
_MOST_SEEN = 0.9
"""Share of what the best view shows of the surface that is as good."""
_DETAIL, _MOST_DETAIL, _DETAIL_SIZE = 0.75, 0.9, 0.25
"""What a view of the detail alone counts, the share of the points that it must hold, and its largest size, relative to
everything."""
_FACING, _FACING_AWAY = 0.8, 0.6
"""Share of fronts in the picture, from where surfaces face inwards on; and up to where they do, from outside."""
_WALLS = 0.35
_INSIDE_BETTER, _PLAIN_BETTER, _PLAIN = 1.4, 1.1, 3.0
"""How much better the view inside must be; the second where that from outside rates below the third: a box."""
_PLACES, _HEADINGS = 5, 10


@dataclass(frozen=True)
class Viewpoint:
    """`inside`: does the camera stand in a room? `place` is the middle of the emptiest part of the room that it stands
    in or looks into, `enclosed` the share of the directions from there in which there is a surface: 0 without a room,
    and `place` is then the middle of what is looked at."""

    camera: Camera
    inside: bool
    place: Float
    enclosed: float


def chosen_viewpoint(proxy: Proxy, up: Up) -> Viewpoint:
    """The best view of the scene, the same every time."""
    subjects = _subjects(proxy)
    around = [
        (rated, points, rating * (_DETAIL if i else 1.0))
        for i, points in enumerate(subjects)
        for rated, rating in _outside(proxy, points, up)
    ]
    outside, points, _ = max(around, key=lambda found: found[2])
    places = [place for subject in subjects for place in _places(proxy, subject, up)]
    within = [(rated, place) for place, scale in places for rated in _views_from(proxy, place, scale, up)]
    if within:
        inside, place = max(within, key=lambda pair: pair[0].rating)
        better = _PLAIN_BETTER if outside.rating < _PLAIN else _INSIDE_BETTER
        if inside.rating > better * outside.rating and _is_room(proxy, inside, outside):
            return Viewpoint(inside.camera, True, place, enclosure(proxy, place))
    for place, _ in places:
        if sees(proxy, outside.camera, place):
            return Viewpoint(outside.camera, False, place, enclosure(proxy, place))
    return Viewpoint(outside.camera, False, (points.min(axis=0) + points.max(axis=0)) / 2, 0.0)


def sees(proxy: Proxy, camera: Camera, place: Float) -> bool:
    """Is nothing between the camera and the place?"""
    way = place - np.asarray(camera.origin)
    distance = float(np.linalg.norm(way))
    return distance == 0 or not proxy.occluded(np.asarray(camera.origin), way[None] / distance, distance)[0]


def _is_room(proxy: Proxy, inside: Rated, outside: Rated) -> bool:
    """Does the view inside, much the better one, show what can't be seen from outside? Where it sees fronts, less of
    that will do, and nothing if surfaces are walls that turn their backs outwards. What is all but a line from outside
    is a tunnel."""
    hidden = _hidden(proxy, inside.camera)
    if hidden >= _HIDDEN or (outside.cover < _A_LINE and inside.rating > 2 * outside.rating):
        return True
    if inside.front < _FACING:
        return False
    if hidden >= _HIDDEN_FRONTS:
        return True
    return outside.front <= _FACING_AWAY and (hidden >= _HIDDEN_WALLS or _walls(proxy) >= _WALLS)


def _walls(proxy: Proxy) -> float:
    """Share of the surface that lies along the coordinate planes."""
    along = np.abs(proxy.normals).max(axis=1) > math.cos(math.radians(5))
    return float(proxy.areas[along].sum() / proxy.areas.sum())


def _subjects(proxy: Proxy) -> list[Float]:
    """Points (n, 3) that a picture shall hold: those where triangles have corners, but for what lies far outside; and,
    where that is much smaller, those where the detail is, as on a wide ground."""
    by_area, _ = proxy.sampled(1000)
    by_count, _ = proxy.sampled(2000, np.ones(len(proxy.areas)))
    whole = _within(proxy, np.concatenate([by_area, by_count]), 0.5, 0.4)
    detail = _within(proxy, by_count, 2.0, 0.1)
    smaller = np.linalg.norm(np.ptp(detail, axis=0)) < _DETAIL_SIZE * np.linalg.norm(np.ptp(whole, axis=0))
    detailed = smaller and len(detail) >= _MOST_DETAIL * len(proxy.points)
    return [_outermost(whole), _outermost(detail)] if detailed else [_outermost(whole)]


def _outermost(points: Float) -> Float:
    """Those of the points (n, 3) that lie farthest in one of some 130 directions, which fill a picture as all do but
    for a percent."""
    ways = np.concatenate([np.eye(3), -np.eye(3), sphere_directions(128)]).astype(np.float32)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, z = (np.subtract(points[:, k], middle[k], dtype=np.float64).astype(np.float32) for k in range(3))
    # One direction at a time: all at once are a table that no cache holds.
    return points[np.unique([int((a * x + b * y + c * z).argmax()) for a, b, c in ways])]


def _within(proxy: Proxy, samples: Float, percent: float, beyond: float) -> Float:
    """The points in the box that holds the samples but for so many percent at each end, and of its size beyond."""
    low, high = np.percentile(samples, (percent, 100 - percent), axis=0)
    reach = beyond * float((high - low).max())
    inside = np.ones(len(proxy.points), bool)
    for column, least, most in zip(proxy.points.T, low - reach, high + reach):
        inside &= (column >= least) & (column <= most)
    return proxy.points[inside] if inside.any() else proxy.points


# outside --------------------------------------------------------------------------------------------------------------


def _outside(proxy: Proxy, points: Float, up: Up) -> list[tuple[Rated, float]]:
    """Views from around these points, and what they are worth among each other."""
    angles = [(azimuth, elevation) for elevation in (10.0, ELEVATION, 45.0) for azimuth in _azimuths()]
    angles += [(azimuth, 4.0) for azimuth in (0.0, 90.0, 180.0, 270.0)]
    cameras = [fitted(points, direction(azimuth, elevation, up), up) for azimuth, elevation in angles]
    ratings = rated_pictures(proxy, cameras, 0.02 * float(np.linalg.norm(np.ptp(points, axis=0))), inside=False)
    seen = _seen(proxy, np.array([camera.origin for camera in cameras]))
    seen = np.minimum(seen / max(_MOST_SEEN * float(seen.max()), 1e-9), 1.0) ** 2
    return [
        (rated, rated.rating * share * _habit(azimuth, elevation))
        for rated, share, (azimuth, elevation) in zip(ratings, seen, angles)
    ]


def _azimuths() -> list[float]:
    return [AZIMUTH + 36.0 * k for k in range(10)]


def _habit(azimuth: float, elevation: float) -> float:
    """How photographers like the angle: three quarters from the front, slightly above, not straight at a side."""
    straight = 0.95 if azimuth % 90 == 0 else 1.0
    turned = 1 - math.cos(math.radians(azimuth - AZIMUTH))
    raised = abs(elevation - ELEVATION) / 22
    return straight * (1 - 0.1 * turned) * (1 - 0.07 * raised)


def _seen(proxy: Proxy, eyes: Float) -> Float:
    """Share of the surface that each eye (n, 3) can see, whatever its side."""
    points, _ = proxy.sampled(192)
    towards = eyes[:, None] - points
    distance = np.linalg.norm(towards, axis=2)
    rays = (towards / distance[..., None]).reshape(-1, 3)
    starts = np.broadcast_to(points, towards.shape).reshape(-1, 3)
    hidden = proxy.occluded(starts, rays, distance.reshape(-1))
    return 1 - hidden.reshape(distance.shape).mean(axis=1)


# inside ---------------------------------------------------------------------------------------------------------------


def sphere_directions(count: int) -> Float:
    """Unit vectors (count, 3) spread evenly: the spherical Fibonacci lattice."""
    z = 1 - (2 * np.arange(count) + 1) / count
    phi = np.arange(count) * math.pi * (3 - math.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1)


def _around(proxy: Proxy, places: Float, rays: Float) -> tuple[Float, Float]:
    """Distances (places, rays) to what is around each place, inf for nothing."""
    hits = proxy.closest(np.repeat(places, len(rays), axis=0), np.tile(rays, (len(places), 1)))
    distance = hits.distance.reshape(len(places), len(rays))
    return distance, np.isfinite(distance)


def enclosure(proxy: Proxy, place: Float) -> float:
    """Share of the directions from a place in which there is a surface."""
    _, met = _around(proxy, place[None], sphere_directions(64))
    return float(met.mean())


def _places(proxy: Proxy, points: Float, up: Up) -> list[tuple[Float, float]]:
    """The emptiest places with something nearly all around, at eye height where there is a floor, and how far away
    that is."""
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, 1e-9 * proxy.radius)
    number = np.clip(np.round(extent / extent.max() * 8), 3, 8).astype(int)
    steps = [low[k] + (np.arange(n) + 0.5) / n * extent[k] for k, n in enumerate(number)]
    lattice = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
    rays = sphere_directions(24)
    hits = proxy.closest(np.repeat(lattice, 24, axis=0), np.tile(rays, (len(lattice), 1)))
    met, front = hits.met.reshape(-1, 24), hits.front.reshape(-1, 24)
    open_to = np.percentile(np.where(met, hits.distance.reshape(-1, 24), 0.0), 20, axis=1)
    enclosed = (met.mean(axis=1) >= _ENCLOSED) & (front.mean(axis=1) >= _SOME_FRONT)
    rating = np.where(enclosed, open_to, 0.0)
    order = np.argsort(-rating, kind="stable")
    chosen: list[int] = []
    for i in order:
        if rating[i] < 0.05 * extent.min() or rating[i] < 0.3 * rating[order[0]] or len(chosen) == _PLACES:
            break
        if all(np.linalg.norm(lattice[i] - lattice[j]) >= 1.5 * rating[i] for j in chosen):
            chosen.append(int(i))
    top = axes_of(up)[1]
    return [(_at_eye_height(proxy, lattice[i], top), float(rating[i])) for i in chosen]


def _at_eye_height(proxy: Proxy, place: Float, top: Float) -> Float:
    """The place moved up or down to a little below the middle between floor and ceiling."""
    distance, _ = _around(proxy, place[None], np.stack([-top, top]))
    below, above = (float(d) for d in distance[0])
    if not math.isfinite(below):
        return place
    gap = below + (above if math.isfinite(above) else below)
    moved = place + top * (0.45 * gap - below)
    around, _ = _around(proxy, moved[None], sphere_directions(24))
    return moved if around.min() > 0.05 * gap else place


def _hidden(proxy: Proxy, camera: Camera) -> float:
    """Share of the picture's surfaces that can't be seen from outside the scene, from either side."""
    rays = picture_rays(camera, 10)
    hits = proxy.closest(np.broadcast_to(camera.origin, rays.shape), rays)
    if not hits.met.any():
        return 0.0
    rays = rays[hits.met]
    found = np.asarray(camera.origin) + hits.distance[hits.met, None] * rays
    away = np.tile(sphere_directions(40), (len(found), 1))
    blocked = np.ones(len(found), bool)
    for side in (-1e-3, 1e-3):
        starts = np.repeat(found + side * proxy.radius * rays, 40, axis=0)
        blocked &= proxy.occluded(starts, away, 4 * proxy.radius).reshape(-1, 40).all(axis=1)
    return float(blocked.mean())


def _views_from(proxy: Proxy, place: Float, scale: float, up: Up) -> list[Rated]:
    """Views over a place, from as far behind it as there is room."""
    top = axes_of(up)[1]
    forward = -np.stack([direction(AZIMUTH + 360.0 / _HEADINGS * k, 6.0, up) for k in range(_HEADINGS)])
    level = forward - (forward @ top)[:, None] * top
    level /= np.linalg.norm(level, axis=1, keepdims=True)
    side = np.cross(level, top)
    behind = np.stack([-level, -level + 0.25 * side, -level - 0.25 * side, -level + 0.2 * top, -level - 0.2 * top], 1)
    behind /= np.linalg.norm(behind, axis=2, keepdims=True)
    distance, _ = _around(proxy, place[None], behind.reshape(-1, 3))
    room = distance.reshape(_HEADINGS, -1).min(axis=1)
    back = np.minimum(np.where(np.isfinite(room), 0.85 * room, 0.0), 1.5 * proxy.radius)
    eyes = place - level * back[:, None]
    ahead = proxy.closest(eyes, forward).distance
    targets = eyes + forward * np.where(np.isfinite(ahead), ahead, proxy.radius)[:, None]
    cameras = [looking(eye, target, up, INSIDE_FOV) for eye, target in zip(eyes, targets)]
    return rated_pictures(proxy, cameras, 0.25 * scale, inside=True)
