"""Keys of a film made comparable: what is automatic in one and a number in another, and what only one edits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.method import plan_of
from pmviewer.engine.opened import OpenScene
from pmviewer.engine.radius import FirstRadii, mean_radii
from pmviewer.engine.stages.spread import radii_of_first_pass
from pmviewer.engine.store import StageStore
from pmviewer.errors import SettingError
from pmviewer.render.camera import CameraPose, resolve_camera
from pmviewer.scene.description import Scene
from pmviewer.scene.editing.own import own_numbers
from pmviewer.settings.access import SETTINGS, Settings, get, with_values
from pmviewer.settings.film import FilmKey, FilmWay, comparable
from pmviewer.tasks import in_turn

_CAMERA = ("origin", "target", "up", "fov", "view_width", "shift_x", "shift_y", "aperture", "focus")


def completed_keys(scene: Scene, whole: Scene, keys: Sequence[Settings]) -> list[Settings]:
    """The keys with numbers wherever they differ, of the open `scene` and the one before it was edited. Raises
    SettingError for an edit of what the scene does not have, and for a number that nobody knows."""
    names = list(dict.fromkeys(name for key in keys for name in key.edit.changes))
    own = {name: own_numbers(whole, name) for name in names if not all(name in key.edit.changes for key in keys)}
    differing = [
        name for name in _CAMERA if any(get(k, f"camera.{name}") != get(keys[0], f"camera.{name}") for k in keys)
    ]
    found = []
    for key in keys:
        pose = resolve_camera(scene, key.camera)
        values: dict[str, Any] = {}
        for name in differing:
            if get(key, f"camera.{name}") == "auto":
                values[f"camera.{name}"] = _of_pose(pose, name)
        if own:
            values["edit.changes"] = {**own, **key.edit.changes}
        found.append(with_values(key, values))
    return found


def film_way(scene: Scene, whole: Scene, keys: Sequence[FilmKey]) -> FilmWay:
    """The way through the keys, of which there is one at least; `scene` and `whole` as in `completed_keys`. Raises
    SettingError, for what can't be gone through between the keys too."""
    by_time = sorted(keys, key=lambda key: key.at)
    settings = comparable(by_time)
    differing = tuple(path for path in SETTINGS if any(get(one, path) != get(settings[0], path) for one in settings))
    of_keys = completed_keys(scene, whole, settings)
    way = FilmWay(tuple(key.at for key in by_time), tuple(of_keys), differing)
    for first, second in zip(way.times, way.times[1:], strict=False):
        way.at(0.5 * (first + second), settings[0])
    return way


def orbits(scene: Scene, settings: Settings, pictures: int, degrees: float) -> list[Settings]:
    """The camera on its way around its target, about its up axis, by so many degrees in so many pictures; a whole turn
    ends one step before it begins again."""
    pose = resolve_camera(scene, settings.camera)
    target, offset = np.asarray(pose.target, float), np.subtract(pose.origin, pose.target)
    up = np.asarray(pose.up, float) / np.linalg.norm(pose.up)
    closed = abs(degrees) % 360 == 0
    steps = np.linspace(0.0, np.radians(degrees), pictures, endpoint=not closed)
    origins = [target + _turned(offset, up, angle) for angle in steps]
    return [
        with_values(
            settings, {"camera.origin": tuple(map(float, o)), "camera.target": pose.target, "camera.up": pose.up}
        )
        for o in origins
    ]


def automatic_radius(opened: OpenScene, settings: Settings, store: StageStore) -> FirstRadii:
    """The look-up radii, relative to the scene's, that a picture by these settings takes where they are automatic; the
    store keeps the photons that tell."""
    plan = plan_of(settings, opened.traits)
    camera = resolve_camera(opened.scene, settings.camera)
    automatic = with_values(settings, {"estimate.radius": "auto"})
    return radii_of_first_pass(opened, automatic, plan, camera, in_turn, store).scaled(1 / opened.flat.radius)


def with_one_radius(opened: OpenScene, settings: Sequence[Settings]) -> list[Settings]:
    """Automatic radii, which follow the camera in steps, as numbers for the whole film: the geometric mean of what its
    pictures would have alone."""
    store = StageStore()
    radii = [automatic_radius(opened, one, store) for one in settings if one.estimate.radius == "auto"]
    if len(set(radii)) < 2:
        return list(settings)
    first = mean_radii(radii)

    def with_radius(one: Settings) -> Settings:
        # A radius by hand would be used for look-ups of the nearest photons; it is for those in media.
        kept = {"estimate.lookup": "nearest"} if plan_of(one, opened.traits).nearest else {}
        return with_values(one, {**first.values(one.estimate), **kept})

    return [with_radius(one) if one.estimate.radius == "auto" else one for one in settings]


def _turned(v: NDArray[np.float64], axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """About a unit axis (Rodrigues)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(v * c + np.cross(axis, v) * s + axis * float(axis @ v) * (1 - c))


def _of_pose(pose: CameraPose, name: str) -> Any:
    if name in ("shift_x", "shift_y"):
        return pose.shift["xy".index(name[-1])]
    value = getattr(pose, name)
    if value is None:
        raise SettingError(f"camera.{name} is a number in one key and auto in another: give it a number in both.")
    return value
