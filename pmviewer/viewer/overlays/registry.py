"""Every overlay, in the order of the panel and the menu."""

from __future__ import annotations

from pmviewer.viewer.overlays.fates import Fates
from pmviewer.viewer.overlays.file_photons import FilePhotons
from pmviewer.viewer.overlays.focal_plane import FocalPlane
from pmviewer.viewer.overlays.frustum import Frustum
from pmviewer.viewer.overlays.gather_rays import GatherRays
from pmviewer.viewer.overlays.importons import Importons
from pmviewer.viewer.overlays.inspected import Inspected
from pmviewer.viewer.overlays.irradiance_cache import IrradianceCache
from pmviewer.viewer.overlays.light_importance import Lights
from pmviewer.viewer.overlays.map_cells import Cells
from pmviewer.viewer.overlays.overlay import Overlay
from pmviewer.viewer.overlays.photon_maps import CausticPhotons, GlobalPhotons, VolumePhotons
from pmviewer.viewer.overlays.photon_paths import Paths
from pmviewer.viewer.overlays.projection_maps import ProjectionMaps
from pmviewer.viewer.overlays.radiance_photons import RadiancePhotons
from pmviewer.viewer.overlays.shadow_photons import ShadowPhotons
from pmviewer.viewer.overlays.virtual_lights import VirtualLights

OVERLAYS: tuple[type[Overlay], ...] = (
    CausticPhotons,
    GlobalPhotons,
    VolumePhotons,
    RadiancePhotons,
    IrradianceCache,
    ShadowPhotons,
    VirtualLights,
    Importons,
    Fates,
    Lights,
    Paths,
    GatherRays,
    ProjectionMaps,
    Cells,
    FilePhotons,
    FocalPlane,
    Frustum,
    Inspected,
)
SWITCHED = tuple(overlay for overlay in OVERLAYS if overlay.switch is not None)
"""Those with a row in the panel, settings in `overlays` and an action that switches them."""
