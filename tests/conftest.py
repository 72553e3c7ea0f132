"""In which order files of tests run, and what a run costs: `pytest --costs 20` lists the tests that took the most CPU
time, with how many functions they had to compile because nobody had before."""

from __future__ import annotations

import gc
import os
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
"""Before NumPy is imported. The library's threads look out for more work for a while after each product, on processors
that the other tests need: a fifth of the time of tests that do much with NumPy."""

COST = "cost"
_begun: pytest.StashKey[tuple[float, int]] = pytest.StashKey()
_compiled: list[int] = []
"""The number of functions compiled so far, once numba is imported."""


@pytest.fixture(scope="module")
def pool() -> Iterator[Any]:
    """Two threads for the tests of a file."""
    from pmviewer.engine.pool import WorkPool  # brings numba along

    made = WorkPool(2)
    yield made
    made.close()


@pytest.fixture
def every_surface() -> Iterator[None]:
    """Scenes are opened as if every kind of material, texture, colour and light were in them."""
    from tests.support import kinds

    with pytest.MonkeyPatch.context() as patch:
        kinds.every_surface(patch)
        yield


@pytest.fixture
def any_light_in_media() -> Iterator[None]:
    """Scenes with media are opened as if lattices and every kind of light were in them."""
    from tests.support import kinds

    with pytest.MonkeyPatch.context() as patch:
        kinds.any_light_in_media(patch)
        yield


@pytest.fixture
def any_bsdf() -> Iterator[None]:
    """Scenes are opened as if rough surfaces were in them."""
    from tests.support import kinds

    with pytest.MonkeyPatch.context() as patch:
        kinds.any_bsdf(patch)
        yield


@pytest.fixture
def any_bsdf_and_light() -> Iterator[None]:
    """Scenes are opened as if rough surfaces and every kind of light were in them."""
    from tests.support import kinds

    with pytest.MonkeyPatch.context() as patch:
        kinds.any_bsdf_and_light(patch)
        yield


@pytest.fixture
def every_path_may_split() -> Iterator[None]:
    """Kernels are those of scenes with mirrors and smooth glass."""
    from tests.support import kinds

    with pytest.MonkeyPatch.context() as patch:
        kinds.may_always_split(patch)
        yield


@pytest.fixture
def room_for_split_paths() -> Iterator[None]:
    """Pixels with one path have the kernels of those with several."""
    from tests.support import kinds

    with pytest.MonkeyPatch.context() as patch:
        kinds.room_for_split_paths(patch)
        yield


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--costs", type=int, default=0, metavar="N", help="list the N tests of the most CPU time")


def pytest_configure(config: pytest.Config) -> None:
    """The garbage collector rests until all modules are imported: it would search them again and again while more and
    more are translated, for a quarter of the time.

    Processes side by side all read all files, each beginning at another one: a file that nobody has translated yet
    is translated by the first that comes by, not by all of them at the same time."""
    worker = getattr(config, "workerinput", None)
    if worker is not None or not config.getoption("numprocesses", None):  # one that imports them
        gc.disable()
    if worker is not None and config.args_source == pytest.Config.ArgsSource.TESTPATHS:
        files = sorted(str(path) for path in Path(__file__).parent.rglob("test_*.py"))
        first = len(files) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
        config.args = files[first:] + files[:first]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread each room's files evenly over the run. Files side by side run at the same time, and those of one room wait
    for each other to compile the same kernels. Long ones first: what comes last decides how long the others are idle.
    """
    rooms: dict[Path, dict[Path, None]] = defaultdict(dict)
    for item in items:
        rooms[item.path.parent][item.path] = None
    # Not as they were collected: each process side by side has begun at another file.
    place = {
        p: ((i + 0.5) / len(files), str(p))
        for files in rooms.values()
        for i, p in enumerate(sorted(files, key=lambda p: (-p.stat().st_size, p)))
    }
    items.sort(key=lambda item: place[item.path])


def pytest_collection_finish() -> None:
    """Modules stay: the garbage collector need not look through them again and again."""
    gc.collect()
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    item.stash[_begun] = _cpu_seconds(), _count()


@pytest.hookimpl(trylast=True)
def pytest_runtest_teardown(item: pytest.Item) -> None:
    seconds, count = item.stash[_begun]
    item.user_properties.append((COST, (_cpu_seconds() - seconds, _count() - count)))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    wanted = terminalreporter.config.getoption("--costs")
    costs = [
        (*dict(report.user_properties)[COST], report.nodeid)
        for reports in terminalreporter.stats.values()
        for report in reports
        if getattr(report, "when", "") == "teardown" and COST in dict(report.user_properties)
    ]
    if not wanted or not costs:
        return
    seconds, compiled = sum(cost[0] for cost in costs), sum(cost[1] for cost in costs)
    terminalreporter.section(f"costs: {seconds:.0f} CPU s, {compiled} functions compiled")
    for cpu, count, name in sorted(costs, reverse=True)[:wanted]:
        terminalreporter.write_line(f"{cpu:7.2f} s {count:5d} functions  {name}")


def _cpu_seconds() -> float:
    """Of this process, of the children that it has waited for, and of those that another one has forked for it."""
    times, fresh = os.times(), sys.modules.get("tests.support.fresh")
    forked = fresh.spent if fresh is not None else 0.0
    return times.user + times.system + times.children_user + times.children_system + forked


def _count() -> int:
    if not _compiled and "numba" in sys.modules:
        from numba.core import event

        class Count(event.Listener):
            def on_start(self, event: event.Event) -> None:
                _compiled[0] += 1

            def on_end(self, event: event.Event) -> None:
                pass

        _compiled.append(0)
        event.register("numba:compile", Count())
    return _compiled[0] if _compiled else 0
