"""Ways of rendering that automatic mode chooses among, as far as a scene's traits leave the choice open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pmviewer.engine.method import MANY_LIGHTS
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import SETTINGS, Settings, get
from pmviewer.settings.presets import RESET

GUIDED_FROM = 100.0
"""CPU seconds from which guided emission is worth its trial: its first passes are the dearest."""


@dataclass(frozen=True)
class Candidate:
    """`values` by full name, beside the defaults of what automatic mode sets."""

    name: str
    values: Mapping[str, Any]


PROGRESSIVE = Candidate("progressive", {})
GATHER = Candidate("gather", {"render.method": "gather"})
WIDE_RECORDS = {"gather.cache_min": 12.0, "gather.cache_max": 48.0}
"""Records that reach three times as far as those that stay next to the plain gather: fewer of them, and less noise in
the same time in all bundled scenes tried, from 2 to 64 passes and from 64² to 256² pixels; from four times on, bias
shows."""
CACHE = Candidate("gather with irradiance cache", {"render.method": "gather", "gather.cache": "on", **WIDE_RECORDS})
PATH = Candidate("path", {"render.method": "path"})
GUIDED = {"importance.map": "average", "importance.emission": "Christensen keep"}


def assignments(values: Mapping[str, Any]) -> dict[str, Any]:
    """All that automatic mode sets, by full name: `values`, and the default of everything else that presets set."""
    return {path: info.default for path, info in SETTINGS.items() if path.startswith(RESET)} | dict(values)


def given(settings: Settings) -> list[str]:
    """Settings that automatic mode would set and that somebody has changed already, by full name."""
    return [path for path, info in SETTINGS.items() if path.startswith(RESET) and get(settings, path) != info.default]


def candidates(traits: SceneTraits, glossy: float, seconds: float) -> tuple[list[Candidate], list[tuple[str, str]]]:
    """What is worth a trial in such a scene for so many CPU seconds, the default first, and what isn't with the
    reason."""
    left_out: list[tuple[str, str]] = []
    if not traits.stores(glossy):
        left_out.append(("gather", "no surface stores photons"))
        return [PROGRESSIVE, *_paths(traits, left_out)], left_out
    found = [PROGRESSIVE, GATHER]
    if traits.has_media:
        left_out.append(("irradiance cache", "it does not know of media"))
    elif not traits.has_diffuse:
        left_out.append(("irradiance cache", "no diffuse surface"))
    else:
        found.append(CACHE)
    if traits.n_lights < MANY_LIGHTS:
        left_out.append(("importance", f"fewer than {MANY_LIGHTS} lights: photons reach what the camera sees"))
    elif seconds < GUIDED_FROM or traits.has_media:
        left_out.append(("importance", f"its trial costs too much of less than {GUIDED_FROM:g} CPU s"))
    else:
        found.append(Candidate("progressive, guided emission", GUIDED))
    return [*found, *_paths(traits, left_out)], left_out


def _paths(traits: SceneTraits, left_out: list[tuple[str, str]]) -> list[Candidate]:
    """The path tracer, where two pictures of one sample tell what it would need."""
    if traits.has_specular or traits.has_delta or traits.has_rough_glass:
        left_out.append(("path", "mirrors or glass: its error sits in rare bright paths that a trial does not meet"))
        return []
    if not traits.has_findable_lights:
        left_out.append(("path", "all lights are points or directions"))
        return []
    return [PATH]
