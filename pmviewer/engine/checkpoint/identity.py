"""What a rendering is of: hashes of the scene by its parts, settings, and the program; and in words what differs.

The scene is what kernels read, whatever the file is called and whenever it was changed. The program is its version and
the sources that decide about a picture (`pmviewer.engine.program`). Libraries and the processor decide about the last
bits of compiled code: other ones are no reason to refuse, and said.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.opened import OpenScene
from pmviewer.engine.program import DECISIVE, PROCESSOR
from pmviewer.kernels.accel.instance import G_BLOCKS, G_NODES, G_QUADRICS
from pmviewer.render.camera import CameraPose
from pmviewer.settings.access import SETTINGS, Settings, flat

PARTS = {
    "materials": ("materials", "prim_material", "bsdf_tables", "glasses", "spectrum"),
    "textures": ("textures", "texel_starts", "texels"),
    "lights": (
        *("lights", "light_cdf", "light_places", "light_triangles", "light_triangle_cdf", "prim_light", "light_power"),
        *("light_textures", "light_frames", "light_tables", "sky_texels", "sky_rows", "sky_cells"),
        *("sky_guide", "sky_facings"),
        *("projectors", "projector_numbers"),
    ),
    "media": (
        *("media", "prim_media", "light_media", "glows", "glow_cdf"),
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
    others = [name for name in now if name not in DECISIVE and before.get(name) != now[name]]
    said = [f"{name} {_shown(name, before.get(name, 'unknown'))}, now {_shown(name, now[name])}" for name in others]
    return "; ".join(said)


def _shown(name: str, value: str) -> str:
    return value.split(" ")[0] if name == PROCESSOR else value  # without all that it can do


def other_scene(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Which parts differ, in words."""
    parts = [part for part in now if before.get(part) != now[part]]
    others = [part for part in parts if part != "camera"]
    said = [f"other {_listed(others)}"] if others else []
    said += ["another camera"] if "camera" in parts else []
    return f"the scene has {_listed(said)}" if said else ""


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


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
