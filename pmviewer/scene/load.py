"""Opening a scene, whatever it is: a bundled name, a folder, a Mitsuba file, a mesh."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pmviewer.errors import SceneError
from pmviewer.resources import data_folder
from pmviewer.scene.defaults.completion import completed
from pmviewer.scene.defaults.light_rigs import Rig
from pmviewer.scene.description import Scene
from pmviewer.scene.formats.mitsuba.load import load_mitsuba
from pmviewer.scene.meshes.tilt import leaning_mirrors

MESH_ENDINGS = (".glb", ".gltf", ".obj", ".ply", ".stl")
ENDINGS = (".xml", *MESH_ENDINGS)

_search_paths: list[Path] = []


def search_also(folders: Iterable[Path]) -> None:
    """From now on, look in these folders too for the files that Mitsuba scenes name (the command line's
    `--search-path`). Raises SceneError for one that is no folder."""
    for folder in folders:
        if not folder.is_dir():
            raise SceneError("This search path is not a folder.", folder, hint="Name an existing folder.")
        _search_paths.append(folder)


@dataclass(frozen=True)
class BundledScene:
    """A scene that ships with the program. `path` is its folder; `shows` says what it is good for."""

    name: str
    path: Path
    title: str
    description: str = ""
    shows: str = ""


def bundled_scenes() -> list[BundledScene]:
    """All scenes in the program's scene folder, by name."""
    found = []
    for folder in sorted(data_folder("scenes").iterdir()):
        if (folder / "scene.xml").is_file():
            about = folder / "scene.toml"
            texts = tomllib.loads(about.read_text("utf-8")) if about.is_file() else {}
            text = {key: str(texts.get(key, "")) for key in ("title", "description", "shows")}
            found.append(BundledScene(folder.name, folder, text.pop("title") or folder.name, **text))
    return found


def load_scene(
    path_or_name: str | Path,
    parameters: Mapping[str, str] | None = None,
    search_paths: Sequence[Path] = (),
    rig: Rig = "auto",
) -> Scene:
    """Open a scene as `read_scene` does, with a camera and the lights of that rig. Raises SceneError."""
    return completed(read_scene(path_or_name, parameters, search_paths), rig)


def read_scene(
    path_or_name: str | Path, parameters: Mapping[str, str] | None = None, search_paths: Sequence[Path] = ()
) -> Scene:
    """What is in a bundled scene, a folder with scene.xml, or a file by its ending; its camera may be a makeshift and
    it may have no light.

    Parameters
    ----------
    path_or_name: "cornell_caustic", "my/folder", "my/scene.xml", "chair.glb" …
    parameters: values for the `<default>` names of a Mitsuba file; which "scene", "camera" and "variant" of a glTF
        file to show; other formats have none.
    search_paths: folders where a Mitsuba file's meshes, pictures and included files are looked for beside its own and
        those of `search_also`.

    Raises SceneError for anything wrong with the input, and nothing else.
    """
    path = _find(path_or_name)
    try:
        scene = _read(path, parameters or {}, search_paths)
    except OSError as error:  # of a disk, while one of the files is being read
        what = f"A file of the scene can't be read: {error.strerror or error}."
        raise SceneError(what, Path(error.filename) if error.filename else path) from None
    leaning = leaning_mirrors(scene)
    return replace(scene, warnings=(*scene.warnings, leaning)) if leaning else scene


def _read(path: Path, parameters: Mapping[str, str], search_paths: Sequence[Path]) -> Scene:
    ending = path.suffix.lower()
    if ending == ".xml":
        scene = load_mitsuba(path, parameters, (*search_paths, *_search_paths))
        return scene if _is_bundled(path) else replace(scene, exposure=None)
    if ending not in MESH_ENDINGS:
        what = (
            f"Files ending in '{path.suffix}' can't be opened."
            if ending
            else "A file without an ending can't be opened."
        )
        raise SceneError(what, path, hint=f"Known endings: {', '.join(ENDINGS)}.")
    from pmviewer.scene.formats.gltf.load import CHOICES
    from pmviewer.scene.formats.meshes import load_mesh_scene

    known = CHOICES if ending in (".glb", ".gltf") else ()
    scene = load_mesh_scene(path, {name: value for name, value in parameters.items() if name in known})
    has = f"have only {', '.join(known)}" if known else "have none"
    ignored = tuple(
        f"Parameter '{name}' was given, but {ending} files {has}." for name in parameters if name not in known
    )
    return replace(scene, warnings=scene.warnings + ignored, exposure=None)


def _is_bundled(path: Path) -> bool:
    """Bundled scenes are made to be shown as they are."""
    return path.resolve().is_relative_to(data_folder("scenes").resolve())


def _find(path_or_name: str | Path) -> Path:
    path = Path(path_or_name).expanduser()
    try:
        if path.is_file():
            return path
        if (path / "scene.xml").is_file():
            return path / "scene.xml"
        is_folder, exists = path.is_dir(), path.exists()
    except (OSError, ValueError):
        raise SceneError(f"{str(path_or_name)[:200]!r} is not a file name.") from None
    for scene in bundled_scenes():
        if scene.name == str(path_or_name):
            return scene.path / "scene.xml"
    if is_folder:
        raise SceneError("The folder has no scene.xml.", path, hint="Name the scene file itself.")
    if exists:
        raise SceneError("This is not a regular file.", path)
    names = ", ".join(scene.name for scene in bundled_scenes())
    raise SceneError("There is no such file or bundled scene.", path, hint=f"Bundled scenes: {names}.")


def reference_of(scene: Scene) -> Path | None:
    """The converged picture from the scene's own camera that lies beside a scene.xml, as it does in every bundled
    folder; None when there is none."""
    if scene.path is None or scene.path.name != "scene.xml":
        return None
    path = scene.path.with_name("reference.exr")
    return path if path.is_file() else None
