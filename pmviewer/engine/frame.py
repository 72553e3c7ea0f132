"""What a session publishes: frames with their statistics, its state, and its messages. All immutable."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.energy import Energy
from pmviewer.engine.inspection import Inspection
from pmviewer.engine.remaining import Remaining
from pmviewer.output.diagnostic_views import HELD_WHILE_SHOWN
from pmviewer.render.camera import CameraPose
from pmviewer.render.planes import MEDIA_CHANNELS, beauty_of, view_of
from pmviewer.settings.access import Settings

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.photons.deposition.deposited import Deposited
    from pmviewer.photons.emission.light_importance import LightImportance
    from pmviewer.photons.projection.light_map import ProjectionMap

State = Literal["empty", "loading", "preparing", "rendering", "paused", "finished", "failed"]
Level = Literal["info", "warning", "error"]


@dataclass(frozen=True)
class Statistics:
    """Counts since the last restart, unless a field says otherwise. Lengths in scene units."""

    passes: int = 0
    emitted: int = 0
    stored: Mapping[str, int] = field(default_factory=dict)
    """Photons stored, all passes together, by map ("caustic", "global")."""
    stored_in_pass: Mapping[str, int] = field(default_factory=dict)
    """By map; with "virtual" the virtual lights; with "radiance" the radiance photons that gather rays have used; with
    "shadow" the shadow photons,
    which serve all passes."""
    radius: Mapping[str, float] = field(default_factory=dict)
    """Look-up radius of the latest pass by map."""
    rays: int = 0
    shadow_rays: int = 0
    """Those of the rays that test whether a light is visible."""
    shadow_rays_per_pixel: float = 0.0
    """In one pass, on average."""
    cache_records: int = 0
    """Records of the irradiance cache in the latest pass; 0 without a cache."""
    gathers_per_pixel: float = 0.0
    """In one pass, on average, with an irradiance cache or estimated gathers: records or full gathers made, and pixels
    that gathered themselves."""
    interpolated: float = 0.0
    """Share of the surface points seen that the irradiance cache or an estimate served."""
    estimates: Mapping[str, int] = field(default_factory=dict)
    """Pixels of all passes by what the estimation of gathers made of them: safe, critical, other; of the safe ones
    gathered (sparse: on the undivided grid), interpolated, left; with reprojection, what was gathered is full or
    partial, and directions shot for both. Empty without."""
    saved_rays: int = 0
    """Shadow rays that were not cast, because shadow photons knew."""
    seconds: float = 0.0
    """Rendering time without pauses."""
    cpu_seconds: float = 0.0
    stage_seconds: Mapping[str, float] = field(default_factory=dict)
    """CPU time by stage, summed over threads."""
    map_bytes: int = 0
    bytes_per_photon: float = 0.0
    dropped: Mapping[str, int] = field(default_factory=dict)
    """Samples left out because they were not finite or negative, by place; all zero in a healthy scene."""
    energy: Energy | None = None
    """Where the light went; None without photons."""
    deposited: Mapping[str, Deposited] = field(default_factory=dict)
    """What became of the photons that arrived in the latest pass, by map; empty where all are stored."""
    clamped: float = 0.0
    """Share of the light from virtual lights that clamping took, 0 without."""
    remaining: Remaining | None = None
    """Estimate of the picture's error; None before the second pass and where passes don't tell it."""
    importons: int = 0
    """Importons traced for the importance maps of the latest pass, 0 without; `stored_in_pass` tells how many are
    stored."""
    workers: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    """Threads and passes of the workers of a cluster, by address; empty for passes that were rendered here."""
    warnings: tuple[str, ...] = ()
    """Sentences for the log about what can't work with this scene and camera."""
    skipped: tuple[tuple[str, str], ...] = ()
    """Stages that did not run and why."""

    @property
    def rays_per_second(self) -> float:
        """By wall clock; 0 before anything was rendered."""
        return self.rays / self.seconds if self.seconds > 0 else 0.0


