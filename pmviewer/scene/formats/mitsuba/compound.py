"""BSDFs made of others: both sides, masks, blends of two and mixtures of many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from pmviewer.scene.description import BLACK, Material
from pmviewer.scene.formats.mitsuba.document import Properties
from pmviewer.scene.formats.mitsuba.interface import share
from pmviewer.scene.formats.mitsuba.values import parse_float
from pmviewer.scene.texture import limited

_MAP_SLOTS = frozenset(("bump", "normal"))
_MOST_PARTS = 16
_DEEPEST = 5
"""Blends inside blends: each costs every hit another choice."""


def on_parts(material: Material, change: Callable[[Material], Material]) -> Material:
    """The material, or each part of a blend however deep, changed."""
    if material.kind != "blend":
        return change(material)
    return replace(material, parts=tuple(on_parts(part, change) for part in material.parts))


def leaves(material: Material) -> list[Material]:
    """The material itself, or the parts of a blend however deep."""
    if material.kind != "blend":
        return [material]
    return [leaf for part in material.parts for leaf in leaves(part)]


def _lets_through(material: Material) -> bool:
    return material.transparent or (material.principled is not None and material.principled.spec_trans > 0)


def two_sided(p: Properties, inner: Material, others: list[Material]) -> Material:
    """The BSDF on both sides of a surface, or one for the front and one for the back."""
    if len(others) > 1:
        p.document.warn(f"{p.element} has more than two BSDFs inside: the first two are used.", p.element)
    seen_through = any(_lets_through(leaf) for part in (inner, *others) for leaf in leaves(part))
    if seen_through and others:
        p.document.warn(f"{p.element}: with a transparent BSDF inside, the first counts for both sides.", p.element)
    elif seen_through:
        p.document.warn(f"{p.element} has no effect on a transparent BSDF.", p.element)
    p.known("allow_transmission")
    p.warn_unused("bsdf")

    def both(m: Material) -> Material:
        if _lets_through(m):
            return m
        return replace(m, two_sided=True, mirrored_maps=not _MAP_SLOTS.isdisjoint(m.textures))

    front = on_parts(inner, both)
    if not others or seen_through:
        return front
    parts = _not_too_deep(p, front), _not_too_deep(p, on_parts(others[0], both))
    opacity = {slot: texture for slot, texture in inner.textures.items() if slot == "opacity"}
    return Material(inner.name, "blend", BLACK, opacity=inner.opacity, textures=opacity, parts=parts, by_side=True)


def mask(p: Properties, inner: Material) -> Material:
    """Opacity of a number, a colour's mean luminance or a texture; that of the BSDF inside multiplies it."""
    opacity = share(p, "opacity", 0.5)
    texture = p.textures.get("opacity")
    p.warn_unused("bsdf", "texture")
    textures = dict(inner.textures)
    if texture is not None:
        if "opacity" in textures:
            p.document.warn(f"{p.element} around another one replaces it.", p.element)
        elif inner.opacity < 1:
            p.document.warn(f"{p.element}: its texture replaces the opacity of the BSDF inside.", p.element)
        textures["opacity"], texture_sentence = limited(texture, 1)
        if texture_sentence:
            p.document.warn(f"'opacity' of {p.element}: {texture_sentence}", p.element)
        return replace(inner, opacity=opacity, textures=textures)
    if "opacity" in textures:
        if opacity < 1:
            p.document.warn(f"{p.element} around a mask with a texture has no effect.", p.element)
        return inner
    return replace(inner, opacity=opacity * inner.opacity)


def blend(p: Properties, name: str, parts: list[Material]) -> Material:
    """`weight` of the second BSDF, the rest of the first."""
    weight = share(p, "weight", 0.5)
    texture = p.textures.get("weight")
    p.warn_unused("bsdf", "texture")
    parts = [_not_too_deep(p, part) for part in parts]
    if len(parts) > 2:
        p.document.warn(f"{p.element} has more than two BSDFs inside: the first two are used.", p.element)
    if len(parts) < 2:
        p.document.warn(f"{p.element} needs two BSDFs inside: {_instead(parts)}.", p.element)
        return replace(parts[0], name=name) if parts else Material(name, "diffuse")
    if texture is None:
        if weight in (0.0, 1.0):
            return replace(parts[int(weight)], name=name)
        return Material(name, "blend", BLACK, parts=(parts[0], parts[1]), weight=weight)
    texture, sentence = limited(texture, 1)
    if sentence:
        p.document.warn(f"'weight' of {p.element}: {sentence}", p.element)
    return Material(name, "blend", BLACK, parts=(parts[0], parts[1]), weight=weight, textures={"weight": texture})


def _not_too_deep(p: Properties, part: Material) -> Material:
    """The part, or where too many blends stand in it the heaviest of what they blend."""
    if _depth(part) < _DEEPEST:
        return part
    p.document.warn(f"{p.element}: of blends more than {_DEEPEST} deep the heaviest parts are used.", p.element)
    while part.kind == "blend":
        part = part.parts[int(part.weight >= 0.5 and not part.by_side)]
    return part


def _depth(material: Material) -> int:
    return 1 + max(_depth(part) for part in material.parts) if material.kind == "blend" else 0


def _instead(parts: list[Material]) -> str:
    return "the only one is used" if parts else "a grey diffuse surface stands in"


def mixture(p: Properties, name: str, parts: list[Material]) -> Material:
    """`mixturebsdf` of version 0.6: `weights` of any number of BSDFs, black in what is left to 1, as nested blends."""
    words = p.string("weights", "").replace(",", " ").replace(";", " ").split()
    p.warn_unused("bsdf")
    try:
        weights = [max(parse_float(w), 0.0) for w in words]
    except ValueError as error:
        raise p.document.error(f"'weights' of {p.element}: {error}.", p.element) from None
    if len(weights) != len(parts):
        what = f"{p.element} has {len(parts)} BSDFs and {len(weights)} weights: those without one are left out."
        p.document.warn(what, p.element)
    pairs = [(w, _not_too_deep(p, m)) for w, m in zip(weights, parts) if w > 0]
    if len(pairs) > _MOST_PARTS:
        p.document.warn(f"{p.element}: only the heaviest {_MOST_PARTS} of its BSDFs are used.", p.element)
        pairs = sorted(pairs, key=lambda pair: -pair[0])[:_MOST_PARTS]
    if not pairs:
        p.document.warn(f"{p.element} has no weight above 0: a grey diffuse surface stands in.", p.element)
        return Material(name, "diffuse")
    total = sum(w for w, _ in pairs)
    if total < 1 - 1e-6:
        pairs.append((1 - total, Material(f"{name} (black)", "diffuse", BLACK)))
    elif total > 1 + 1e-6:
        p.document.warn(f"The weights of {p.element} add up to more than 1: they were scaled to 1.", p.element)
    return replace(_tree(name, pairs), name=name)


def _tree(name: str, pairs: list[tuple[float, Material]]) -> Material:
    """Blends of halves of the list, so that few stand one inside the other."""
    if len(pairs) == 1:
        return pairs[0][1]
    half = len(pairs) // 2
    first, second = pairs[:half], pairs[half:]
    a, b = sum(w for w, _ in first), sum(w for w, _ in second)
    return Material(name, "blend", BLACK, parts=(_tree(name, first), _tree(name, second)), weight=b / (a + b))
