"""A display for the window: the one that is there, or a virtual one of our own."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest

from pmviewer.bench.screen import screen
from pmviewer.viewer.app import ViewerApp
from tests.viewer.driver import make_app
from tests.viewer.fake_session import FakeSession


@pytest.fixture(scope="session", autouse=True)
def display() -> Iterator[None]:
    before = os.environ.get("DISPLAY")
    with screen() as environment:
        os.environ["DISPLAY"] = environment["DISPLAY"]
        yield
    if before is None:
        del os.environ["DISPLAY"]


@pytest.fixture
def session() -> FakeSession:
    """A session that renders nothing, with a scene open."""
    fake = FakeSession()
    fake.open("box")
    return fake


@pytest.fixture
def app(session, tmp_path, monkeypatch) -> ViewerApp:
    """The window on it, at work in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return make_app(session, tmp_path)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that drive a window are marked so."""
    for item in items:
        if hasattr(getattr(item, "module", None), "drive"):
            item.add_marker(pytest.mark.window)
