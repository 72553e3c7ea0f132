"""Settings of overlays: what is drawn over the picture."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import ConfigDict

from pmviewer.settings.needs import BOTH_MAPS, IMPORTANCE, LENS, SHADOW_PHOTONS, VOLUME, Need, never
from pmviewer.settings.schema.base import Group, setting, subgroup
from pmviewer.settings.schema.virtual import VIRTUAL_LIGHTS

TRACED = Need(lambda f: f.plan.photons, "This method traces no photons.")
CAUSTIC_PHOTONS = Need(
    lambda f: f.plan.caustic_classes,
    "No caustic photons: the scene has no mirror or glass, or the method does not use them.",
)
RADIANCE_SHOWN = Need(lambda f: f.plan.radiance, "Only the method 'gather' has radiance photons, where they are on.")
CACHE_SHOWN = Need(lambda f: f.plan.cache, "Only the method 'gather' has an irradiance cache, where it is on.")
IMPORTANCE_OF_EACH_MAP = Need(
    lambda f: f.plan.caustic_classes and f.plan.global_classes and f.plan.gather,
    "One importance serves both maps: they are shown at the same places.",
)
JUDGED = Need(lambda f: f.plan.judges, "Every photon is stored (importance.deposition).")
GATHER_RAYS = Need(lambda f: f.plan.gather, "Only the method 'gather' casts gather rays.")
PLAIN_EMISSION = Need(
    lambda f: f.plan.emission == "off", "Guided emission takes no projection maps (importance.emission)."
)
PROJECTED = Need(
    lambda f: f.settings.photons.projection != "off",
    "Photons leave the lights in all directions (photons.projection).",
)
CAUSTIC_TRAJECTORIES = Need(
    lambda f: f.settings.photons.q != 1.0 and f.settings.photons.q_rule != "photons",
    "All trajectories fill the global map, and leave for any surface (photons.q).",
)

SEVERAL_MAPS = Need(
    lambda f: sum(map(bool, (f.plan.caustic_classes, f.plan.global_classes, f.plan.volume))) > 1, "There is one map."
)
TREE = Need(
    lambda f: f.plan.nearest,
    "The map is a grid, whose cells are all of one size: only nearest look-ups have a kd-tree (estimate.lookup).",
)

Colour = Literal["power", "bounce", "light"]


class PointOverlay(Group):
    """A photon map drawn as points"""

    show: bool = setting(False, "Draw the photons of this map.", stage="display", scale="switch")
    size: float = setting(2.0, "Point size.", stage="display", scale="linear", unit="px", ge=1, le=12)
    colour: Colour = setting(
        "power",
        "Colour by power, by number of bounces or by light.",
        stage="display",
        scale="choice",
    )
    depth: bool = setting(True, "Hide points behind surfaces.", stage="display", scale="switch", title="depth test")
    limit: int = setting(
        100_000,
        "At most this many points are drawn, evenly thinned.",
        stage="display",
        scale="log",
        unit="points",
        ge=1_000,
        le=5_000_000,
    )


class PhotonOverlay(PointOverlay):
    """The photons of a map drawn as points"""

    colour: Literal["power", "bounce", "light", "wavelength", "direction"] = setting(  # type: ignore[assignment]
        "power",
        "Colour by power, by number of bounces, by light, by wavelength where glass splits light into colours, or by "
        "the direction that the photon came from: x, y and z of it as red, green and blue.",
        stage="display",
        scale="choice",
    )


class VirtualOverlay(PointOverlay):
    """Virtual lights drawn as points"""

    colour: Literal["power", "bounce", "light", "object"] = setting(  # type: ignore[assignment]
        "power",
        "Colour by power, by number of bounces, by the light that it came from, or by the object that it lies on.",
        stage="display",
        scale="choice",
    )


def coloured_by_irradiance(what: str) -> Any:
    """The colour of points that are light of many photons."""
    return setting(
        "irradiance",
        "Colour by irradiance.",
        stage="display",
        scale="choice",
        needs=(never(f"{what} are coloured by irradiance: light of many photons, lights and bounces."),),
    )


class RadianceOverlay(PointOverlay):
    """Radiance photons drawn as points"""

    colour: Literal["irradiance"] = coloured_by_irradiance("Radiance photons")  # type: ignore[assignment]


class CacheOverlay(PointOverlay):
    """Records of the irradiance cache drawn as points"""

    colour: Literal["irradiance"] = coloured_by_irradiance("Records")  # type: ignore[assignment]
    circles: bool = setting(
        False,
        "Circles as wide as records reach, for at most 2,000 of them, evenly thinned.",
        stage="display",
        scale="switch",
        title="reach",
    )


class ShadowOverlay(PointOverlay):
    """Shadow photons drawn as points"""

    colour: Literal["lit or shadow", "light"] = setting(  # type: ignore[assignment]
        "lit or shadow",
        "Colour by what the photon tells, or by light.",
        stage="display",
        scale="choice",
    )
    lit: bool = setting(
        True, "Draw those that the light reaches, too.", stage="display", scale="switch", title="lit ones"
    )


class ImportonOverlay(PointOverlay):
    """Importons drawn as points"""

    colour: Literal["importance", "screen", "footprint", "average", "map"] = setting(  # type: ignore[assignment]
        "importance",
        "Colour by the importance of the place, as it is used or by either estimate or their average, or by the map "
        "that it is for: caustic or global.",
        stage="display",
        scale="choice",
    )
    map: Literal["both", "caustic", "global"] = setting(
        "both",
        "Importons of which importance map are drawn.",
        stage="display",
        scale="choice",
        needs=(IMPORTANCE_OF_EACH_MAP,),
    )


class FateOverlay(PointOverlay):
    """What becomes of photons, drawn as points"""

    show: bool = setting(
        False,
        "Draw where photons of the latest pass arrived and what the deposition rule made of them.",
        stage="display",
        scale="switch",
    )
    colour: Literal["fate", "bounce"] = setting(  # type: ignore[assignment]
        "fate",
        "Colour by what became of the photon, or by number of bounces.",
        stage="display",
        scale="choice",
    )
    map: Literal["both", "caustic", "global"] = setting(
        "both",
        "Photons of which map are drawn.",
        stage="display",
        scale="choice",
        needs=(BOTH_MAPS,),
    )
    only: Literal["all", "stored", "not stored"] = setting(
        "all", "Draw all photons, or some.", stage="display", scale="choice"
    )
    count: int = setting(
        100_000,
        "Trajectories of the pass whose photons are judged again, the first ones: density control finds an empty map "
        "with them.",
        stage="display",
        scale="log",
        unit="trajectories",
        ge=100,
        le=5_000_000,
    )


class LightOverlay(PointOverlay):
    """Lights as points, by their importance"""

    show: bool = setting(
        False, "Mark the lights by how much of the picture each one lights.", stage="display", scale="switch"
    )
    size: float = setting(12.0, "Point size.", stage="display", scale="linear", unit="px", ge=1, le=40)
    colour: Literal["picture", "emission"] = setting(  # type: ignore[assignment]
        "picture",
        "Colour by the share of the picture's light that comes from the light, or by how many times as many photons "
        "leave it as by its power (guided emission).",
        stage="display",
        scale="choice",
    )
    depth: bool = setting(False, "Hide points behind surfaces.", stage="display", scale="switch", title="depth test")
    labels: int = setting(
        5,
        "Lights that are labelled with their share, the most important ones.",
        stage="display",
        scale="integer",
        ge=0,
        le=50,
    )


class PathOverlay(Group):
    """Photon paths drawn as lines"""

    show: bool = setting(
        False, "Draw the paths of the first photons of the latest pass.", stage="display", scale="switch"
    )
    size: float = setting(1.5, "Line width.", stage="display", scale="linear", title="width", unit="px", ge=1, le=8)
    colour: Colour = setting(
        "bounce",
        "Colour by power, by number of bounces so far or by light.",
        stage="display",
        scale="choice",
    )
    depth: bool = setting(False, "Hide lines behind surfaces.", stage="display", scale="switch", title="depth test")
    count: int = setting(
        50, "Photons whose paths are drawn.", stage="display", scale="log", unit="paths", ge=1, le=5_000
    )
    first: int = setting(
        1,
        "Leave out what comes before this flight of a photon: 1 is the one from the light.",
        stage="display",
        scale="integer",
        title="first flight",
        ge=1,
        le=16,
    )
    length: int = setting(
        8, "Flights of a photon that are drawn.", stage="display", scale="integer", title="flights", ge=1, le=63
    )


class GatherOverlay(Group):
    """Gather rays of one pixel"""

    show: bool = setting(
        False,
        "Draw the gather rays of a pixel in the latest pass: hold I to take the pixel under the mouse.",
        stage="display",
        scale="switch",
    )
    size: float = setting(1.5, "Line width.", stage="display", scale="linear", title="width", unit="px", ge=1, le=8)
    colour: Literal["contribution", "source"] = setting(
        "contribution",
        "Colour by the radiance that a ray adds to the pixel, or by what chose its direction: the BSDF or photons.",
        stage="display",
        scale="choice",
    )
    depth: bool = setting(False, "Hide rays behind surfaces.", stage="display", scale="switch", title="depth test")


class ProjectionOverlay(Group):
    """Projection maps of the lights"""

    show: bool = setting(
        False,
        "Draw where and in which directions photons leave the lights: the cells of their projection maps that are on.",
        stage="display",
        scale="switch",
    )
    map: Literal["surfaces", "caustic"] = setting(
        "surfaces",
        "Cells in which photons can meet any surface, or what makes caustics.",
        stage="display",
        scale="choice",
        needs=(CAUSTIC_TRAJECTORIES,),
    )
    size: float = setting(
        0.15,
        "Radius of the shells of directions around lights. Cells of places are drawn where they are.",
        stage="display",
        scale="log",
        unit="× scene",
        ge=0.01,
        le=2.0,
    )
    opacity: float = setting(0.4, "Opacity of the cells.", stage="display", scale="linear", ge=0.05, le=1.0)
    depth: bool = setting(True, "Hide cells behind surfaces.", stage="display", scale="switch", title="depth test")


class CellOverlay(Group):
    """Cells of a photon map"""

    show: bool = setting(
        False,
        "Draw how a photon map of the latest pass divides space: the nodes of its kd-tree, or the cells of its grid "
        "that hold photons.",
        stage="display",
        scale="switch",
    )
    map: Literal["global", "caustic", "volume"] = setting(
        "global",
        "Cells of which map are drawn.",
        stage="display",
        scale="choice",
        needs=(SEVERAL_MAPS,),
    )
    colour: Literal["photons", "level"] = setting(
        "photons",
        "Colour by the photons in a cell, or by its level in the tree.",
        stage="display",
        scale="choice",
        needs=(TREE,),
    )
    levels: int = setting(
        6,
        "The deepest level of the tree that is drawn, from the root, 0, to the leaves.",
        stage="display",
        scale="integer",
        ge=0,
        le=24,
        needs=(TREE,),
    )
    limit: int = setting(
        2_000,
        "At most this many boxes are drawn: of a tree whole levels, of a grid cells put together, 2³, 4³ … a box.",
        stage="display",
        scale="log",
        unit="boxes",
        ge=100,
        le=50_000,
    )
    size: float = setting(1.0, "Line width.", stage="display", scale="linear", title="width", unit="px", ge=1, le=8)
    depth: bool = setting(True, "Hide edges behind surfaces.", stage="display", scale="switch", title="depth test")


class FocusOverlay(Group):
    """Focal plane of the lens"""

    show: bool = setting(
        False,
        "Draw the plane that the lens shows sharp: what lies behind it is tinted. Ctrl+click in the picture moves it.",
        stage="display",
        scale="switch",
    )
    opacity: float = setting(0.35, "Opacity of the plane.", stage="display", scale="linear", ge=0.05, le=1.0)
    depth: bool = setting(True, "Hide it behind surfaces.", stage="display", scale="switch", title="depth test")


class Overlays(Group):
    """Overlays"""

    caustic: PhotonOverlay = subgroup(PhotonOverlay, "caustic photons", TRACED, CAUSTIC_PHOTONS)
    global_: PhotonOverlay = subgroup(PhotonOverlay, "global photons", TRACED, alias="global")
    radiance: RadianceOverlay = subgroup(RadianceOverlay, "radiance photons", TRACED, RADIANCE_SHOWN)
    cache: CacheOverlay = subgroup(CacheOverlay, "irradiance cache", TRACED, CACHE_SHOWN)
    volume: PhotonOverlay = subgroup(PhotonOverlay, "volume photons", VOLUME)
    shadow: ShadowOverlay = subgroup(ShadowOverlay, "shadow photons", SHADOW_PHOTONS)
    virtual: VirtualOverlay = subgroup(VirtualOverlay, "virtual lights", VIRTUAL_LIGHTS)
    importons: ImportonOverlay = subgroup(ImportonOverlay, "importons", TRACED, IMPORTANCE)
    fates: FateOverlay = subgroup(FateOverlay, "photons by fate", TRACED, JUDGED)
    lights: LightOverlay = subgroup(LightOverlay, "light importance", TRACED, IMPORTANCE)
    paths: PathOverlay = subgroup(PathOverlay, "photon paths", TRACED)
    gather: GatherOverlay = subgroup(GatherOverlay, "gather rays", TRACED, GATHER_RAYS)
    projection: ProjectionOverlay = subgroup(ProjectionOverlay, "projection maps", TRACED, PLAIN_EMISSION, PROJECTED)
    cells: CellOverlay = subgroup(CellOverlay, "cells of a map", TRACED)
    file: PointOverlay = subgroup(PointOverlay, "photons of a file")
    focal: FocusOverlay = subgroup(FocusOverlay, "focal plane", LENS)

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)

    def styles(self) -> dict[str, Group]:
        """How each overlay is drawn, by its name in the settings' paths."""
        fields = type(self).model_fields
        return {field.alias or name: getattr(self, name) for name, field in fields.items()}
