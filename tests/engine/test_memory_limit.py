"""What can't fit into memory is refused before it is tried."""

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
