"""What statistics and the log say of the latest pass beyond what is counted: small enough to come from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pmviewer.engine.diagnose import Looked
from pmviewer.engine.tally import Tally
from pmviewer.maps.importance.importance_map import NO_IMPORTANCE


@dataclass(frozen=True)
class Told:
    """`held`: how many photons of each kind a pass holds beside the photon maps (radiance, shadow, cache, virtual,
    importons); `importons` traced for its importance maps; `sentences` for the log."""

    held: Mapping[str, int] = field(default_factory=dict)
    importons: int = 0
    sentences: tuple[str, ...] = ()


def told_of(looked: Looked, tally: Tally) -> Told:
    """Of the latest pass that was rendered here; nothing before the first."""
    importance, maps, held = looked.importance.latest, looked.light.latest, dict[str, int]()
    if looked.latest is not None:
        made = looked.latest
        if made.maps.radiance is not None:
            held["radiance"] = len(made.maps.radiance.known())
        if made.shadows is not None:
            held["shadow"] = len(made.shadows.photons)
        if made.cache is not None:
            held["cache"] = made.cache.n
        if made.virtual is not None:
            held["virtual"] = len(made.virtual.lights.photons)
    if importance is not None:
        held["importons"] = importance.n
    said = (*(importance.warnings if importance is not None else ()), *(maps.notes if maps is not None else ()))
    return Told(held, importance.traced if importance is not None else 0, (*said, *_unimportant(looked, tally)))


def _unimportant(looked: Looked, tally: Tally) -> tuple[str, ...]:
    """A sentence for each map whose photons arrive in unimportant places alone."""
    latest, plan = looked.importance.latest, looked.plan
    if latest is None or not latest.n or plan.deposition not in ("Keller-Wald", "density control"):
        return ()
    return tuple(
        f"{plan.deposition}: none of the {map_.arrived:,} photons that arrived for the {name} map in "
        "this pass is in an important place. Does light reach what the camera sees?"
        for name, map_ in tally.deposited.items()
        if map_.important == 0 and latest.record(name).dtype != NO_IMPORTANCE.dtype
    )
