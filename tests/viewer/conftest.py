"""A display for the window: the one that is there, or a virtual one of our own."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from pmviewer.bench.screen import screen


@pytest.fixture(scope="session", autouse=True)
def display() -> Iterator[None]:
    before = os.environ.get("DISPLAY")
    with screen() as environment:
        os.environ["DISPLAY"] = environment["DISPLAY"]
        yield
    if before is None:
        del os.environ["DISPLAY"]
