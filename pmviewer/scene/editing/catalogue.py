"""What of a scene can be edited, and by which names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from pmviewer.errors import SceneError
from pmviewer.scene.description import Environment, Light, Material, Scene

MOST_LISTED = 8
"""Names that a sentence lists."""


@dataclass(frozen=True)
class Target:
    """One thing that can be edited. `key` is how edits name it, "lamp" or "3"; `name` what the file calls it; `place`
    its index among the scene's shapes, lights, instances or materials, as `of` says."""

    kind: str
    key: str
    name: str
    of: str
    place: int


@dataclass(frozen=True)
class Catalogue:
    """Everything that can be edited, by kind, in the order of the file: lights on surfaces before all others, shapes
    before instances."""

    targets: dict[str, tuple[Target, ...]]

    def find(self, kind: str, what: str) -> Target:
        """The light, material or object of that key, name or number from 1. Raises SceneError, which lists some."""
        known = self.targets[kind]
        named = [target for target in known if what in (target.key, target.name)]
        if len(named) == 1:
            return named[0]
        if what.isdecimal() and 1 <= int(what) <= len(known):
            return known[int(what) - 1]
        if named:
            numbers = ", ".join(str(known.index(target) + 1) for target in named[:MOST_LISTED])
            raise SceneError(f"Several {kind}s are called '{what}'.", hint=f"Name one by its number: {numbers}.")
        raise SceneError(f"The scene has no {kind} '{what}' to edit.", hint=_hint(kind, known))


def catalogue_of(scene: Scene) -> Catalogue:
    """What of the scene can be edited."""
    glowing = [(s.name, "shape", i) for i, s in enumerate(scene.shapes) if s.shines]
    other = [(light.name, "light", i) for i, light in enumerate(scene.lights)]
    shapes = [(s.name, "shape", i) for i, s in enumerate(scene.shapes)]
    instances = [(instance.name, "instance", i) for i, instance in enumerate(scene.instances)]
    materials = [(m.name, "material", i) for i, m in enumerate(scene.materials)]
    kinds = {"light": glowing + other, "material": materials, "object": shapes + instances}
    return Catalogue({kind: _targets(kind, entries) for kind, entries in kinds.items()})


def refusal(scene: Scene, target: Target, prop: str) -> str | None:
    """Why that property of it can't be edited, None if it can."""
    if target.kind == "light" and target.of == "light":
        return _of_light(scene.lights[target.place], prop)
    if target.kind == "material":
        return _of_material(scene.materials[target.place], prop)
    return None


def _targets(kind: str, entries: Sequence[tuple[str, str, int]]) -> tuple[Target, ...]:
    counts = Counter(name for name, _, _ in entries)
    return tuple(
        Target(kind, name if name and counts[name] == 1 and not name.isdecimal() else str(number), name, of, place)
        for number, (name, of, place) in enumerate(entries, 1)
    )


def _hint(kind: str, known: Sequence[Target]) -> str:
    if not known:
        return f"It has no {kind}s at all."
    more = f" and {len(known) - MOST_LISTED} more" if len(known) > MOST_LISTED else ""
    return f"It has {', '.join(target.key for target in known[:MOST_LISTED])}{more}."


def _of_light(light: Light, prop: str) -> str | None:
    if prop == "move" and not hasattr(light, "position"):
        return "It shines from infinitely far away: it has no place."
    if prop == "turn" and (hasattr(light, "intensity") and not hasattr(light, "axis")):
        return "It shines alike in all directions."
    if prop == "turn" and isinstance(light, Environment) and not hasattr(light, "to_world"):
        return "It is the same from all sides."
    return None


_ROUGH = ("conductor", "dielectric", "plastic", "schlick", "ward", "principled")
_BENT = ("dielectric", "rough dielectric", "thin dielectric", "plastic", "rough plastic", "principled")


def _of_material(material: Material, prop: str) -> str | None:
    if material.kind == "blend":
        return "It is a blend of other materials."
    if material.kind == "null":
        return "It is the boundary of a medium, which nothing shows."
    if prop == "roughness" and "alpha" in material.textures:
        return "A texture gives its roughness."
    if prop == "roughness" and material.kind.removeprefix("rough ") not in _ROUGH:
        return "It has no gloss."
    if prop == "index" and material.kind not in _BENT:
        return "It has no index of refraction."
    if prop == "dispersion" and material.kind not in ("dielectric", "rough dielectric"):
        return "It is no glass that light is refracted in."
    return None
