"""What the log says of a scene that has just become the open one."""

from __future__ import annotations

from collections.abc import Iterator

from pmviewer.engine.frame import Level
from pmviewer.engine.opened import OpenScene, is_edited


def welcome(opened: OpenScene, before: OpenScene | None, note: str) -> Iterator[tuple[Level, str]]:
    """Sentences; of a scene with other lights than `before` only what is new. `note` is about its geometry."""
    edited = is_edited(before, opened)
    relit = before is not None and opened.content is not None and opened.content is before.content
    for warning in opened.scene.warnings:
        if not ((edited or relit) and before is not None and warning in before.scene.warnings):
            yield "warning", warning
    if edited:
        return
    if relit:
        yield "info", f"light rig: {opened.arrangement.rig}"
        return
    for reason, count in opened.scene.dropped.items():
        yield "warning", f"{count} × {reason} left out"
    flat = opened.flat
    yield "info", f"opened {opened.source}: {flat.n_triangles:,} triangles, {flat.n_quadrics:,} round shapes"
    if flat.n_instances:
        yield "info", f"{flat.n_instances:,} instances show {flat.n_elements:,} elements"
    if note:
        yield "info", note
