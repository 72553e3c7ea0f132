"""pmviewer: an interactive previewer for photon-mapping global illumination.

    import pmviewer

    with pmviewer.open("cornell_caustic") as s:
        s.set(N=200_000, q=0.5)
        picture = s.render(passes=8).beauty

`open` is the library, `attach` reaches a window that is open already (`docs/python.md`). Importing pmviewer loads
nothing else: the command line and the window do so first of all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pmviewer.version import __version__

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path
    from typing import Any

    from pmviewer.library.attaching.attached import Attached
    from pmviewer.library.rendering import Rendering
    from pmviewer.scene.description import Scene

__all__ = ["__version__", "attach", "open"]


def open(
    scene: str | Path | Scene,
    settings: Mapping[str, Any] | None = None,
    *,
    parameters: Mapping[str, Any] | None = None,
    search_paths: Sequence[str | Path] = (),
    threads: int | None = None,
) -> Rendering:
    """Open a scene to render it from Python.

    Parameters
    ----------
    scene: a bundled scene's name, a scene file (.xml .glb .gltf .obj .ply .stl), a folder with scene.xml, a session
        file (.toml), or a `pmviewer.scene.description.Scene`.
    settings: by name, as for `Rendering.set`; they go before those of a session file.
    parameters: values for the `<default>` names of a Mitsuba file; `scene`, `camera` and `variant` of a glTF file.
    search_paths: folders where the files that a Mitsuba scene names are looked for, besides its own.
    threads: that kernels run on; as many as there are processors if None.

    Close what is returned, or use it in a `with` statement: it holds threads and maps. Raises SceneError for a scene
    that can't be opened and SettingError for settings that are not allowed (both in `pmviewer.errors`). What the
    picture will not show is a warning (`pmviewer.errors.PictureWarning`).
    """
    from importlib import import_module  # no import statement: everything that is imported there imports this module

    return import_module("pmviewer.library.rendering").Rendering(
        scene, settings, parameters=parameters, search_paths=search_paths, threads=threads
    )


def attach(pid: int | None = None) -> Attached:
    """A window in another process, to change it, read it and show pictures in it: the one of the process `pid`, or the
    one that has begun to listen last. A window listens when its user allows it, by `--listen` or in its menu File.

    Raises WindowError where none listens.
    """
    from importlib import import_module

    return import_module("pmviewer.library.attaching.attached").attach(pid)
