"""The single schema of everything a user can change.

Sliders, tooltips, `--set`, session files, EXR metadata and the table in the documentation are all made from this tree
(`pmviewer.settings` reads it). A setting's `stage` is the earliest stage of the pipeline that reads it: changing the
setting recomputes that stage and what follows, nothing before it (see `docs/architecture.md`).
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

Scale = Literal["linear", "log", "integer", "choice", "switch", "vector"]
Stage = Literal["photons", "maps", "image", "display", "stop"]
Auto = Literal["auto"]
Vec3 = tuple[float, float, float]


def setting(
    default: Any,
    description: str,
    *,
    stage: Stage,
    scale: Scale,
    title: str = "",
    unit: str = "",
    ge: float | None = None,
    le: float | None = None,
) -> Any:
    """A field of the schema. `ge` and `le` bound numbers, `unit` is shown behind the value."""
    extra: dict[str, Any] = {"stage": stage, "scale": scale, "unit": unit, "ge": ge, "le": le}
    return Field(default, description=description, title=title or None, json_schema_extra=extra)


class Group(BaseModel):
    """A frozen group of settings; unknown names are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="after")
    @classmethod
    def _in_bounds(cls, value: Any, field: ValidationInfo) -> Any:
        """Bounds live in the schema's extras, not in pydantic's own constraints, which "auto" would not pass."""
        extra: Any = cls.model_fields[field.field_name or ""].json_schema_extra
        if extra and isinstance(value, int | float) and not isinstance(value, bool):
            if (extra["ge"] is not None and value < extra["ge"]) or (extra["le"] is not None and value > extra["le"]):
                raise ValueError("out of bounds")
        return value


class Photons(Group):
    """Light pass"""

    N: int = setting(
        150_000,
        "Photon trajectories emitted in each pass.",
        stage="photons",
        scale="log",
        unit="photons",
        ge=100,
        le=50_000_000,
    )
    q: float = setting(
        1.0,
        "Share of the trajectories that fill the global map; the caustic map gets all of them (Keller and Wald §2.4).",
        stage="photons",
        scale="log",
        ge=0.001,
        le=1.0,
    )
    q_rule: Literal["trajectories", "photons"] = setting(
        "trajectories",
        "How q thins the global map: only the first q·N trajectories fill it, or every trajectory's photon is stored "
        "with probability q and power divided by q.",
        stage="photons",
        scale="choice",
        title="q rule",
    )
    indirect_caustics: bool = setting(
        True,
        "Photons last scattered by a specular surface go to the caustic map even after a diffuse bounce "
        "(Keller and Wald §2.3). Off: they belong to the global map alone.",
        stage="photons",
        scale="switch",
    )
    sequence: Literal["sobol", "independent"] = setting(
        "sobol",
        "Random numbers of the photons: Owen-scrambled Sobol points, or independent ones.",
        stage="photons",
        scale="choice",
    )
    max_bounces: int = setting(
        64,
        "Scatterings after which a photon is dropped; Russian roulette ends nearly all of them earlier.",
        stage="photons",
        scale="integer",
        ge=1,
        le=1000,
    )


