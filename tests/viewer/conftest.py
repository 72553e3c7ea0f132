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


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that drive a window are marked so."""
    for item in items:
        if hasattr(getattr(item, "module", None), "drive"):
            item.add_marker(pytest.mark.window)
