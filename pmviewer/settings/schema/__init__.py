"""The single schema of everything a user can change.

Sliders, tooltips, `--set`, session files, EXR metadata and the table in the documentation are all made from this tree
(`pmviewer.settings.access` reads it). A setting's `stage` is the earliest stage of the pipeline that reads it: changing
the setting recomputes that stage and what follows, nothing before it (see `docs/architecture.md`).
"""

from __future__ import annotations

from pydantic import Field

from pmviewer.settings.schema.base import Auto, Group, Scale, Stage, Vec3, setting
from pmviewer.settings.schema.camera import CameraSettings
from pmviewer.settings.schema.compare import Compare
from pmviewer.settings.schema.direct import Direct
from pmviewer.settings.schema.display import Display
from pmviewer.settings.schema.edit import Edit
from pmviewer.settings.schema.estimate import Estimate
from pmviewer.settings.schema.free_camera import FreeCamera
from pmviewer.settings.schema.gather import Gather
from pmviewer.settings.schema.importance import Importance
from pmviewer.settings.schema.light import Light
from pmviewer.settings.schema.light_pass import Photons
from pmviewer.settings.schema.overlays import (
    CacheOverlay,
    CellOverlay,
    Colour,
    FateOverlay,
    FocusOverlay,
    GatherOverlay,
    ImportonOverlay,
    LightOverlay,
    Overlays,
    PathOverlay,
    PointOverlay,
    ProjectionOverlay,
    ShadowOverlay,
)
from pmviewer.settings.schema.region import Region
from pmviewer.settings.schema.render import Render
from pmviewer.settings.schema.virtual import Virtual

__all__ = [
    "Auto",
    "CacheOverlay",
    "CameraSettings",
    "CellOverlay",
    "Colour",
    "Compare",
    "Direct",
    "Display",
    "Edit",
    "Estimate",
    "FateOverlay",
    "FocusOverlay",
    "FreeCamera",
    "Gather",
    "GatherOverlay",
    "Group",
    "Importance",
    "ImportonOverlay",
    "Light",
    "LightOverlay",
    "Overlays",
    "PathOverlay",
    "Photons",
    "PointOverlay",
    "ProjectionOverlay",
    "Region",
    "Render",
    "Scale",
    "Settings",
    "ShadowOverlay",
    "Stage",
    "Vec3",
    "Virtual",
    "setting",
]


class Settings(Group):
    """All settings of a session."""

    light: Light = Field(default_factory=Light)
    edit: Edit = Field(default_factory=Edit)
    photons: Photons = Field(default_factory=Photons)
    importance: Importance = Field(default_factory=Importance)
    estimate: Estimate = Field(default_factory=Estimate)
    direct: Direct = Field(default_factory=Direct)
    gather: Gather = Field(default_factory=Gather)
    virtual: Virtual = Field(default_factory=Virtual)
    render: Render = Field(default_factory=Render)
    region: Region = Field(default_factory=Region)
    camera: CameraSettings = Field(default_factory=CameraSettings)
    free_camera: FreeCamera = Field(default_factory=FreeCamera)
    compare: Compare = Field(default_factory=Compare)
    display: Display = Field(default_factory=Display)
    overlays: Overlays = Field(default_factory=Overlays)
