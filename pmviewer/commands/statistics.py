"""What rendering has counted, as text."""

from __future__ import annotations

import math

from pmviewer.engine.energy import ENTRIES
from pmviewer.engine.frame import Statistics


def pass_report(s: Statistics) -> str:
    """What a rendering has to say of its last pass besides the picture: empty for one that stores all photons."""
    lines = []
    if s.cache_records:
        lines.append(
            f"irradiance cache: {s.cache_records:,} records in the last pass, "
            f"{s.gathers_per_pixel:.3f} gathers a pixel and pass, {s.interpolated:.1%} interpolated"
        )
    if s.estimates:
        lines.append(_estimation(s))
    if s.importons:
        lines.append(f"importance: {s.importons:,} importons, stored at {s.stored_in_pass['importons']:,} places")
    for name, map_ in s.deposited.items():
        if map_.arrived:
            lost = map_.discarded_power / map_.arrived_power if map_.arrived_power > 0 else 0.0
            biased = f"; biased: {lost:.2%} of the power discarded" if lost > 0 else ""
            saved = f"{map_.saved_bytes / 2**20:.1f} MiB saved"
            stored = f"{map_.stored:,} of {map_.arrived:,} photons stored in the last pass"
            lines.append(f"{name} map: {stored}, {saved}{biased}")
    caustic = s.deposited.get("caustic")
    if caustic is not None and caustic.converged is not None:
        found = caustic.converged
        lines.append(
            f"caustic map: {1 - found.more:.1%} of its light converged, {found.dense:.1%} dense enough, "
            f"{found.spared:,} trajectories spared in the last pass"
            if found.photons
            else "caustic map: no photons, so nothing has converged"
        )
    return "\n".join(lines)


def remaining_report(s: Statistics) -> str:
    """The estimate of the picture's error, "" without one."""
    if s.remaining is None:
        return ""
    found = s.remaining
    bias = "bias not measured" if found.bias is None else f"bias {found.bias:.1e} of it"
    return f"relMSE about {found.relmse:.2g}, in nine of ten pictures {found.low:.2g} to {found.high:.2g}; {bias}"


def _estimation(s: Statistics) -> str:
    """What became of the pixels with estimated gathers."""
    pixels, safe = sum(s.estimates[name] for name in ("safe", "critical", "other")), max(s.estimates["safe"], 1)
    gathered, interpolated, left = (s.estimates[name] / safe for name in ("gathered", "interpolated", "left"))
    partly = ""
    if "partial" in s.estimates:
        gathered, shot = s.estimates["full"] / safe, s.estimates["shot"] / safe
        partly = f"{s.estimates['partial'] / safe:.2%} partly reprojected ({shot:.2g} rays a safe pixel for both), "
    return (
        f"gather estimation: {s.estimates['safe'] / max(pixels, 1):.1%} of the pixels safe; of these {gathered:.2%} "
        f"fully gathered, {partly}{interpolated:.1%} interpolated, {left:.1%} gathered as usual, mean of all passes"
    )


def statistics_report(s: Statistics) -> str:
    """Text of `pmviewer render --stats`."""
    rows = [("passes", f"{s.passes:,}"), ("rays", f"{s.rays:,}"), ("rendering time", f"{s.seconds:.2f} s")]
    rows += [(f"CPU time, {stage}", f"{seconds:.2f} s") for stage, seconds in s.stage_seconds.items()]
    for address, (threads, passes) in s.workers.items():
        rows.append((f"passes of {address}", f"{passes:,} on {threads} thread{'s' if threads > 1 else ''}"))
    if s.emitted:
        rows.append(("photons emitted", f"{s.emitted:,}"))
        rows += [(f"photons in the {name} map", f"{count:,}") for name, count in s.stored.items()]
        rows.append(("memory of the maps", f"{s.map_bytes / 2**20:.1f} MiB"))
    rows += [(f"{place} dropped, not finite", f"{count:,}") for place, count in s.dropped.items()]
    if s.energy is not None:
        rows.append(("energy emitted a pass", f"{s.energy.watts[0]:.6g} W"))
        for entry in ENTRIES[1:]:
            share, error = s.energy.share(entry), s.energy.share_error(entry)
            known = "" if math.isnan(error) else f" ± {error:.2%}"
            rows.append((f"energy {entry}", f"{share:.3%}{known}"))
        if s.energy.uncounted > 0:
            rows.append(("energy of test photons, not in the ledger", f"{s.energy.uncounted:.6g} W"))
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:{width}s}  {text}" for label, text in rows)
