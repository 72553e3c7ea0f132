"""Work that is dropped lets go of what it was done with at once: pictures of an interrupted pass are of a hundred
megabytes, and Python looks for circles of references once in many thousand new objects."""

import gc
import threading
import weakref
from functools import partial

import pytest

from pmviewer.engine.pool import WorkPool
from pmviewer.progress import Cancelled, beside, parallel


class Picture:
    """Stands for what is large."""


@pytest.fixture
def no_collector():
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def by_pool(tasks):
    pool = WorkPool(2)
    try:
        pool.run(tasks)
    finally:
        pool.close()


def cancelled(tasks):
    pool = WorkPool(2)
    pool.cancel.set()
    try:
        pool.run(tasks)
    finally:
        pool.close()


def by_beside(tasks):
    with beside(tasks[0]) as first, beside(tasks[1]) as second:
        first()
        second()


def raises_again(run, tasks, pictures):
    picture = Picture()
    pictures.append(weakref.ref(picture))
    run(tasks)


@pytest.mark.parametrize(
    ("run", "error"),
    [
        (by_pool, ZeroDivisionError),
        (parallel, ZeroDivisionError),
        (by_beside, ZeroDivisionError),
        (cancelled, Cancelled),
    ],
)
def test_an_error_of_a_task_keeps_nothing_that_it_came_through(no_collector, run, error):
    pictures, both = [], threading.Barrier(2)

    def task(own):
        if run is not cancelled:
            both.wait(60)
        return 1 / 0

    tasks = [partial(task, picture) for picture in (Picture(), Picture())]
    pictures = [weakref.ref(of.args[0]) for of in tasks]
    with pytest.raises(error) as raised:
        raises_again(run, tasks, pictures)
    assert [ref() is None for ref in pictures] == [False, False, False]
    del tasks, raised
    assert [ref() is None for ref in pictures] == [True, True, True]
