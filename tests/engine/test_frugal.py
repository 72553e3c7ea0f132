"""Memory that is free goes back to the system: from whatever thread it was asked for, and in each pause."""

import subprocess
import sys

import pytest

from pmviewer.engine import frugal
from pmviewer.engine.session import Session
from pmviewer.settings.access import with_values
from tests.support.scenes import diffuse_box, settings_of
from tests.support.sessions import PATIENCE, until

OF_A_THREAD = """
import threading
from pmviewer.heap import give_back, one_heap
from pmviewer.viewer.random_user import resident

one_heap()
bytes(31 << 20)  # when so much is freed, up to twice that is kept from now on
taken, go, freed, done = locks = [threading.Lock() for _ in range(4)]
for lock in locks:
    lock.acquire()

def work():
    blocks = [bytes([i % 255]) * 100_000 for i in range(400)]
    taken.release()
    go.acquire()
    del blocks  # the last one last: what is free is the end of the heap
    freed.release()
    done.acquire()

thread = threading.Thread(target=work)
thread.start()
taken.acquire()
print(resident())
go.release()
freed.acquire()
give_back()
print(resident())
done.release()
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems' heaps are other ones")
def test_what_a_thread_has_freed_goes_back():
    """With several heaps most is kept, mostly: at the end of another than the main one."""
    command = [sys.executable, "-c", OF_A_THREAD]
    run = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    full, after = map(float, run.stdout.split())
    assert full - after > 35


def test_what_is_free_goes_back_once_in_each_pause(monkeypatch):
    given = []
    monkeypatch.setattr(frugal, "QUIET", 0.05)
    monkeypatch.setattr(frugal, "give_back", lambda: given.append(session.status.state))
    settings = settings_of(photons={"N": 500}, render={"passes": 2})
    session = Session(threads=1, settings=settings)
    try:
        until(lambda: given)
        session.open(diffuse_box())
        assert session.wait(timeout=PATIENCE)
        until(lambda: len(given) > 1)
        for _ in range(5):
            session.pause()  # wakes it, and there is nothing to do
        until(lambda: session.status.state == "finished")
        assert given == ["empty", "finished"]
        session.set(with_values(settings, {"photons.N": 600}))
        session.resume()
        assert session.wait(timeout=PATIENCE)
        until(lambda: len(given) > 2)
        assert given == ["empty", "finished", "finished"]
    finally:
        session.close()
