"""One bench in a process of its own: `python -m pmviewer.bench.one NAME FOLDER full|quick` keeps its result there."""

from __future__ import annotations

import sys
import time
from pathlib import Path

from pmviewer.bench.collected import Kept, revision, save
from pmviewer.bench.registry import run_bench
from pmviewer.errors import PmviewerError


def main(name: str, folder: str, how: str) -> None:
    """Run it; what goes wrong in words is its result."""
    start, quick = time.perf_counter(), how == "quick"
    result, failed = None, ""
    try:
        result = run_bench(name, quick)
    except PmviewerError as error:
        failed = str(error)
    save(Path(folder), Kept(name, result, failed, time.perf_counter() - start, quick, revision()))


if __name__ == "__main__":
    main(*sys.argv[1:4])
