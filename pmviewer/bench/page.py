"""The page of `pmviewer bench report`: machine and versions, every target, every table, and error against time."""

from __future__ import annotations

import csv
import io
from collections import defaultdict
from pathlib import Path

from pmviewer.bench.collected import Kept, machine
from pmviewer.bench.report import BenchResult, format_number, to_markdown
from pmviewer.output.files import write_file

PAGE, TARGETS, PLOT = "benchmarks.md", "benchmarks.csv", "images/benchmarks-error.png"
"""As they lie in `docs`."""
OF_ALL = "error"
"""The bench whose curves go by their method alone: others measure the same methods in their own ways."""
MOST_ROWS = 40
"""Of a table on the page; the JSON has all."""


def write_page(folder: Path, kept: list[Kept]) -> str:
    """Page, CSV of the targets and, where matplotlib is installed, plots into the folder; a sentence that says so."""
    plot = write_plot(folder / PLOT, kept)
    text = [*_head(kept), *_targets(kept)]
    if plot:
        text += ["", "## Error against time", "", f"![relMSE against CPU seconds]({PLOT})"]
    for one in kept:
        text += ["", f"<!-- bench {one.name} -->"]
        if one.result is None:
            text += [f"## {one.name}", "", one.failed]
        else:
            text.append(to_markdown(_short(one.result)).rstrip())
    write_file(folder / PAGE, ("\n".join(text) + "\n").encode("utf-8"), (".md",))
    write_file(folder / TARGETS, _csv(kept).encode("utf-8"), (".csv",))
    drawn = f" and {PLOT}" if plot else "; no plot, which needs the bench extra for matplotlib"
    return f"{folder}: {PAGE}, {TARGETS}{drawn}"


def _head(kept: list[Kept]) -> list[str]:
    measured = sorted({one.revision for one in kept if one.revision})
    lines = ["# Benchmarks", "", "As the benches ran (`pmviewer bench all`); nothing is edited by hand.", ""]
    lines += [f"- {line}" for line in machine()]
    lines.append(f"- measured at revision {', '.join(measured) or 'unknown'}, {sum(o.seconds for o in kept):.0f} s")
    found = [one for one in kept if one.result is not None]
    whole = [one.name for one in found if not one.quick]
    quick = [one.name for one in found if one.quick]
    lines.append(f"- whole: {', '.join(whole) or 'none'}")
    lines.append(f"- quick, with fewer photons, cases and seconds than a target asks for: {', '.join(quick) or 'none'}")
    lines += [f"- not measured: {one.name}, {one.failed}" for one in kept if one.result is None]
    return lines


def _targets(kept: list[Kept]) -> list[str]:
    lines = ["", "## Targets", "", "| bench | target | measured | bound | | |", "|---|---|---:|---:|---|---|"]
    for one in kept:
        for t in one.result.targets if one.result is not None else ():
            relation, verdict = ("≥" if t.larger_is_better else "≤"), ("held" if t.ok else "**short**")
            note = t.note.replace("|", "\\|")
            lines.append(
                f"| {_name(one)} | {t.id} | {format_number(t.value)} {t.unit} | {relation} {t.bound:g} | {verdict} "
                f"| {note} |"
            )
    return lines


def _name(one: Kept) -> str:
    return f"{one.name} (quick)" if one.quick else one.name


def _short(result: BenchResult) -> BenchResult:
    if len(result.rows) <= MOST_ROWS:
        return result
    notes = [*result.notes, f"{len(result.rows) - MOST_ROWS} rows more"]
    return BenchResult(result.title, result.columns, result.rows[:MOST_ROWS], (), notes)


def _csv(kept: list[Kept]) -> str:
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\r\n")
    writer.writerow(["bench", "target", "value", "unit", "bound", "larger is better", "held", "note"])
    for one in kept:
        for t in one.result.targets if one.result is not None else ():
            writer.writerow([one.name, t.id, t.value, t.unit, t.bound, t.larger_is_better, t.ok, t.note])
    return buffer.getvalue()


def write_plot(path: Path, kept: list[Kept]) -> bool:
    """Error against CPU seconds of every table that has both by scene and method; whether there was anything to draw
    and something to draw with."""
    curves: dict[str, dict[str, list[tuple[float, float]]]] = defaultdict(lambda: defaultdict(list))
    for one in kept:
        columns = list(one.result.columns) if one.result is not None else []
        if one.result is None or not {"scene", "method", "CPU s", "relMSE"} <= set(columns):
            continue
        at = [columns.index(name) for name in ("scene", "method", "CPU s", "relMSE")]
        for row in one.result.rows:
            scene, method, seconds, error = (row[i] for i in at)
            if isinstance(seconds, str) or isinstance(error, str) or seconds <= 0 or error <= 0:
                continue
            name = str(method) if one.name == OF_ALL else f"{method} ({one.name})"
            curves[str(scene)][name].append((float(seconds), float(error)))
    if not curves:
        return False
    try:
        import matplotlib
    except ImportError:
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot

    wide = min(len(curves), 2)
    high = -(-len(curves) // wide)
    figure, axes = pyplot.subplots(high, wide, figsize=(5.5 * wide, 4 * high + 1), squeeze=False, layout="constrained")
    names = list(dict.fromkeys(method for methods in curves.values() for method in methods))
    colors = dict(zip(names, pyplot.get_cmap("tab20")(range(len(names))), strict=True))
    drawn = {}
    for axis, (scene, methods) in zip(axes.flat, curves.items(), strict=False):
        for method, points in methods.items():
            x, y = zip(*sorted(points), strict=True)
            (drawn[method],) = axis.loglog(x, y, marker="o", markersize=3, color=colors[method], label=method)
        axis.set(title=scene, xlabel="CPU seconds", ylabel="relMSE")
        axis.grid(alpha=0.3)
    figure.legend(drawn.values(), drawn, loc="outside lower center", ncols=4, fontsize="small")
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, dpi=90)
    pyplot.close(figure)
    return True
