"""Saving the view, going back to it, forgetting it: what menus and keys do with `pmviewer.viewer.saved_views`."""

from __future__ import annotations

from pmviewer.errors import PmviewerError
from pmviewer.viewer.saved_views import settings_of
from pmviewer.viewer.state import ViewerState


def save_view(state: ViewerState) -> None:
    """Keep the camera that is looked through, for this scene."""
    pose = state.live_camera()
    if pose is None:
        state.say("error", "There is no camera yet: open a scene first.")
        return
    try:
        state.say("info", f"saved the camera as {state.views.add(state.session.scene_path, pose)}")
    except (PmviewerError, OSError) as error:
        state.say("error", f"The view was not saved: {error}")


def forget_view(state: ViewerState, name: str) -> None:
    """Remove a saved view of this scene."""
    try:
        state.views.remove(state.session.scene_path, name)
    except (PmviewerError, OSError) as error:
        state.say("error", f"The view was not removed: {error}")


def go_to_view(state: ViewerState, name: str) -> None:
    """Look from a saved view of this scene, with the camera that is looked through."""
    view = state.views.of(state.session.scene_path).get(name)
    if view is not None:
        state.change(settings_of(view, "free_camera" if state.settings.free_camera.on else "camera"))
