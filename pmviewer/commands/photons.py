"""`pmviewer photons`: the photons of a map as a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pmviewer.commands.options import EditOption, ParameterOption, SceneArgument, SearchOption, SetOption, ThreadsOption


def photons(
    scene: SceneArgument,
    output: Annotated[Path, typer.Option("-o", "--output", help="PLY file to write.")],
    map_: Annotated[str, typer.Option("--map", metavar="MAP", help="global or caustic.")] = "global",
    passes: Annotated[int, typer.Option(min=1, help="Take the photons of this pass, after all before it.")] = 1,
    seed: Annotated[int | None, typer.Option(help="Seed of the random streams.")] = None,
    threads: ThreadsOption = None,
    set_: SetOption = None,
    edit: EditOption = None,
    define: ParameterOption = None,
    search_path: SearchOption = None,
) -> None:
    """Trace photons and write those of a map as points: position, direction, power in W, bounces, light."""
    import warnings

    from pmviewer.commands.job import check_output, load_job
    from pmviewer.commands.patience import print_warnings
    from pmviewer.library.photons import check_map
    from pmviewer.library.rendering import Rendering
    from pmviewer.settings.access import flat

    check_output(output, (".ply",))
    check_map(map_)
    job = load_job(scene, [*(set_ or []), *([] if seed is None else [f"render.seed={seed}"])], define or [], edit or [])
    with (
        warnings.catch_warnings(record=True, action="always") as said,
        Rendering(job.scene, flat(job.settings), parameters=job.parameters, threads=threads) as rendering,
    ):
        found = rendering.photons(map_, passes)
    print_warnings((str(warning.message) for warning in said), {})
    found.save_ply(output)
    print(f"wrote {output}: {len(found):,} photons")
