"""What runs in scenes with participating media, and what does not yet know of them."""

from __future__ import annotations

from typing import Any, NamedTuple

from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings, with_values


class Lacking(NamedTuple):
    """A setting that does nothing in scenes with media: what it is set to instead, and the sentence about it. `lit`:
    only where they scatter or emit light."""

    name: str
    instead: Any
    sentence: str
    lit: bool = False


LACKING = (
    Lacking("importance.emission", "off", "Guided emission does not know of media: photons leave the lights by power."),
    Lacking(
        "gather.cache",
        "off",
        "The irradiance cache does not know of media that scatter or emit light: every surface point gathers itself.",
        lit=True,
    ),
    Lacking("gather.estimation", "off", "Estimated gathers do not know of media: every pixel gathers itself."),
    Lacking(
        "gather.secondary",
        0.0,
        "Secondary gathering does not know of media that scatter or emit light: gather rays look the map up.",
        lit=True,
    ),
    Lacking("direct.shadow_photons", False, "Shadow photons do not know of media: all shadow rays are cast."),
)
VIRTUAL = (
    "Virtual lights weighed by whole paths, or chosen by a tree, do not know of media: the method progressive shows "
    "the scene. virtual.estimator = single step and virtual.choice = even do."
)
THIN = "Light passes thin glass as through all glass: simplified panes do not know of media."
MAP_ALONE = "A map alone shows no light that media scatter: choose progressive, gather or path."
WHOLE = ("full path", "every vertex", "modified", "printed full path")
"""Estimators of virtual lights that follow whole paths."""
LOOKED_FOR = Lacking("direct.mis", True, "Direct light is looked for by rays, too: media that emit light need it.")
"""Where media emit: what is near to them is lit by what rays find."""
BLURRED_FROM = 0.99
BLURRED = "Photons keep their directions to 0.06°: light that media scatter nearly straight on is blurred by that."


def in_media(settings: Settings, traits: SceneTraits) -> tuple[Settings, tuple[str, ...]]:
    """The settings that a scene with media goes by, and sentences about those that are others than were asked for."""
    emit = traits.media_emit and settings.render.method != "path"
    changes: dict[str, Any] = {}
    said: list[str] = []
    for lacking in (*LACKING, *((LOOKED_FOR,) if emit else ())):
        if lacking.lit and not traits.lit_media:
            continue
        group, name = lacking.name.split(".")
        if getattr(getattr(settings, group), name) != lacking.instead:
            changes[lacking.name] = lacking.instead
            said.append(lacking.sentence)
    chosen = settings.virtual
    if settings.render.method == "virtual lights" and (chosen.estimator in WHOLE or chosen.choice != "even"):
        changes["render.method"] = "progressive"
        said.append(VIRTUAL)
    if settings.render.method in ("global map", "caustic map") and traits.has_scattering:
        said.append(MAP_ALONE)
    return (with_values(settings, changes) if changes else settings), tuple(said)
