"""One variant of kernels for drawn scenes, most of which have glass."""

from __future__ import annotations

import pytest

from tests.support.splitting import may_always_split


@pytest.fixture(autouse=True)
def every_path_may_split(monkeypatch):
    may_always_split(monkeypatch)