class Estimate(Group):
    """Density estimate"""

    radius: float | Auto = setting(
        "auto",
        "Look-up radius of the first pass, relative to the scene's bounding-sphere radius. Automatic: a few pixel "
        "footprints at the typical distance of what the camera sees.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-5,
        le=1.0,
    )
    caustic_radius: float = setting(
        0.5,
        "Radius of caustic look-ups relative to that of global ones: caustics are sharper and their map is denser.",
        stage="maps",
        scale="log",
        unit="× radius",
        ge=0.05,
        le=2.0,
    )
    alpha: float = setting(
        2.0 / 3.0,
        "How fast the radius shrinks from pass to pass, r²ᵢ₊₁ = r²ᵢ·(i+α)/(i+1). 1 keeps it (and its bias).",
        stage="maps",
        scale="linear",
        ge=0.0,
        le=1.0,
    )
    floor: float = setting(
        1e-5,
        "No pass uses a smaller radius than this, relative to the scene's bounding-sphere radius.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-7,
        le=0.1,
    )
    lookup: Literal["radius", "nearest"] = setting(
        "radius",
        "Photons within the radius of the pass, or the k nearest ones (up to the maximum radius).",
        stage="maps",
        scale="choice",
    )
    k: int = setting(50, "Photons in a k-nearest estimate.", stage="maps", scale="log", unit="photons", ge=2, le=1000)
    rim: Literal["left out", "half", "whole"] = setting(
        "left out",
        "How the k-th photon, which sets the radius, counts: leaving it out is exact for independently scattered "
        "photons, half suits stratified ones, whole is too bright.",
        stage="image",
        scale="choice",
    )
    max_radius: float | Auto = setting(
        "auto",
        "Largest radius of a k-nearest search, relative to the scene. Automatic: where k of the brightest photons "
        "would still be darker than the black level (course guide §5.2).",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-5,
        le=2.0,
    )
    black_level: float = setting(
        0.05,
        "Radiance below which the automatic maximum radius may lose detail.",
        stage="maps",
        scale="log",
        unit="W/(m² sr)",
        ge=1e-6,
        le=10.0,
    )
    filter: Literal["constant", "cone", "gaussian", "simpson", "epanechnikov"] = setting(
        "constant", "Kernel that weighs photons by their distance.", stage="image", scale="choice"
    )
    cone_k: float = setting(
        1.1, "Slope of the cone filter: its weight is 1 − d/(k·r).", stage="image", scale="linear", ge=1.0, le=10.0
    )
    flatness: float = setting(
        0.2,
        "Half-thickness of the search disc relative to the radius: photons further off the tangent plane are another "
        "surface's. 1 searches a sphere.",
        stage="image",
        scale="linear",
        unit="× radius",
        ge=0.01,
        le=1.0,
    )


class Direct(Group):
    """Direct light"""

    samples: int = setting(
        1, "Light samples per pixel and pass.", stage="image", scale="integer", unit="samples", ge=1, le=64
    )
    mis: bool = setting(
        True,
        "Combine light sampling with BSDF sampling by multiple importance sampling (power heuristic). Off: light "
        "sampling alone.",
        stage="image",
        scale="switch",
        title="MIS",
    )
    choice: Literal["auto", "power", "photons", "Keller-Wald"] = setting(
        "auto",
        "How light samples are spread over the lights. power: by the lights' power. photons: mostly by the photons "
        "that arrived from each light near the point. Keller-Wald: some samples for the lights with photons near, some "
        "for all others (§3). auto: photons with many lights, power otherwise.",
        stage="image",
        scale="choice",
    )
    choice_radius: float | Auto = setting(
        "auto",
        "Radius within which photons tell the lights of a point, relative to the scene. Automatic: some dozens of "
        "photons. Too small a radius misses lights and leaves single bright pixels.",
        stage="maps",
        scale="log",
        unit="× scene",
        ge=1e-4,
        le=1.0,
    )
    con_samples: int = setting(
        2,
        "Samples of the lights with photons near the point.",
        stage="image",
        scale="integer",
        unit="samples",
        ge=1,
        le=64,
        title="contributing samples",
    )
    noncon_samples: int = setting(
        1,
        "Samples of all other lights.",
        stage="image",
        scale="integer",
        unit="samples",
        ge=1,
        le=64,
        title="other samples",
    )
    biased: bool = setting(
        False,
        "Leave lights without photons near the point out: less noise, a little too dark.",
        stage="image",
        scale="switch",
        title="only contributing lights",
    )


