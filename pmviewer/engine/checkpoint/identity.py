"""What a rendering is of: hashes of the scene by its parts, settings, and the program; and in words what differs.

The scene is what kernels read, whatever the file is called and whenever it was changed. The program is its version and
the sources that decide about a picture: those of the renderer and all that it imports. Numba and the processor decide
about the last bits of compiled code: other ones are no reason to refuse, and said.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numpy.typing import NDArray

from pmviewer import __version__
from pmviewer.engine.opened import OpenScene
from pmviewer.kernels.accel.instance import G_BLOCKS, G_NODES, G_QUADRICS
from pmviewer.kernels.compile.sources import PACKAGE, sources_of
from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import SETTINGS, Settings, flat

ROOMS = ("engine", "importance", "kernels", "maps", "photons", "render", "scene", "settings")
"""Whose sources decide about a picture."""
PARTS = {
    "materials": ("materials", "prim_material", "bsdf_tables", "glasses", "spectrum"),
    "textures": ("textures", "texel_starts", "texels"),
    "lights": (
        *("lights", "light_cdf", "light_triangles", "light_triangle_cdf", "prim_light", "light_power"),
        *("light_textures", "light_frames", "light_tables", "sky_texels", "sky_rows", "sky_cells"),
    ),
    "media": (
        *("media", "prim_media", "light_media"),
        *("voxels", "grid_blocks", "grid_frames", "grid_sizes", "medium_grids"),
    ),
}
"""Arrays of a flat scene by the part that they belong to; all others are the shapes'."""
FREE = ("stop", "display")
"""Stages of settings that may be other ones: the film does not depend on them."""
MOST_NAMED = 6
"""Settings that a sentence names."""


def scene_hashes(opened: OpenScene, camera: CameraPose, render_camera: CameraPose) -> dict[str, str]:
    """A hash of each part of the scene, by its name; the `camera` is what the film shows, the render camera what
    importance and radii are of."""
    hashes = {part: hashlib.sha256() for part in ("shapes", *PARTS)}
    owner = {name: part for part, names in PARTS.items() for name in names}
    for name, array in sorted({**opened.flat.arrays, "light_power": opened.flat.light_power}.items()):
        into = hashes[owner.get(name, "shapes")]
        into.update(f"{name} {array.shape} {array.dtype}\n".encode())
        into.update(np.ascontiguousarray(_without_addresses(name, array)).data)
    hashes["shapes"].update(repr((opened.flat.center.tolist(), opened.flat.radius)).encode())
    found = {part: of_part.hexdigest()[:32] for part, of_part in hashes.items()}
    poses = [sorted(asdict(pose).items()) for pose in (camera, render_camera)]
    return {**found, "camera": hashlib.sha256(repr(poses).encode()).hexdigest()[:32]}


def _without_addresses(name: str, array: NDArray[Any]) -> NDArray[Any]:
    return np.delete(array, [G_NODES, G_BLOCKS, G_QUADRICS], axis=1) if name == "groups" else array


@cache
def program() -> dict[str, str]:
    """The program that renders, by what tells it from others: `version` and `sources` decide about the picture, `numba`
    and `processor` about its last bits."""
    renderer = Path(__file__).parents[1] / "renderer.py"
    files = sorted(file for file in sources_of(renderer) if file.relative_to(PACKAGE).parts[0] in ROOMS)
    content = hashlib.sha256()
    for file in files:
        content.update(file.relative_to(PACKAGE).as_posix().encode() + b"\0" + file.read_bytes())
    return {
        "version": __version__,
        "sources": content.hexdigest()[:16],
        "numba": f"{numba.__version__} with LLVM of llvmlite {llvmlite.__version__}, numpy {np.__version__}",
        "processor": llvmlite.binding.get_host_cpu_name(),
    }


def decisive(settings: Settings) -> dict[str, Any]:
    """By full name, the settings that a film depends on, as JSON holds them."""
    return {path: as_json(value) for path, value in flat(settings).items() if SETTINGS[path].stage not in FREE}


def as_json(value: Any) -> Any:
    """A setting's value with lists for tuples."""
    if isinstance(value, Mapping):
        return {str(key): as_json(inner) for key, inner in value.items()}
    return list(map(as_json, value)) if isinstance(value, tuple | list) else value


def other_program(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """What decides about the picture and differs, in words; "" where nothing does."""
    if before["version"] != now["version"]:
        return f"it was made by pmviewer {before['version']}, and this is {now['version']}"
    if before["sources"] != now["sources"]:
        return f"it was made by other sources of pmviewer {now['version']} ({before['sources']}, now {now['sources']})"
    return ""


def other_bits(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """What decides about last bits alone and differs, in words; "" where nothing does."""
    said = [f"{before[name]}, now {now[name]}" for name in ("numba", "processor") if before[name] != now[name]]
    return "; ".join(said)


def other_scene(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Which parts differ, in words."""
    parts = [part for part in now if before.get(part) != now[part]]
    return f"the scene has {_other(parts)}" if parts else ""


def _other(parts: Sequence[str]) -> str:
    named = [f"another {part}" if part == "camera" else f"other {part}" for part in parts]
    return named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"


def other_settings(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Which settings differ, with both values."""
    names = [name for name in {**before, **now} if before.get(name) != now.get(name)]
    said = [f"{name} was {_text(before.get(name))} and is {_text(now.get(name))}" for name in names[:MOST_NAMED]]
    more = f", and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(said) + more


def _text(value: Any) -> str:
    if isinstance(value, dict):
        return "; ".join(f"{key}={_text(inner)}" for key, inner in value.items()) or "nothing"
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def differences(found: Iterable[str]) -> str:
    """All that differs as one text; "" for nothing."""
    return "; ".join(text for text in found if text)
