"""What runs in a pass of a method, in a scene, as `pmviewer.engine.method` finds it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from pmviewer.engine.look_up_plan import NEIGHBOURS
from pmviewer.maps.record import CAUSTIC
from pmviewer.render.direct.choice import ASKING
from pmviewer.settings.schema.importance import Deposit

Emission = Literal["off", "Peter-Pietrek", "Christensen discard", "Christensen keep"]


@dataclass(frozen=True)
class Plan:
    """The stages that run and how. Masks are bit sets of path classes (`1 << class`)."""

    path: bool = False
    """The path tracer alone."""
    virtual: bool = False
    """Virtual lights bring the indirect light."""

    direct: bool = False
    """Direct light is sampled at lobes that photons are stored for …"""
    followed_direct: bool = False
    """… and at those that are followed."""
    choice: str = "power"
    """How direct light chooses lights …"""
    light_samples: int = 1
    """… and how many samples of it a surface takes in a pass."""
    shadows: bool = False
    """Shadow photons save shadow rays."""
    looked_for: bool = False
    """Direct light is looked for by rays whatever `direct.mis` says."""
    unfound: bool = False
    """Followed lobes look up what no path finds (`pmviewer.render.reflect`)."""
    hides: bool = False
    """The picture shows no lights."""

    caustic_mask: int = 0
    """Classes of the caustic map that are shown."""
    global_mask: int = 0
    """Classes of the global map that are shown as indirect light, …"""
    direct_mask: int = 0
    """… as direct light, …"""
    global_caustics: int = 0
    """… and as caustics."""
    global_classes: int = 0
    """Classes that the global map has to hold, 0 where it is not built."""
    nearest: bool = False
    """Look-ups reach to the nearest photons, however far these are, …"""
    neighbours: int = NEIGHBOURS
    """… to so many in the first pass."""
    convergence: int = 0
    """Exponent of the caustic map's convergence criterion, 0 without."""
    maps: int = 1
    """Parts of the light pass that have photon maps of their own."""

    gather: bool = False
    """A final gather."""
    radiance: bool = False
    """Gather rays use radiance photons."""
    directions: Literal["BSDF", "photon cones", "hemisphere grid"] = "BSDF"
    """How gather rays look about: …"""
    guided_rays: int = 0
    """… so many of them are guided …"""
    guide_mask: int = 0
    """… by photons of these classes."""
    corners: bool = False
    """Short gather rays gather again."""
    cache: bool = False
    """Diffuse surfaces gather through an irradiance cache."""
    estimation: bool = False
    """Pixels that show them are interpolated between sparse gathers, …"""
    reprojection: bool = False
    """… which take hit points of one another."""

    importance: bool = False
    """There are importance maps."""
    deposition: Deposit = "all"
    """Which photons maps store."""
    emission: Emission = "off"
    """How importance guides emission."""

    media: bool = False
    """The scene has participating media."""
    volume: bool = False
    """Photons are stored in them, and the light that they scatter is looked up."""
    phase_rays: bool = False
    """Rays by phase functions can meet a light."""
    dispersion: bool = False
    """Glass splits light into colours."""
    thin_glass: tuple[str, ...] = ()
    """Rules by which light passes panes of glass, () where all of it is exact."""
    split: bool = False
    """Camera paths go both ways at glass."""

    lens: bool = False
    """The render camera has one."""
    filtered: bool = False
    """The film has another reconstruction filter than the plain box."""
    moments: bool = True
    """The film keeps what passes tell of its noise."""
    one_sample: bool = False
    """Something forbids more than one sample of a pixel in a pass."""
    mirror_rays: int = 1
    """Samples a pass of pixels that show a mirror or glass, …"""
    edge_rays: int = 1
    """… and of those that edges cross."""
    adaptive: bool = False
    """Noisy pixels get more samples (`pmviewer.render.adaptive`)."""

    skipped: tuple[tuple[str, str], ...] = ()
    """Stages that don't run, and why."""
    warnings: tuple[str, ...] = ()
    """Sentences for the log about what was asked for and can't be."""

    @property
    def caustic_classes(self) -> int:
        """Path classes that the caustic map holds."""
        return self.caustic_mask | (1 << CAUSTIC if self.unfound else 0)

    @property
    def shown_directly(self) -> int:
        """Path classes that are looked up in the global map where a pixel sees it."""
        return self.global_mask | self.direct_mask | self.global_caustics

    @property
    def photons(self) -> bool:
        """Whether any are traced."""
        return bool(self.caustic_classes or self.global_classes or self.volume)

    @property
    def asks_photons(self) -> bool:
        """Whether photons tell which lights to sample."""
        return self.choice in ASKING

    @property
    def judges(self) -> bool:
        """Whether a rule decides which photons are stored."""
        return self.deposition != "all" or self.emission not in ("off", "Peter-Pietrek")

    @property
    def banded(self) -> bool:
        """Whether stored photons tell their wavelengths: rules that write powers anew lose them."""
        return self.dispersion and not self.chooses_photons

    @property
    def chooses_photons(self) -> bool:
        """Whether there would be other photons without the group `importance` of the settings."""
        return self.deposition != "all" or self.emission != "off"

    @property
    def running(self) -> tuple[str, ...]:
        """Names of the stages that run."""
        stages = {
            "light pass": self.photons,
            "caustic map": self.caustic_classes,
            "global map": self.global_classes,
            "volume map": self.volume,
            "direct light": self.direct,
            "light choice by photons": self.asks_photons,
            "final gather": self.gather,
            "irradiance cache": self.cache,
            "gather estimation": self.estimation,
            "gather reprojection": self.reprojection,
            "importance": self.importance,
            "path tracer": self.path,
        }
        return tuple(name for name, runs in stages.items() if runs)
