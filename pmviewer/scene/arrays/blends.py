"""Blends of materials: their parts as rows of the table of materials, and what photons must know of all parts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

from pmviewer.errors import SceneError
from pmviewer.kernels import scene as K
from pmviewer.scene.arrays.material_lobes import (
    always_followed,
    glossy_roughness,
    has_diffuse_lobe,
    is_delta,
    transmits,
)
from pmviewer.scene.description import BLACK, RGB, Material

DEEPEST = 32
"""Blends may be parts of blends so many times: each time costs every hit another choice."""
ALWAYS, NEVER = 1e30, -1e30
_MOST_PARTS = 1000


def with_parts(materials: Sequence[Material]) -> list[Material]:
    """The materials, each in its place, and then the parts of blends that are not among them, each once.

    Raises SceneError when blends are parts of each other more than DEEPEST times.
    """
    found = list(materials)
    known = {id(m) for m in found}
    level = _parts_of(found)
    for _ in range(DEEPEST):
        for part in level:
            if id(part) not in known:
                known.add(id(part))
                found.append(part)
        level = _parts_of(level)
        if not level:
            return found
    names = ", ".join(f"'{m.name}'" for m in materials if m.kind == "blend")
    raise SceneError(
        f"Materials are blended more than {DEEPEST} times one inside the other ({names[:200]}).",
        hint="Blend fewer of them.",
    )


def _parts_of(materials: Iterable[Material]) -> list[Material]:
    """Parts of the blends among them, each object once."""
    return list({id(part): part for m in materials if m.kind == "blend" for part in m.parts}.values())


def leaves(material: Material) -> Iterator[Material]:
    """The materials that a blend is made of, none of them a blend; of another material itself."""
    return (m for m in with_parts([material]) if m.kind != "blend")


def fill_blend(row: list[float], material: Material, number_of: dict[int, int]) -> None:
    """A blend's own columns of its row; number_of: a material's row by its id.

    Roughness of a texture is taken to be anything: photons that nobody looks up do no harm.
    """
    first, second = material.parts
    row[K.M_PART_0], row[K.M_PART_1] = number_of[id(first)], number_of[id(second)]
    row[K.M_WEIGHT] = K.BY_SIDE if material.by_side else min(max(material.weight, 0.0), 1.0)
    row[K.M_SPECULAR : K.M_SPECULAR + 3] = _absorption(material)
    for stores, follows, back in (
        (K.M_STORES_FRONT, K.M_FOLLOWS_FRONT, False),
        (K.M_STORES_BACK, K.M_FOLLOWS_BACK, True),
    ):
        shown = material.parts[back] if material.by_side else material
        stored, followed = zip(*(_roughness(m, back) for m in leaves(shown)))
        row[stores], row[follows] = max(stored), min(followed)


def _absorption(material: Material) -> RGB:
    """Of the first part that absorbs: what is inside is inside for all parts."""
    return next((m.absorption for m in leaves(material) if transmits(m) and any(m.absorption)), BLACK)


def _roughness(material: Material, back: bool) -> tuple[float, float]:
    """Roughness up to which one side of a material has STORED lobes, and that above which it has FOLLOWED ones that are
    no deltas."""
    rough = glossy_roughness(material)
    stored = ALWAYS if has_diffuse_lobe(material) else max(rough, default=NEVER)
    followed = min(rough, default=ALWAYS)
    if "alpha" in material.textures and rough:
        stored, followed = ALWAYS, NEVER
    if always_followed(material) and not is_delta(material):
        followed = NEVER
    if back and transmits(material):
        return NEVER, followed
    if back and not material.two_sided:
        return NEVER, ALWAYS
    return stored, followed


def blend_text(material: Material) -> str:
    """A blend in words: shares and names of its parts."""
    if material.by_side:
        return f"{material.name}: {material.parts[0].name}, {material.parts[1].name} on the back"
    share = "a texture's share" if "weight" in material.textures else f"{min(max(material.weight, 0.0), 1.0):.0%}"
    first, second = material.parts
    return f"{material.name}: {share} of {second.name} over {first.name}"


def mean_colour(material: Material, colour_of: Callable[[Material], RGB]) -> RGB:
    """The colours of a material's parts in their shares; of many parts within each other the first of them."""
    colour, stack = [0.0, 0.0, 0.0], [(material, 1.0)]
    for _ in range(_MOST_PARTS):
        if not stack:
            break
        m, share = stack.pop()
        if m.kind == "blend":
            w = 0.5 if m.by_side else min(max(m.weight, 0.0), 1.0)
            stack += [(m.parts[0], share * (1 - w)), (m.parts[1], share * w)]
        else:
            colour = [a + share * b for a, b in zip(colour, colour_of(m))]
    return (colour[0], colour[1], colour[2])
