"""Ways of rendering that automatic mode chooses among, as far as a scene's traits leave the choice open."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pmviewer.engine.method import MANY_LIGHTS, REFLECTING, thin_rules
from pmviewer.scene.analysis import SceneTraits
from pmviewer.settings.access import Settings, with_values

GUIDED_FROM = 100.0
"""CPU seconds from which guided emission is worth its trial: its first passes are the dearest."""

RECORDS, EDGES = 1.1, 1.25
"""What errors of ways with records, and without second gathers, count as (`Candidate.overlooked`). Records alone were
chosen in a quarter of a living room's trials, promised as little as with second gathers and 1 % too bright: 1.4 to 4
times the error."""
SHOWN = 1.25
"""What errors of photons that are shown directly count as beside those of a gather: of 23 scenes and files, ten seconds
each, none had less by them, and where trials promised less than twice as much, 1.0 to 2.9 times as much was true. Not
where an error is asked for: `ring_caustic` is at 5e-3 by them in 0.8 of the time."""


@dataclass(frozen=True)
class Candidate:
    """`values` by full name, beside the defaults of what automatic mode sets; `said` explains them."""

    name: str
    values: Mapping[str, Any]
    said: tuple[str, ...] = ()

    def is_like(self, other: Candidate) -> bool:
        """Whether it is the same way, by whatever values."""
        return self.name == other.name

    @property
    def gathers(self) -> bool:
        """Whether indirect light is gathered."""
        return self.values.get("render.method") == "gather"

    @property
    def shows(self) -> bool:
        """Whether indirect light is photons that are shown directly."""
        return "render.method" not in self.values

    @property
    def by_nearest(self) -> bool:
        """Whether look-ups reach to the nearest photons, however far these are."""
        return self.values.get("estimate.lookup") == "nearest"

    @property
    def overlooked(self) -> float:
        """What an error that a trial promises of its gather rays counts as, for bias that the trial may overlook: of
        records, and of look-ups near edges and behind thin walls."""
        records = RECORDS if "gather.cache" in self.values else 1.0
        return records * (1.0 if "gather.secondary" in self.values else EDGES)

    def having(self, values: Mapping[str, Any], *said: str) -> Candidate:
        """The same way with other values, and why."""
        return replace(self, values={**self.values, **values}, said=(*self.said, *said))


CHANNEL_ROULETTE = {"photons.roulette": "channel maximum"}
"""Photons keep their largest channel, not their luminance: of those that saturated colours reflect there are more, and
none outgrows the others. relMSE after 3 CPU s over that by luminance, mean of three seeds: progressive 0.72 in
cornell_glossy, 0.78 in colonnade, 0.86 in cornell_caustic, 0.87 in cornell_diffuse, 0.91 in museum, 0.99 in
rooms_10x10; gather with the cache 0.95 to 1.02."""
PROGRESSIVE = Candidate("progressive", CHANNEL_ROULETTE)
GATHER = Candidate("gather", {"render.method": "gather", **CHANNEL_ROULETTE})
LIGHTS_CAUSTICS = {"photons.indirect_caustics": False}
"""The caustic map holds light straight from lights over mirrors and glass (Jensen's LS⁺D). What diffuse surfaces send
there is broad and dim: as caustics it has their small radius, and few bright photons. relMSE after 2.5 CPU s over that
with all of it in the caustic map, progressive: 0.79 in cornell_caustic, 0.94 in museum, 1.0 in cornell_glossy and
glass_egg; gather with the cache: 0.45, 0.64, 0.53, 0.87, office 0.81. Within media a gather does worse: 1.4 in
marble."""
THICKER = {"estimate.flatness": 0.3}
"""Beside a gather, whose rays average what they meet: photons of the next facet make up for what a disc has beyond the
edge. relMSE after 8 passes over that of thin discs: 0.75 in cornell_fractal, 0.99 to 1.00 in museum, corner_room and
colonnade. Shown directly, they blur what is finer than the radius."""
CORNERS = {"gather.secondary": 2.0}
"""Gather rays that end within two radii gather again, so that no disc takes light from around a corner. relMSE in the
same time over that without: a model of bricks 0.7, plain gather (its picture 0.8 % too dark instead of 1.9 %), a
staircase and a hall behind a door 0.98 to 1.02; after as many passes, which cost 3 % more, cornell_fractal 0.93,
colonnade 0.96, corner_room and museum 0.99. Up to five radii none was better, and `cornell_diffuse` took 5 % longer.
Without them the irradiance cache was chosen for a model of bricks, promised 6e-5 and had 2e-4. What the cache lacks by
comparison is known to the trial as the bias of interpolation."""
FARTHER_NAME, FARTHER = "gather with second gathers farther out", {"gather.secondary": 20.0}
LESS_BIAS, MORE_COST = 0.5, 1.08
"""The same up to twenty radii, and what that leaves of the squared bias of look-ups and costs in that model of bricks
(4.0e-5 to 2.1e-5; 42 passes to 39 in the same time; relMSE 0.8 times). No trial of its own: worth it where a trial has
measured such bias. In eleven random scenes 0.68 to 1.26 times the relMSE, 0.97 in the mean."""
WIDE_RECORDS = {"gather.cache_min": 12.0, "gather.cache_max": 48.0}
"""Records that reach three times as far as those that stay next to the plain gather: fewer of them, and less noise in
the same time in all bundled scenes tried, from 2 to 64 passes and from 64² to 256² pixels; from four times on, bias
shows."""
CACHE = Candidate("gather with irradiance cache", {**GATHER.values, "gather.cache": "on", **WIDE_RECORDS})
CACHE_CORNERS = Candidate("gather with irradiance cache and second gathers", {**CACHE.values, **CORNERS})
"""Without THICKER: no look-up is near an edge. In a living room under a sky records with thick discs were wrong by
0.018 (squared, relative), with second gathers by 0.0038, and 0.0011 with usual discs."""
PATH = Candidate("path", {"render.method": "path"})
NEAREST = {"estimate.lookup": "nearest"}
"""Where photons aim at what is small on a stage they are a hundred times as dense there, and no radius suits both that
and the rest, which rays meet, too. relMSE after 8 CPU s over that with one radius, four random stages: gather 6e-4,
3e-3, 0.05 and 1.0, progressive 0.01, 0.06, 0.15 and 1.1; a teapot on a wide floor 1.0 and 0.9, a space ship under a
dome 2.4 and 1.5 (files)."""
ONE_RADIUS_NAME, ONE_RADIUS = "progressive, one radius", {"estimate.lookup": "radius"}
WHY_NEAREST = (
    "photons lie close at what is small and far apart elsewhere: look-ups reach to the nearest (estimate.lookup)"
)
GUIDED = {"importance.map": "average", "importance.emission": "Christensen keep", **CHANNEL_ROULETTE}


def candidates(
    traits: SceneTraits, settings: Settings, seconds: float, apart: bool = False, aims: bool = False
) -> tuple[list[Candidate], list[tuple[str, str]]]:
    """What is worth a trial in such a scene for so many CPU seconds, the default method first, and what isn't with the
    reason. `settings` tell what automatic mode does not set; `apart`: by passes that can be rendered apart; `aims`:
    photons aim at what is small on a stage."""
    left_out: list[tuple[str, str]] = []
    glossy = settings.photons.glossy
    caustics, why = _caustics(traits, settings)
    progressive = PROGRESSIVE.having(caustics, *why)
    if not traits.stores(glossy):
        left_out.append(("gather", "no surface stores photons"))
        return [progressive, *_paths(traits, left_out)], left_out
    gather, cache = GATHER.having(THICKER), CACHE_CORNERS
    if not traits.lit_media:
        gather = gather.having(CORNERS)
        gather, cache = (way.having(caustics, *why) for way in (gather, cache))
    found = [progressive, gather]
    if aims:
        one_radius = replace(progressive.having(ONE_RADIUS), name=ONE_RADIUS_NAME)
        progressive, gather, cache = (way.having(NEAREST, WHY_NEAREST) for way in (progressive, gather, cache))
        found = [progressive, one_radius, gather]
    if traits.lit_media:
        left_out.append(("irradiance cache", "it does not know of media that scatter or emit light"))
    elif not traits.has_diffuse:
        left_out.append(("irradiance cache", "no diffuse surface"))
    else:
        found.append(cache)
    if traits.n_lights < MANY_LIGHTS:
        left_out.append(("importance", f"fewer than {MANY_LIGHTS} lights: photons mostly reach what is seen"))
    elif apart:
        left_out.append(("importance", "what it knows comes from the passes before, which may be rendered elsewhere"))
    elif seconds < GUIDED_FROM or traits.has_media:
        left_out.append(("importance", f"its trial costs too much of less than {GUIDED_FROM:g} CPU s"))
    else:
        found.append(Candidate("progressive, guided emission", GUIDED))
    return [*found, *_paths(traits, left_out)], left_out


def _caustics(traits: SceneTraits, settings: Settings) -> tuple[Mapping[str, Any], tuple[str, ...]]:
    """What else is set for the sake of caustics, and why."""
    if not traits.follows(settings.photons.glossy):
        return {}, ()
    if REFLECTING in thin_rules(with_values(settings, dict(GATHER.values)), traits):
        return {}, ()  # gather rays go straight through: only the caustic map has what it reflects
    why = (
        "caustics: straight from lights (photons.indirect_caustics off); what diffuse surfaces send over mirrors and "
        "glass is looked up as indirect light"
    )
    return LIGHTS_CAUSTICS, (why,)


def _paths(traits: SceneTraits, left_out: list[tuple[str, str]]) -> list[Candidate]:
    """The path tracer, where two pictures of one sample tell what it would need."""
    if traits.has_specular or traits.has_delta or traits.has_rough_glass:
        left_out.append(("path", "mirrors or glass: its error sits in rare bright paths that a trial does not meet"))
        return []
    if not traits.has_findable_lights:
        left_out.append(("path", "all lights are points or directions"))
        return []
    return [PATH]