class Gather(Group):
    """Final gather"""

    rays: int = setting(
        4, "Final-gather rays per pixel and pass.", stage="image", scale="integer", unit="rays", ge=1, le=256
    )
    radiance_photons: Literal["off", "all", "1/4", "1/8"] = setting(
        "off",
        "Share of the global photons that become radiance photons: gather rays take the irradiance of the nearest one, "
        "computed when first needed, instead of a look-up each (Pharr §0.3). Pays with many gather rays or k nearest.",
        stage="photons",
        scale="choice",
    )
    cutoff: float | Auto = setting(
        "auto",
        "Farthest radiance photon that a gather ray uses, relative to the look-up radius (with k nearest, to its "
        "median); farther off the ray looks the map up itself. Automatic: 0.5, which is free of bias, or 1 with k "
        "nearest.",
        stage="maps",
        scale="linear",
        unit="× radius",
        ge=0.05,
        le=2.0,
        title="cut-off",
    )
    similarity: float = setting(
        0.9,
        "Least cosine between the normals of a radiance photon and of the surface that a gather ray hit.",
        stage="image",
        scale="linear",
        title="normal similarity",
        ge=0.01,
        le=1.0,
    )


class Render(Group):
    """Method"""

    method: Literal["progressive", "gather", "path", "global map", "caustic map"] = setting(
        "progressive",
        "progressive: direct light by sampling, both maps shown directly with a shrinking radius. gather: indirect "
        "light by a final gather into the global map. path: path tracing, the yardstick without photons. "
        "global/caustic map: that map alone, as it is.",
        stage="image",
        scale="choice",
    )
    max_depth: int = setting(
        32,
        "Longest chain of mirrors and glass followed from the camera, and longest path of the path tracer.",
        stage="image",
        scale="integer",
        ge=1,
        le=1000,
    )
    seed: int = setting(1, "Seed of every random stream.", stage="photons", scale="integer", ge=0, le=2**31 - 1)
    passes: int = setting(
        1024, "Refinement stops after this many passes.", stage="stop", scale="log", unit="passes", ge=1, le=1_000_000
    )
    time_limit: float = setting(
        0.0, "Refinement stops after this time; 0 is no limit.", stage="stop", scale="linear", unit="s", ge=0, le=1e6
    )


class CameraSettings(Group):
    """Camera"""

    origin: Vec3 | Auto = setting("auto", "Eye point; auto is the scene file's.", stage="image", scale="vector")
    target: Vec3 | Auto = setting("auto", "Point in the image's centre.", stage="image", scale="vector")
    up: Vec3 | Auto = setting("auto", "Direction that is upright in the image.", stage="image", scale="vector")
    fov: float | Auto = setting(
        "auto", "Horizontal field of view.", stage="image", scale="linear", unit="°", ge=1.0, le=170.0, title="FOV"
    )
    width: int | Auto = setting(
        "auto", "Image width; auto is the scene file's.", stage="image", scale="integer", unit="px", ge=1, le=16384
    )
    height: int | Auto = setting("auto", "Image height.", stage="image", scale="integer", unit="px", ge=1, le=16384)


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
    ] = setting(
        "beauty",
        "What the viewport shows: the image, one of its terms, a property of the first hit, the shaded geometry, the "
        "loaded reference, or the error against it.",
        stage="display",
        scale="choice",
    )
    exposure: float = setting(
        0.0, "Exposure before the tone curve.", stage="display", scale="linear", unit="EV", ge=-20, le=20
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
        "Colour by power (radiance photons: irradiance), by number of bounces or by light.",
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


class Overlays(Group):
    """Overlays"""

    caustic: PointOverlay = Field(default_factory=PointOverlay, title="caustic photons")
    global_: PointOverlay = Field(default_factory=PointOverlay, alias="global", title="global photons")
    radiance: PointOverlay = Field(default_factory=PointOverlay, title="radiance photons")

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, populate_by_name=True)

    def by_map(self) -> dict[str, PointOverlay]:
        """Map's name in a frame's clouds → how it is drawn."""
        return {"caustic": self.caustic, "global": self.global_, "radiance": self.radiance}


class Settings(Group):
    """All settings of a session."""

    photons: Photons = Field(default_factory=Photons)
    estimate: Estimate = Field(default_factory=Estimate)
    direct: Direct = Field(default_factory=Direct)
    gather: Gather = Field(default_factory=Gather)
    render: Render = Field(default_factory=Render)
    camera: CameraSettings = Field(default_factory=CameraSettings)
    display: Display = Field(default_factory=Display)
    overlays: Overlays = Field(default_factory=Overlays)
