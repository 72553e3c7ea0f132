"""Session files: scene, changed settings and number of passes as TOML, enough to get the same picture again.

A session file looks like this; everything but `format` and `scene` may be missing.

    format = 1
    program = "pmviewer 0.1.0"
    scene = "cornell_caustic"
    passes = 64

    [parameters]
    res = "512"

    [settings.photons]
    N = 100000

    [[snapshots]]
    number = 1
    file = "caustic.snapshots/1.exr"

    [[film]]
    at = 1.5
    settings = { "camera.origin" = [0.0, 1.0, 3.0] }

`scene` is a bundled scene's name, or a file: absolute, or relative to the session file.
Snapshots are EXR files (`pmviewer.output.snapshot`) in a folder beside the session file, which has its name.
"""

from __future__ import annotations

import contextlib
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import tomli_w

from pmviewer.errors import OutputError, PmviewerError, SceneError, SettingError
from pmviewer.output.files import read_file, write_file
from pmviewer.progress import check
from pmviewer.resources import data_folder
from pmviewer.settings.access import SETTINGS, Settings, flat, with_values
from pmviewer.settings.film import FilmKey, as_tree, from_tree
from pmviewer.version import __version__

if TYPE_CHECKING:  # brings OpenEXR along, which the window doesn't wait for
    from pmviewer.output.snapshot import Snapshot

FORMAT = 1
SUFFIX = ".toml"
_KEYS = ("format", "program", "scene", "passes", "parameters", "settings", "snapshots", "film")
FOLDER = ".snapshots"
"""Behind the session file's name, without its own ending: where its snapshots are."""
_NEAR = 2
"""A scene up to so many folders above the session file is stored relative to it: the two probably move together."""


@dataclass(frozen=True)
class SessionFile:
    """`scene` is what to open: a bundled scene's name or a file. `passes`: how many the picture had. `parameters`:
    values for the scene file's `<default>` names."""

    settings: Settings
    scene: str
    passes: int
    parameters: Mapping[str, str] = field(default_factory=dict)
    snapshots: tuple[tuple[int, Path], ...] = ()
    """Number and file of each."""
    film: tuple[FilmKey, ...] = ()
    """Keys of the film, by time."""


def write_session(
    path: str | Path,
    settings: Settings,
    scene: str,
    passes: int,
    parameters: Mapping[str, str] | None = None,
    snapshots: Sequence[Snapshot] = (),
    film: Sequence[FilmKey] = (),
    written: dict[Path, Snapshot] | None = None,
) -> None:
    """Write a session file; settings with their default value are left out. Files of snapshots come first, and those of
    the session file that is replaced go when nobody names them any more. `written` are files with the snapshots that
    they hold since the last time, which are not written again; it is brought up to date. Raises OutputError."""
    folder = Path(os.path.realpath(path)).parent
    before = _snapshot_files(path)
    files = _write_snapshots(Path(path), snapshots, {} if written is None else written)
    tree: dict[str, Any] = {
        "format": FORMAT,
        "program": f"pmviewer {__version__}",
        "scene": _stored_scene(scene, folder),
        "passes": int(passes),
    }
    if parameters:
        tree["parameters"] = dict(parameters)
    changed = {name: value for name, value in flat(settings).items() if value != SETTINGS[name].default}
    if changed:
        tree["settings"] = _nested(changed)
    if files:
        tree["snapshots"] = [
            {"number": snapshot.number, "file": file.relative_to(file.parents[1]).as_posix()}
            for snapshot, file in zip(snapshots, files, strict=True)
        ]
    if film:
        tree["film"] = as_tree(film)
    write_file(path, tomli_w.dumps(tree).encode("utf-8"), (SUFFIX,))
    for gone in before - set(files):
        with contextlib.suppress(OSError):
            gone.unlink()


def _write_snapshots(path: Path, snapshots: Sequence[Snapshot], written: dict[Path, Snapshot]) -> list[Path]:
    """The files of the snapshots, in the session file's folder for them; those that are `written` stay as they are."""
    folder = path.with_suffix(FOLDER)
    if not snapshots:
        return []
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{folder}: the folder of the snapshots can't be made ({error.strerror}).") from None
    from pmviewer.output.snapshot import write_snapshot

    files = [folder / f"{snapshot.number}.exr" for snapshot in snapshots]
    for file in set(written) - set(files):
        del written[file]
    for snapshot, file in zip(snapshots, files, strict=True):
        check()
        if written.get(file) is not snapshot or not file.is_file():
            written.pop(file, None)
            write_snapshot(file, snapshot)
            written[file] = snapshot
    return files


def _snapshot_files(path: str | Path) -> set[Path]:
    """Files of snapshots that a session file has now, those in the folder with its name alone."""
    try:
        listed = read_session(path).snapshots
    except (PmviewerError, OSError):
        return set()
    own = Path(path).with_suffix(FOLDER)
    return {own / file.name for _, file in listed if file.parent.name == own.name}


def read_session(path: str | Path) -> SessionFile:
    """Read a session file.

    Raises SceneError when it can't be read or isn't TOML, SettingError when it holds something else than what a
    session file may hold; both name the file and the line or the key.
    """
    path = Path(path)
    tree = _parse(path)
    try:
        return _session(tree, Path(os.path.realpath(path)).parent)
    except SettingError as error:
        raise SettingError(f"{path}: {error}") from None


