"""What can't fit into memory is refused before it is tried."""

import subprocess
import sys

import pytest

from pmviewer.engine import memory
from pmviewer.errors import SettingError


def test_an_image_that_fits_is_accepted(monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 2_000_000_000)
    memory.check_memory(1920, 1080, 1_000_000)


@pytest.mark.parametrize(
    ("width", "height", "N", "told"),
    [(16384, 16384, 1000, "camera.width"), (64, 64, 50_000_000, "photons.N")],
)
def test_what_does_not_fit_names_the_setting_to_lower(monkeypatch, width, height, N, told):
    monkeypatch.setattr(memory, "available_memory", lambda: 2_000_000_000)
    with pytest.raises(SettingError, match=told):
        memory.check_memory(width, height, N)


def test_a_system_that_does_not_tell_refuses_nothing(monkeypatch):
    monkeypatch.setattr(memory, "available_memory", lambda: None)
    memory.check_memory(16384, 16384, 50_000_000)


def test_this_system_tells():
    assert memory.available_memory() > 1 << 20


@pytest.mark.extensive
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.slow
def test_memory_of_many_photons_comes_back():
    """In a process of its own: what other tests hold would hide it."""
    script = """
import os
from pmviewer.engine.session import Session
from pmviewer.settings.access import with_values
from tests.support.scenes import diffuse_box, settings_of

def used():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

small = settings_of(photons={"N": 2000}, render={"passes": 3})
session = Session(threads=2, settings=small)
session.open(diffuse_box())
assert session.wait(timeout=200)
before = used()
session.set(with_values(small, {"photons.N": 3_000_000, "render.passes": 1}))
assert session.wait(timeout=200)
much = used()
session.set(with_values(small, {"render.passes": 4}))
assert session.wait(timeout=200)
print(before, much, used())
session.close()
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=300)
    before, much, after = map(float, run.stdout.split())
    assert much - before > 150, "or there is nothing to give back"
    assert after - before < 0.35 * (much - before)
