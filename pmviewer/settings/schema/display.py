"""Settings of what the window draws: the view, and overlays on it."""

from __future__ import annotations

from typing import Literal

from pydantic import ConfigDict, Field

from pmviewer.settings.schema.base import Auto, Group, setting


class Display(Group):
    """Display"""

    view: Literal[
        "beauty",
        "emission",
        "direct",
        "specular",
        "caustic",
        "indirect",
        "albedo",
        "normal",
        "depth",
        "geometry",
        "reference",
        "error",
        "look-up radius",
        "photon count",
        "shadow rays skipped",
        "radiance photons",
        "radiance cells",
        "importance",
        "required density",
        "achieved density",
        "density ratio",
        "storing probability",
        "caustic convergence",
    ] = setting(
        "beauty",
        "What the viewport shows: the image, one of its terms, a property of the first hit, the shaded geometry, the "
        "loaded reference, the error against it, or, in false colours with a legend, how the latest pass made the "
        "picture.",
        stage="display",
        scale="choice",
    )
    map: Literal["global", "caustic"] = setting(
        "global",
        "The map whose look-ups the views 'look-up radius' and 'photon count' show, and whose photons or importance "
        "the views of importance, densities and the probability of storing. With the method 'gather', the "
        "global map is looked up where gather rays end, not at the first surface; shown is the look-up there.",
        stage="display",
        scale="choice",
        title="map of the view",
    )
    exposure: float | Auto = setting(
        "auto",
        "Exposure before the tone curve. Automatic: the scene's own, 0 for the bundled ones; for files that have none "
        "chosen by the first picture, so that surfaces look as bright as they are.",
        stage="display",
        scale="linear",
        unit="EV",
        ge=-20,
        le=20,
    )
    tone: Literal["sRGB", "Reinhard", "filmic", "linear"] = setting(
        "sRGB", "Tone curve from radiance to the screen.", stage="display", scale="choice", title="tone curve"
    )


Colour = Literal["power", "bounce", "light"]


class PointOverlay(Group):
    """A photon map drawn as points"""

    show: bool = setting(False, "Draw the photons of this map.", stage="display", scale="switch")
    size: float = setting(2.0, "Point size.", stage="display", scale="linear", unit="px", ge=1, le=12)
    colour: Colour = setting(
        "power",
        "Colour by power (radiance photons and cache: irradiance), by number of bounces or by light.",
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


class CacheOverlay(PointOverlay):
    """Records of the irradiance cache drawn as points"""

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
        "both", "Importons of which importance map are drawn.", stage="display", scale="choice"
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
        "both", "Photons of which map are drawn.", stage="display", scale="choice"
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


class Overlays(Group):
    """Overlays"""

    caustic: PointOverlay = Field(default_factory=PointOverlay, title="caustic photons")
    global_: PointOverlay = Field(default_factory=PointOverlay, alias="global", title="global photons")
    radiance: PointOverlay = Field(default_factory=PointOverlay, title="radiance photons")
    cache: CacheOverlay = Field(default_factory=CacheOverlay, title="irradiance cache")
    shadow: ShadowOverlay = Field(default_factory=ShadowOverlay, title="shadow photons")
    importons: ImportonOverlay = Field(default_factory=ImportonOverlay, title="importons")
    fates: FateOverlay = Field(default_factory=FateOverlay, title="photons by fate")
    lights: LightOverlay = Field(default_factory=LightOverlay, title="light importance")
    paths: PathOverlay = Field(default_factory=PathOverlay, title="photon paths")
    gather: GatherOverlay = Field(default_factory=GatherOverlay, title="gather rays")
    projection: ProjectionOverlay = Field(default_factory=ProjectionOverlay, title="projection maps")

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)

    def styles(self) -> dict[str, Group]:
        """How each overlay is drawn, by its name in the settings' paths."""
        fields = type(self).model_fields
        return {field.alias or name: getattr(self, name) for name, field in fields.items()}
