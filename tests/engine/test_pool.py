"""The pool does its tasks, ends when it is told to, and gives way to a window, and to nobody where there is none."""

import os
import subprocess
import sys
import threading
import time
from functools import partial
from threading import Event, Thread, current_thread

import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.progress import Cancelled

has_priorities = pytest.mark.skipif(not hasattr(os, "getpriority"), reason="the system has no priority per thread")


def niceness() -> int:
    return os.getpriority(os.PRIO_PROCESS, threading.get_native_id())


def of_pool(**how) -> set[int]:
    pool = WorkPool(2, **how)
    try:
        return set(pool.run([niceness] * 8))
    finally:
        pool.close()


@has_priorities
def test_threads_keep_the_priority_of_the_process_without_a_window():
    assert of_pool() == {niceness()}


@has_priorities
def test_threads_go_behind_a_window():
    assert of_pool(behind_window=True) == {max(10, niceness())}


@has_priorities
def test_a_process_that_is_nicer_than_that_stays_so():
    code = "import os; os.nice(15); from tests.engine.test_pool import of_pool, niceness; "
    code += "print(niceness(), *of_pool(behind_window=True), *of_pool())"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    own, *of_pools = map(int, run.stdout.split())
    assert own >= 15
    assert set(of_pools) == {own}


@has_priorities
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


def test_results_come_in_the_order_of_tasks_and_the_first_error_is_raised():
    pool = WorkPool(3)
    try:
        assert pool.run([partial(divmod, number, 7) for number in range(100)]) == [divmod(n, 7) for n in range(100)]
        with pytest.raises(ZeroDivisionError):
            pool.run([partial(divmod, 1, number) for number in (2, 1, 0, 3)])
        assert pool.run([partial(divmod, 8, 7)] * 2) == [(1, 1)] * 2
    finally:
        pool.close()


def test_closing_ends_what_another_thread_waits_for():
    """Tasks that have begun come to their end; no other begins."""
    pool, begun, may_end, ended, raised = WorkPool(2), Event(), Event(), [], []

    def task() -> None:
        begun.set()
        may_end.wait(10)
        ended.append(1)

    def caller() -> None:
        try:
            pool.run([task] * 50)
        except Cancelled as error:
            raised.append(error)

    thread, closing = Thread(target=caller), Thread(target=pool.close)
    thread.start()
    assert begun.wait(10)
    closing.start()
    assert pool.cancel.wait(10)
    may_end.set()
    thread.join(10)
    closing.join(10)
    assert raised
    assert 1 <= len(ended) <= 2
    with pytest.raises(Cancelled):
        pool.run([task] * 2)


def test_threads_of_a_pool_that_nobody_closes_end_with_it():
    pool = WorkPool(2)
    serving = pool.run([current_thread] * 50)
    del pool
    for thread in serving:
        thread.join(10)
        assert not thread.is_alive()


def test_what_is_begun_goes_before_the_tasks_of_others():
    """On the threads that do the others' tasks, from the next one on; each has its own stage and CPU time."""
    pool, order, asked, begun = WorkPool(2), [], Event(), []

    def late(number: int) -> None:
        if number == 4:
            begun.append(pool.begin(early))
            end = time.monotonic() + 10
            while not pool._first:
                assert time.monotonic() < end
            asked.set()
        elif number > 4:
            assert asked.wait(10)
        order.append(number)

    def early() -> list[str]:
        pool.stage = "early"
        found: list[str] = pool.run([lambda: order.append("early") or current_thread().name] * 6)
        return found

    def spend() -> None:
        start = time.thread_time()
        while time.thread_time() - start < 0.05:
            pass

    try:
        pool.stage = "late"
        pool.run([partial(late, number) for number in range(100)])
        assert pool.stage == "late"
        names = begun[0].result()
        assert set(names) <= {"pmviewer_0", "pmviewer_1"}
        assert max(place for place, who in enumerate(order) if who == "early") < 20
        before = pool.cpu_seconds
        more = pool.begin(lambda: pool.run([spend] * 2))
        more._worker.join(10)
        assert pool.cpu_seconds == before
        more.result()
        assert pool.cpu_seconds - before == pytest.approx(0.1, rel=0.3)
    finally:
        pool.close()


def test_what_is_begun_and_dropped_begins_no_task():
    pool, may, done = WorkPool(2), Event(), []

    def make() -> None:
        assert may.wait(10)
        pool.run([lambda: done.append(1)] * 8)

    try:
        dropped = pool.begin(make)
        dropped.drop()
        may.set()
        with pytest.raises(Cancelled):
            dropped.result()
        may.clear()
        thread = (forgotten := pool.begin(make))._worker
        del forgotten
        may.set()
        thread.join(10)
        assert done == []
        pool.run([lambda: done.append(1)] * 2)
        assert done == [1, 1]
    finally:
        pool.close()


def test_threads_share_begun_and_other_tasks_without_losing_any():
    """Many short batches of both at the same time, some of which fail."""
    pool = WorkPool(4)

    def make(round_: int) -> int:
        total = sum(sum(pool.run([partial(pow, n, 2) for n in range(30)])) for _ in range(10))
        if round_ % 3 == 0:
            with pytest.raises(ZeroDivisionError):
                pool.run([partial(divmod, 1, n) for n in (3, 0, 1, 2)])
        return total

    try:
        for round_ in range(60):
            begun = pool.begin(partial(make, round_))
            assert pool.run([partial(pow, n, 3) for n in range(200)]) == [n**3 for n in range(200)]
            assert begun.result() == 10 * sum(n * n for n in range(30))
    finally:
        pool.close()
