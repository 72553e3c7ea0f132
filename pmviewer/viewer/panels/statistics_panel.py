"""Counts, sizes and times of the rendering, as a table."""

from __future__ import annotations

import math

from imgui_bundle import imgui

from pmviewer.engine.energy import ENTRIES, Energy
from pmviewer.engine.frame import Frame, Statistics
from pmviewer.engine.remaining import Remaining
from pmviewer.viewer import theme
from pmviewer.viewer.comparison import Point
from pmviewer.viewer.format import data_size, duration, grouped, si
from pmviewer.viewer.state import ViewerState

Rows = list[tuple[str, str]]

MOST_WORKERS = 12
"""That are listed."""
BESIDE = 36.0
"""Room in font sizes from which the parts stand beside each other, not below."""
LEDGER = {
    "absorbed": "Absorbed",
    "escaped": "Escaped from the scene",
    "terminated": "On its way after the last scattering",
    "dropped": "Dropped, not finite",
}


def photon_rows(s: Statistics) -> Rows:
    """What the light pass emitted and stored, and the memory of it."""
    rows = [("Emitted", grouped(s.emitted))]
    if s.bytes_per_photon:
        rows.append(("Memory of a photon", f"{s.bytes_per_photon:.1f} bytes"))
    rows.append(("Memory of the maps", data_size(s.map_bytes)))
    return rows + virtual_rows(s) + convergence_rows(s)


def virtual_rows(s: Statistics) -> Rows:
    """Virtual lights of the latest pass, and the light that clamping them lost; none with other methods."""
    if "virtual" not in s.stored_in_pass:
        return []
    rows = [("Virtual lights of a pass", grouped(s.stored_in_pass["virtual"]))]
    return rows + ([("Light lost by clamping", f"{s.clamped:.1%}")] if s.clamped else [])


def energy_rows(energy: Energy) -> Rows:
    """Where the light of a pass went, in watts of luminance and as shares with their standard errors."""
    rows = [("Emitted", si(energy.watts[0], "W"))]
    for entry in ENTRIES[1:]:
        share, error = 100 * energy.share(entry), 100 * energy.share_error(entry)
        text = f"{share:.2f} %" if math.isnan(error) or not share else f"{share:.2f} ± {error:.2g} %"
        rows.append((LEDGER[entry], text))
    if energy.uncounted > 0:
        rows.append(("With test photons, not in this ledger", si(energy.uncounted, "W")))
    return rows


def time_rows(s: Statistics) -> Rows:
    """Times, rays, and what the irradiance cache, estimated gathers and shadow photons spared."""
    rows = [
        ("Passes", grouped(s.passes)),
        ("Rendering time", duration(s.seconds)),
        ("CPU time", duration(s.cpu_seconds)),
        ("Rays", grouped(s.rays)),
        ("Rays per second", si(s.rays_per_second)),
        ("Shadow rays per pixel and pass", f"{s.shadow_rays_per_pixel:.2f}"),
    ]
    if s.cache_records:
        rows += [
            ("Records of the irradiance cache", grouped(s.cache_records)),
            ("Gathers per pixel and pass", f"{s.gathers_per_pixel:.3f}"),
            ("Interpolated", f"{s.interpolated:.1%}"),
        ]
    if s.estimates:
        safe, pixels = max(s.estimates["safe"], 1), sum(s.estimates[name] for name in ("safe", "critical", "other"))
        rows += [
            ("Safe pixels", f"{safe / max(pixels, 1):.1%}"),
            ("of them fully gathered", f"{s.estimates.get('full', s.estimates['gathered']) / safe:.1%}"),
            *([("partly reprojected", f"{s.estimates['partial'] / safe:.1%}")] if "partial" in s.estimates else []),
            ("interpolated", f"{s.estimates['interpolated'] / safe:.1%}"),
            ("gathered as usual", f"{s.estimates['left'] / safe:.1%}"),
        ]
    if s.saved_rays:
        share = s.saved_rays / (s.saved_rays + s.shadow_rays)
        rows.append(("Shadow rays saved by shadow photons", f"{100 * share:.0f} %"))
    if s.passes and s.seconds:
        rows.append(("Time of a pass", duration(s.seconds / s.passes)))
    return rows


def worker_rows(s: Statistics) -> Rows:
    """The workers of a cluster, with what each has rendered."""
    shown = list(s.workers.items())[:MOST_WORKERS]
    rows = [(f"{address}, {threads} thread{'s' if threads > 1 else ''}", grouped(n)) for address, (threads, n) in shown]
    more = len(s.workers) - len(shown)
    return rows + (
        [(f"{more} more", grouped(sum(n for _, n in s.workers.values()) - sum(n for _, (_, n) in shown)))]
        if more
        else []
    )


def convergence_rows(s: Statistics) -> Rows:
    """How much of the caustic map's light lies where no more photons are needed; none without the criterion."""
    deposited = s.deposited.get("caustic")
    if deposited is None or deposited.converged is None:
        return []
    found = deposited.converged
    return [
        ("Caustic map converged", f"{1 - found.more:.1%}" if found.photons else "no caustic photons"),
        ("Caustic map dense enough", f"{found.dense:.1%}"),
        ("Caustic trajectories spared", grouped(found.spared)),
    ]