@dataclass(frozen=True)
class PhotonCloud:
    """One map's photons of the latest pass, as `pmviewer.maps.record` describes them: (n, 6) float32.

    Radiance photons and records of the irradiance cache have their normal as direction and irradiance as power;
    `power_unit` is then in W per unit area.
    """

    photons: NDArray[np.float32]
    power_unit: float
    reach: NDArray[np.float32] | None = None
    """Of records: (n,) distances up to which they are used, in scene units."""
    banded: bool = False
    """Do photons tell their wavelengths (`pmviewer.maps.record.bands`)?"""
    objects: NDArray[np.int64] | None = None
    """Of virtual lights: (n,) the objects that they lie on, as places in `object_names`."""
    object_names: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Preview:
    """What is shown in place of a young picture: radiance (h, w, 3) float32 in the picture's full size, and a
    `caption` that says how it was made."""

    image: NDArray[np.float32]
    caption: str


@dataclass(frozen=True)
class Frame:
    """One published picture. `planes` is (height, width, 22) float32, with media 28: see `pmviewer.render.planes`."""

    serial: int
    """Grows by one with each frame of a session."""
    version: int
    """Version of the settings it was made with."""
    coarse: bool
    """True for the quick first picture of a new state: few pixels, few photons."""
    planes: NDArray[np.float32]
    settings: Settings
    camera: CameraPose
    statistics: Statistics
    clouds: Mapping[str, PhotonCloud] = field(default_factory=dict)
    scene_name: str = ""
    inspection: Inspection = field(default_factory=Inspection)
    """What it holds only while it is shown."""
    projections: Mapping[str, tuple[ProjectionMap, ...]] = field(default_factory=dict)
    """Projection maps of the lights by what they show, "surfaces" and "caustic"; empty where photons start everywhere.
    """
    exposure: float = 0.0
    """EV that it is shown with where the setting is automatic."""
    lights: LightImportance | None = None
    """Importance of the lights in the latest pass, with guided emission."""
    automatic: Mapping[str, Any] = field(default_factory=dict)
    """What automatic settings came to, by full name (`pmviewer.engine.automatic`)."""
    light_places: NDArray[np.float64] | None = None
    """(n, 3) middles of the lights, NaN where they shine from outside; None without importance."""
    unshared: NDArray[np.float32] | None = None
    """Like the planes, with terms of each pixel's own samples where a filter shares them."""
    preview: Preview | None = None
    """What the window shows in place of the beauty, which it is not; None where it shows that."""

    @property
    def has_media(self) -> bool:
        """Whether it has the terms of media."""
        return self.planes.shape[-1] >= MEDIA_CHANNELS

    @property
    def independent(self) -> NDArray[np.float32]:
        """Planes in which the noise of neighbouring pixels differs, as denoisers want it."""
        return self.planes if self.unshared is None else self.unshared

    @property
    def known_lights(self) -> LightImportance | None:
        """Importance of the lights: by guided emission, or by photons while the overlay is shown."""
        return self.lights if self.lights is not None else self.inspection.lights

    def image(self, view: str = "beauty") -> NDArray[np.float32]:
        """(height, width, 3), or 1 channel for depth; view is `beauty`, a term or a first-hit property, or one of
        `diagnostics`."""
        if view in HELD_WHILE_SHOWN:
            return self.inspection.planes[view]
        return self.beauty if view == "beauty" else view_of(self.planes, view)

    @property
    def diagnostics(self) -> Mapping[str, NDArray[np.float32]]:
        """Planes of the views that are there only while they are shown (`pmviewer.output.diagnostic_views`)."""
        return self.inspection.planes

    @cached_property
    def beauty(self) -> NDArray[np.float32]:
        """The image (height, width, 3), the sum of the terms."""
        return beauty_of(self.planes)


@dataclass(frozen=True)
class Status:
    """What the session is doing now. `progress` is 0–1 of the current activity, None when unknown. In a pass that
    takes long, `stage` is what it is at and `stage_progress` how much of that is through, None when unknown."""

    state: State = "empty"
    text: str = ""
    passes: int = 0
    progress: float | None = None
    stage: str = ""
    stage_progress: float | None = None


@dataclass(frozen=True)
class Message:
    """A line for the log."""

    level: Level
    text: str
    when: float = field(default_factory=time.time)
