"""Borrowing a cluster in an open window."""

from __future__ import annotations

from types import SimpleNamespace

from pmviewer.engine.cluster.address import check_address
from pmviewer.viewer.dialogs.cluster_dialog import TITLE
from tests.viewer.driver import drive


def test_it_is_borrowed_and_given_back_and_what_is_no_address_is_told(app, session):
    asked = []

    def borrow(where):
        if where is not None:
            check_address(where)
        asked.append(where)
        session.workers.where = where

    session.workers = SimpleNamespace(where=None, borrow=borrow)

    def script(c):
        dialog = app.commands.cluster_dialog
        c.menu_click("//##MainMenuBar/Render/Borrow a cluster …")
        c.yield_(3)
        assert dialog.is_open
        c.item_click(f"//{TITLE}/##cluster.address")
        c.key_chars_replace("nowhere")
        c.yield_(2)
        assert dialog.where == "nowhere", "who types an address wants that one"
        c.item_click(f"//{TITLE}/Borrow##cluster")
        c.yield_(2)
        assert dialog.is_open
        assert "is no cluster" in dialog._problem
        c.item_click(f"//{TITLE}/processes of this machine##cluster")
        c.item_click(f"//{TITLE}/Borrow##cluster")
        c.yield_(2)
        assert not dialog.is_open
        app.commands.table["borrow_cluster"]()
        c.yield_(3)
        c.item_click(f"//{TITLE}/Give it back##cluster")
        c.yield_(2)
        assert not dialog.is_open

    drive(app, script)
    assert asked == ["local:2", None]
