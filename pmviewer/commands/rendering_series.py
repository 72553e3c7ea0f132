"""A series of pictures and its files."""

from __future__ import annotations

from pmviewer.commands.picture_files import Outputs, PictureFiles, check_sizes
from pmviewer.commands.progress_bar import progress_bar
from pmviewer.commands.series_plan import Plan
from pmviewer.commands.series_steps import steps_on
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.series.render import missing
from pmviewer.output.contact_sheet import contact_sheet
from pmviewer.output.film import Film
from pmviewer.output.png import write_png


def render_series(plan: Plan, outputs: Outputs, threads: int | None, cluster: str | None = None) -> None:
    """Render what is missing, on the `cluster` if one is named, and write everything. Raises PmviewerError."""
    count = len(plan.pictures)
    check_sizes(outputs, plan.pictures)
    films, seen = [Film(path, outputs.fps) for path in outputs.films], []
    files, pool = PictureFiles(outputs, count), WorkPool(threads)
    try:
        with progress_bar(remaining=True) as bar, steps_on(cluster, threads, plan, bar) as steps:
            for picture, frame in missing(plan.opened, plan.pictures, pool, bar.update, files.is_there, steps):
                pixels, _ = files.take(picture, frame, lambda frame: {})
                for film in films:
                    assert pixels is not None
                    film.add(pixels)
                if outputs.sheet is not None:
                    seen.append(pixels)
        for film in films:
            film.close()
            print(f"wrote {film.path}: {count} pictures, {count / outputs.fps:.3g} s")
    except BaseException:
        for film in films:
            film.drop()
        raise
    finally:
        pool.close()
    if outputs.sheet is not None:
        write_png(outputs.sheet, contact_sheet([one for one in seen if one is not None], plan.captions))
        print(f"wrote {outputs.sheet}: {count} pictures")
    files.say()
