"""`pmviewer compile`: compiled before it is needed."""

from __future__ import annotations

from pmviewer.commands.view import DEFAULT_SCENE


def compile_() -> None:
    """Compile what the window's first clicks need, once for each version; otherwise it is compiled when needed."""
    from pmviewer.commands.compiling import compile_clicks

    compile_clicks(DEFAULT_SCENE)