def _parse(path: Path) -> dict[str, Any]:
    data = read_file(path)
    try:
        return tomllib.loads(data.decode("utf-8").replace("\r\n", "\n"))
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise SceneError("This is not a session file: it is not UTF-8 text.", path, line) from None
    except RecursionError:
        raise SceneError("This is not a session file: it is nested too deeply.", path) from None
    except ValueError as error:
        found = re.fullmatch(r"(.*) \(at line (\d+), column \d+\)", str(error), re.DOTALL)
        what = found[1] if found else str(error)
        raise SceneError(
            f"This is not a session file: {what[:1].lower()}{what[1:]}.",
            path,
            int(found[2]) if found else None,
            "Session files are TOML, as File ▸ Save session writes it.",
        ) from None


def _session(tree: dict[str, Any], folder: Path) -> SessionFile:
    version = tree.get("format")
    if version != FORMAT or isinstance(version, bool):
        found = "format is missing" if version is None else f"format = {version!r}"
        raise SettingError(f"{found}; this program reads session files with format = {FORMAT}.")
    for key in tree:
        if key not in _KEYS:
            raise SettingError(f"there is no key '{key}' in a session file. Known are {', '.join(_KEYS)}.")
    scene, passes, parameters = tree.get("scene"), tree.get("passes", 0), tree.get("parameters", {})
    if not isinstance(scene, str) or not scene.strip() or "\0" in scene:
        raise SettingError('scene is missing: expected a bundled scene\'s name or a file, as in scene = "box.xml".')
    most = int(SETTINGS["render.passes"].upper or 0)
    if not isinstance(passes, int) or isinstance(passes, bool) or not 0 <= passes <= most:
        raise SettingError(f"passes = {passes!r} is not allowed: expected a whole number from 0 to {most}.")
    if not isinstance(parameters, dict):
        raise SettingError('parameters is not allowed as it is: expected a table, as in [parameters] and res = "512".')
    for name, value in parameters.items():
        if not isinstance(value, str | int | float) or isinstance(value, bool):
            raise SettingError(f"parameters.{name} = {value!r} is not allowed: expected a text or a number.")
    values = tree.get("settings", {})
    if not isinstance(values, dict):
        raise SettingError(
            "settings is not allowed as it is: expected tables, as in [settings.photons] and N = 100000."
        )
    settings = with_values(Settings(), dict(_leaves(values, "")))
    texts = {name: str(value) for name, value in parameters.items()}
    snapshots, film = _snapshots(tree.get("snapshots", []), folder), from_tree(tree.get("film", []))
    return SessionFile(settings, _found_scene(scene, folder), passes, texts, snapshots, film)


def _snapshots(rows: Any, folder: Path) -> tuple[tuple[int, Path], ...]:
    """Number and file of each row; numbers are whole, positive and tell one from another."""
    expected = 'expected rows as [[snapshots]] with number = 1 and file = "name.snapshots/1.exr"'
    if not isinstance(rows, list):
        raise SettingError(f"snapshots is not allowed as it is: {expected}.")
    found: dict[int, Path] = {}
    for row in rows:
        number, file = (row.get("number"), row.get("file")) if isinstance(row, dict) else (None, None)
        if not isinstance(number, int) or isinstance(number, bool) or not 0 < number < 10**6 or number in found:
            raise SettingError(f"snapshots: {row!r} is not allowed: {expected}, each with a number of its own.")
        if not isinstance(file, str) or not file.strip() or "\0" in file or len(row) != 2:
            raise SettingError(f"snapshots: {row!r} is not allowed: {expected}.")
        found[number] = folder / file
    return tuple(found.items())


def _nested(values: Mapping[str, Any]) -> dict[str, Any]:
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *groups, name = path.split(".")
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[name] = list(value) if isinstance(value, tuple) else value
    return tree


def _leaves(tree: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        path = f"{prefix}{key}"
        if isinstance(value, dict) and path not in SETTINGS:
            yield from _leaves(value, f"{path}.")
        else:
            yield path, value


def _is_scene(path: Path) -> bool:
    try:
        return path.is_file() or (path / "scene.xml").is_file()
    except (OSError, ValueError):
        return False


def _stored_scene(scene: str, folder: Path) -> str:
    """Files near the session file relative to it, with a leading dot so that they aren't taken for bundled names."""
    path = Path(scene).expanduser()
    if not _is_scene(path):
        return scene
    real = Path(os.path.realpath(path))
    bundled = _bundled_name(real)
    if bundled:
        return bundled
    try:
        relative = Path(os.path.relpath(real, folder))
    except ValueError:  # another drive
        return str(real)
    if relative.parts.count("..") > _NEAR:
        return str(real)
    text = relative.as_posix()
    return text if text.startswith("..") else f"./{text}"


def _bundled_name(real: Path) -> str | None:
    try:
        bundled = Path(os.path.realpath(data_folder("scenes")))
    except PmviewerError:
        return None
    scene = real.parent if real.name == "scene.xml" else real
    return scene.name if scene.parent == bundled else None


def _found_scene(text: str, folder: Path) -> str:
    """The inverse: a bare word without an ending is a bundled scene's name, anything else a file."""
    plain = PurePosixPath(text)
    if len(plain.parts) == 1 and not plain.suffix and not text.startswith((".", "~")) and "\\" not in text:
        return text
    path = Path(text).expanduser()
    return str(path) if path.is_absolute() else os.path.normpath(folder / path)