def remaining_rows(found: Remaining) -> Rows:
    """The estimate of the picture's error, with the interval that holds in nine pictures of ten."""
    return [
        ("relMSE, about", f"{found.relmse:.2e}"),
        ("in nine of ten", f"{found.low:.1e} – {found.high:.1e}"),
        ("of it bias", "not measured" if found.bias is None else f"{found.bias:.1e}"),
    ]


def reference_rows(point: Point) -> Rows:
    """The errors of the pass that was last measured against the reference."""
    return [
        (f"relMSE, pass {grouped(point.passes)}", f"{point.metrics.relmse_all:.3e}"),
        ("Mean ratio", f"{point.metrics.mean_ratio:.4f}"),
    ]


class StatisticsPanel:
    """The tab "Statistics", of the frame that is shown."""

    def __init__(self, state: ViewerState) -> None:
        self._state = state

    def gui(self) -> None:
        """Draw the tab; called once a frame while it is in front."""
        frame = self._state.frame
        if frame is None:
            imgui.text_disabled("Nothing rendered yet.")
            return
        s = frame.statistics
        columns = 3 if imgui.get_content_region_avail().x > BESIDE * imgui.get_font_size() else 1
        flags = imgui.TableFlags_.sizing_stretch_same | imgui.TableFlags_.borders_inner_v
        if not imgui.begin_table("##columns", columns, flags):
            return
        imgui.table_next_column()
        table("Photons", photon_rows(s))
        _maps(frame)
        if s.energy is not None and imgui.tree_node("Energy of a pass"):
            table("", energy_rows(s.energy))
            imgui.tree_pop()
        imgui.table_next_column()
        table("Time", time_rows(s))
        if s.workers:
            table("Passes by workers of the cluster", worker_rows(s))
        imgui.table_next_column()
        self._stages(s, self._state.comparison.latest(frame))
        imgui.end_table()

    @staticmethod
    def _stages(s: Statistics, error: Point | None) -> None:
        total = sum(s.stage_seconds.values())
        share = {
            name: f"{duration(t)}  {t / total:4.0%}" if total else duration(t) for name, t in s.stage_seconds.items()
        }
        table("CPU time by stage", sorted(share.items(), key=lambda row: -s.stage_seconds[row[0]]))
        if s.remaining is not None:
            table("Estimated error", remaining_rows(s.remaining))
        if error is not None:
            table("Against the reference", reference_rows(error))
        for name, why in s.skipped:
            imgui.push_text_wrap_pos(0)
            imgui.text_disabled(theme.drawable(f"Skipped {name}: {why}"))
            imgui.pop_text_wrap_pos()
        bad = {place: count for place, count in s.dropped.items() if count}
        for place, count in bad.items():
            colour = imgui.ImVec4(*theme.WARNING)
            imgui.text_colored(colour, f"{grouped(count)} dropped in {place}: not finite or negative")
        if not bad:
            imgui.text_disabled("None was dropped.")


def look_up_radius(frame: Frame, name: str) -> str:
    """That of the pass by the name of a map, "" without one; look-ups of the nearest photons end before it."""
    radius = frame.statistics.radius.get(name, 0.0)
    nearest = frame.automatic.get("estimate.lookup") == "nearest" and name != "volume"
    return ("≤ " if nearest else "") + si(radius, "m") if radius else ""


def _maps(frame: Frame) -> None:
    """A row for each photon map."""
    s = frame.statistics
    if not s.stored or not imgui.begin_table("##maps", 4):
        return
    imgui.table_setup_column("map", imgui.TableColumnFlags_.width_stretch, 0.8)
    for name in ("stored", "last pass", "radius"):
        imgui.table_setup_column(name, imgui.TableColumnFlags_.width_stretch, 1.0)
    imgui.table_next_row()
    for name in ("map", "stored", "last pass", "radius"):
        imgui.table_next_column()
        _right(name, dim=True) if name != "map" else imgui.text_colored(imgui.ImVec4(*theme.DIM), name)
    for name, count in s.stored.items():
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted(name)
        radius = look_up_radius(frame, name) or "–"
        for text in (grouped(count), grouped(s.stored_in_pass.get(name, 0)), radius):
            imgui.table_next_column()
            _right(text)
        if "≤" in radius:
            imgui.set_item_tooltip("Look-ups end at the k-th photon, this far away at most (estimate.max_radius).")
        else:
            imgui.set_item_tooltip("Light near edges and on what is smaller is missing until the radius has shrunk.")
    imgui.end_table()


def _right(text: str, *, dim: bool = False) -> None:
    offset = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(offset, 0))
    imgui.text_colored(imgui.ImVec4(*(theme.DIM if dim else theme.TEXT)), text)


def table(title: str, rows: Rows) -> None:
    """Names on the left, right-aligned values, under a title if there is one."""
    if title:
        imgui.text_colored(imgui.ImVec4(*theme.DIM), title)
    if not imgui.begin_table(f"##{title}", 2):
        return
    imgui.table_setup_column("name", imgui.TableColumnFlags_.width_stretch)
    imgui.table_setup_column("value", imgui.TableColumnFlags_.width_fixed)
    for name, value in rows:
        imgui.table_next_row()
        imgui.table_next_column()
        imgui.text_unformatted(theme.drawable(name))
        imgui.table_next_column()
        _right(value)
    imgui.end_table()
