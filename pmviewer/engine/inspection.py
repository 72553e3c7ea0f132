"""What a frame holds only while it is shown: planes of diagnostic views, photon paths.

`pmviewer.engine.diagnose` makes it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pmviewer.engine.inspector.report import Pinned, PixelReport
from pmviewer.output.diagnostic_views import Family

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.maps.search.cells import MapCells
    from pmviewer.photons.emission.light_importance import LightImportance
    from pmviewer.photons.light_pass.paths import PhotonPaths


@dataclass(frozen=True)
class Wanted:
    """What the display asks for: a family of diagnostic planes (of which map, for look-ups, or of which `slice`: axis
    and place from 0 to 1), so many photon paths, the
    gather rays of a pixel (x, y), the fates of the photons of so many trajectories, the importance of the lights, the
    picture without its noise, what made a pixel, the `cells` of a map (its name, levels of a tree, most boxes), and the
    photons and other points of the latest pass, which a pass that
    was rendered here has anyway."""

    family: Family | None = None
    map: str = ""
    paths: int = 0
    pixel: tuple[int, int] | None = None
    fates: int = 0
    lights: bool = False
    denoised: bool = False
    pinned: Pinned | None = None
    points: bool = False
    slice: tuple[int, float] = (2, 0.5)
    cells: tuple[str, int, int] | None = None

    @property
    def of_pass(self) -> bool:
        """Whether photons or maps of the latest pass are needed."""
        return self != Wanted()

    def lacks(self, held: Wanted) -> bool:
        """Whether a frame that holds `held` lacks something of this."""
        if self.family is not None and (self.family, self.map) != (held.family, held.map):
            return True
        if self.family == "slice" and self.slice != held.slice:
            return True
        if self.pixel is not None and self.pixel != held.pixel:
            return True
        if self.fates > 0 and self.fates != held.fates:
            return True
        if self.lights and not held.lights:
            return True
        if (self.denoised and not held.denoised) or (self.points and not held.points):
            return True
        if self.pinned is not None and self.pinned != held.pinned:
            return True
        if self.cells is not None and self.cells != held.cells:
            return True
        return self.paths > 0 and self.paths != held.paths


@dataclass(frozen=True, eq=False)
class Inspection:
    """`planes` by view, (h, w, channels) float32, see `pmviewer.output.diagnostic_views`, the picture without its noise
    among them; `gathered`: the gather rays
    of the pixel, (n, 10) float32, see `pmviewer.render.gather.gather_points`; `fates`: photons (n, 6) float32, see
    `pmviewer.photons.deposition.fates`; `lights`: importance of the lights as photons tell it; `pixel`: what made the
    pixel that is pinned; `cells`: those of a photon map, None where it has no photon."""

    wanted: Wanted = Wanted()
    planes: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    paths: PhotonPaths | None = None
    gathered: NDArray[np.float32] | None = None
    fates: NDArray[np.float32] | None = None
    lights: LightImportance | None = None
    pixel: PixelReport | None = None
    cells: MapCells | None = None
