"""The pool gives way to a window, and to nobody where there is none."""

import os
import subprocess
import sys
import threading

import pytest

from pmviewer.engine.pool import WorkPool

pytestmark = pytest.mark.skipif(not hasattr(os, "getpriority"), reason="the system has no priority per thread")


def niceness() -> int:
    return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


def of_pool(**how) -> set[int]:
    pool = WorkPool(2, **how)
    try:
        return set(pool.run([niceness] * 8))
    finally:
        pool.close()


def test_threads_keep_the_priority_of_the_process_without_a_window():
    assert of_pool() == {niceness()}


def test_threads_go_behind_a_window():
    assert of_pool(behind_window=True) == {max(10, niceness())}


def test_a_process_that_is_nicer_than_that_stays_so():
    code = "import os; os.nice(15); from tests.engine.test_pool import of_pool, niceness; "
    code += "print(niceness(), *of_pool(behind_window=True), *of_pool())"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    own, *of_pools = map(int, run.stdout.split())
    assert own >= 15
    assert set(of_pools) == {own}


def test_rendering_to_a_file_makes_a_pool_of_normal_priority(monkeypatch, tmp_path):
    """What `pmviewer render` runs its tasks at, asked of the tasks themselves."""
    from pmviewer.commands import cli

    seen: set[int] = set()
    work = WorkPool._work

    def watched(self, batch):
        seen.add(niceness())
        return work(self, batch)

    monkeypatch.setattr(WorkPool, "_work", watched)
    cli.render("cornell_diffuse", [tmp_path / "a.png"], passes=1, size="8x8", threads=1)
    assert seen == {niceness()}
