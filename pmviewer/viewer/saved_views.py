"""Views that the user has saved, by scene: kept in the user's configuration from one start to the next."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomli_w

from pmviewer.output.files import write_file
from pmviewer.render.camera import CameraPose
from pmviewer.viewer.viewport.controls import camera_values

FILE = "views.toml"
MOST = 50
"""Of one scene; the oldest go."""
_VECTORS = ("origin", "target", "up")


class SavedViews:
    """In a file of that path; one that can't be read is begun anew, and one that can't be written is a sentence for
    the log."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._views: dict[str, dict[str, dict[str, Any]]] | None = None

    def of(self, scene: str) -> dict[str, dict[str, Any]]:
        """Names and, for `settings_of`, poses of the scene's views, oldest first."""
        return self._all().get(scene, {})

    def add(self, scene: str, pose: CameraPose) -> str:
        """Save the pose; returns the name that it got. Raises OutputError when the file can't be written."""
        views = self._all().setdefault(scene, {})
        number = 1 + max((int(name.split()[-1]) for name in views), default=0)
        values = camera_values(pose)
        kept: dict[str, Any] = {name: [float(v) for v in getattr(pose, name)] for name in _VECTORS}
        kept |= {"fov": pose.fov}
        if "camera.view_width" in values:
            kept["view_width"] = pose.view_width
        views[f"View {number}"] = kept
        for name in list(views)[:-MOST]:
            del views[name]
        self._write()
        return f"View {number}"

    def remove(self, scene: str, name: str) -> None:
        """Forget that view. Raises OutputError when the file can't be written."""
        self._all().get(scene, {}).pop(name, None)
        self._write()

    def _all(self) -> dict[str, dict[str, dict[str, Any]]]:
        if self._views is None:
            try:
                self._views = {
                    scene: {name: view for name, view in views.items() if _is_view(name, view)}
                    for scene, views in tomllib.loads(self._path.read_text("utf-8")).items()
                    if isinstance(views, dict)
                }
            except (OSError, ValueError):
                self._views = {}
        return self._views

    def _write(self) -> None:
        self._path.parent.mkdir(parents=True, exist_ok=True)
        write_file(self._path, tomli_w.dumps(self._all()).encode("utf-8"), (self._path.suffix,))


def settings_of(view: dict[str, Any], group: str) -> dict[str, Any]:
    """What a view sets in the group "camera" or "free_camera", by full name."""
    values: dict[str, Any] = {f"{group}.{name}": tuple(view[name]) for name in _VECTORS}
    values[f"{group}.fov"] = view["fov"]
    if "view_width" in view and group == "camera":
        values["camera.view_width"] = view["view_width"]
    return values


def _is_view(name: str, view: Any) -> bool:
    """Whether that is what `add` has written: people edit files."""
    if not (isinstance(view, dict) and name.split()[-1:] and name.split()[-1].isdecimal()):
        return False
    vectors = [view.get(vector) for vector in _VECTORS]
    numbers = [view.get("fov"), *(v for vector in vectors if isinstance(vector, list) for v in vector)]
    return len(numbers) == 10 and all(isinstance(v, int | float) and not isinstance(v, bool) for v in numbers)
