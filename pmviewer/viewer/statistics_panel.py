"""Counts, sizes and times of the rendering, as a table."""

from __future__ import annotations

from imgui_bundle import imgui

from pmviewer.engine.frame import Statistics
from pmviewer.viewer import theme
from pmviewer.viewer.format import data_size, duration, grouped, si
from pmviewer.viewer.state import ViewerState

Rows = list[tuple[str, str]]


def photon_rows(s: Statistics) -> Rows:
    rows = [("Photons emitted", grouped(s.emitted))]
    rows += [(f"Stored, {name} map", grouped(count)) for name, count in s.stored.items()]
    rows += [(f"Stored in the last pass, {name}", grouped(count)) for name, count in s.stored_in_pass.items()]
    rows += [(f"Radius, {name} map", si(radius, "m")) for name, radius in s.radius.items()]
    if s.bytes_per_photon:
        rows.append(("Memory of a photon", f"{s.bytes_per_photon:.1f} bytes"))
    rows.append(("Memory of the maps", data_size(s.map_bytes)))
    return rows


def time_rows(s: Statistics) -> Rows:
    rows = [
        ("Passes", grouped(s.passes)),
        ("Rendering time", duration(s.seconds)),
        ("CPU time", duration(s.cpu_seconds)),
        ("Rays", grouped(s.rays)),
        ("Rays per second", si(s.rays_per_second)),
    ]
    if s.passes and s.seconds:
        rows.append(("Time of a pass", duration(s.seconds / s.passes)))
    return rows


class StatisticsPanel:
    def __init__(self, state: ViewerState) -> None:
        self._state = state

    def gui(self) -> None:
        frame = self._state.frame
        if frame is None:
            imgui.text_disabled("Nothing rendered yet.")
            return
        s = frame.statistics
        if not imgui.begin_table(
            "##columns", 3, imgui.TableFlags_.sizing_stretch_same | imgui.TableFlags_.borders_inner_v
        ):
            return
        imgui.table_next_column()
        _table("Photons", photon_rows(s))
        imgui.table_next_column()
        _table("Time", time_rows(s))
        imgui.table_next_column()
        self._stages(s)
        imgui.end_table()

    @staticmethod
    def _stages(s: Statistics) -> None:
        total = sum(s.stage_seconds.values())
        share = {
            name: f"{duration(t)}  {t / total:4.0%}" if total else duration(t) for name, t in s.stage_seconds.items()
        }
        _table("CPU time by stage", sorted(share.items(), key=lambda row: -s.stage_seconds[row[0]]))
        for name, why in s.skipped:
            imgui.push_text_wrap_pos(0)
            imgui.text_disabled(theme.drawable(f"Skipped {name}: {why}"))
            imgui.pop_text_wrap_pos()
        bad = {place: count for place, count in s.dropped.items() if count}
        for place, count in bad.items():
            colour = imgui.ImVec4(*theme.WARNING)
            imgui.text_colored(colour, f"{grouped(count)} samples dropped in {place}: not finite or negative")
        if not bad:
            imgui.text_disabled("No sample was dropped.")


def _table(title: str, rows: Rows) -> None:
    """Names on the left, right-aligned values."""
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
        offset = imgui.get_content_region_avail().x - imgui.calc_text_size(value).x
        imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(offset, 0))
        imgui.text_unformatted(value)
    imgui.end_table()
