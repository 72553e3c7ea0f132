"""Sentences for the log about what a picture does not show: light that was cut off, left out, or never found."""

from __future__ import annotations

from pmviewer.engine.energy import Energy
from pmviewer.engine.plan import Plan
from pmviewer.engine.tally import Tally
from pmviewer.photons.bounces import most_bounces
from pmviewer.settings.access import Settings

_ASKED = "(render.thin_glass, or the glass says so)"
THIN_GLASS = {
    "ignored": f"Light meets no thin glass {_ASKED}: behind it there is too much light by what it absorbs and "
    "reflects, without its colour, and what it would reflect is missing.",
    "tinted": f"Light goes straight through thin glass {_ASKED}: what panes reflect onto what is seen is missing, and "
    "glass of two faces doesn't displace or focus the light behind it.",
    "tinted and reflecting": f"Light goes straight through thin glass {_ASKED}: glass of two faces doesn't displace or "
    "focus the light behind it.",
}
"""By rule, what is wrong with the light behind such panes."""
CUT_PATHS = 1e-3
"""Share of the paths from the camera that may end at the depth allowed before a sentence says so."""
CUT_OFF = 0.01
"""Share of the light that may still be on its way after the last scattering before a sentence says so."""

SCARCE = 2e-4
"""Share of a pass's trajectories that bring photons of caustics, below which each is a bright spot of its own: 4 of
150,000 in a space ship under a lit dome of 30 times its size (file; relMSE after ten CPU s 2.1e-2, 3.7e-3 with guided
emission), 150 and more in all other scenes with caustics that were tried."""


def caveats(
    settings: Settings,
    plan: Plan,
    tally: Tally,
    energy: Energy | None,
    scene_radius: float,
    pixels: int,
    passes: int,
    paths: int,
) -> list[str]:
    """What to know about the passes so far. scene_radius: of the bounding sphere; pixels: of the picture; paths: of the
    camera in all passes."""
    said = [THIN_GLASS[rule] for rule in plan.thin_glass if rule in THIN_GLASS]
    if "tinted and reflecting" in plan.thin_glass and plan.gather and not settings.photons.indirect_caustics:
        said.append(
            "Gather rays go straight through thin glass: light that it reflects after a diffuse bounce is missing. "
            "Turn photons.indirect_caustics on, or choose the method progressive."
        )
    if settings.region.on and not plan.virtual and passes > 1:
        said.append("Outside of the region (region.on) the picture has one pass.")
    said += [_dropped(place, count) for place, count in tally.dropped.items() if count]
    cut = tally.cut / max(paths, 1)
    if cut > CUT_PATHS:
        said.append(
            f"{cut:.1%} of the paths from the camera end on their way at render.max_depth = "
            f"{settings.render.max_depth}: the light that they would have found is missing. Raise it."
        )
    if energy is None:
        return said
    if energy.share("terminated") > CUT_OFF:
        most = most_bounces(settings.photons, plan.media)
        said.append(
            f"{energy.share('terminated'):.0%} of the light is still on its way after {most} "
            "scatterings and left out, so the picture is too dark: raise photons.max_bounces, or lower what surfaces "
            "reflect below 1."
        )
    if tally.emitted and not tally.deposited and not any(tally.stored.values()):
        said.append(
            f"None of {tally.emitted:,} photons arrived on a surface that shows it: do the lights shine past it?"
        )
    said += _too_few(settings, plan, tally, scene_radius, pixels)
    said += _scarce(settings, plan, tally)
    return said


def _dropped(place: str, count: int) -> str:
    return (
        f"{count:,} {place} were not finite or negative and left out: the picture lacks their light. Is a colour, a "
        "power or a size of the scene extreme?"
    )


def _too_few(settings: Settings, plan: Plan, tally: Tally, scene_radius: float, pixels: int) -> list[str]:
    """Look-ups that find next to nothing: a pass of them sees no light rather than noisy light."""
    estimate = settings.estimate
    if plan.nearest:
        if plan.neighbours == 1 and estimate.rim == "left out":
            return ["A look-up of k = 1 photon that leaves out the outermost finds none: choose estimate.rim = whole."]
        return []
    radius, photons = tally.radius.get("global", 0.0), tally.stored_in_pass.get("global", 0)
    if not photons or not radius:
        return []
    # Photons on surfaces of about the bounding sphere's area, (r/2R)² of them in a disc.
    found = photons * (radius / (2 * scene_radius)) ** 2
    looks = pixels * (settings.gather.rays if plan.gather else 1)
    if found * looks >= 0.1:  # in a whole pass
        return []
    seldom = 1 / max(found, 1e-300)
    return [
        f"A look-up radius of {radius / scene_radius:.1e} of the scene finds one photon in some {seldom:.0e} look-ups: "
        "indirect light is missing rather than noisy. Widen estimate.radius or raise photons.N."
    ]


def _scarce(settings: Settings, plan: Plan, tally: Tally) -> list[str]:
    """Caustics of so few photons that a picture shows them one by one; guided emission would send more."""
    photons, N = tally.stored_in_pass.get("caustic", 0), settings.photons.N
    if not plan.caustic_mask or plan.emission != "off" or not 0 < photons < SCARCE * N:
        return []
    return [
        f"Only {photons:,} of {N:,} photons of a pass arrive over mirrors or glass, and each is a bright spot in the "
        "picture: guide them there (importance.emission = Christensen keep, importance.map = average)."
    ]
