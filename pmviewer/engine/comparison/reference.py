"""The reference that a picture is measured against, checked against how the picture is seen."""

from __future__ import annotations

from pathlib import Path

from pmviewer.errors import SceneError, SettingError
from pmviewer.output.compare import Reference, load_reference
from pmviewer.render.camera import are_hidden, resolve_camera, size_only
from pmviewer.render.filter import is_own
from pmviewer.scene.description import Scene
from pmviewer.scene.load import reference_of
from pmviewer.settings.access import Settings


def reference_for(source: str | Path | None, scene: Scene, settings: Settings) -> Reference:
    """The reference in a file, or the scene's own (None), for pictures with these settings.

    Raises SceneError where there is none, where it is of another size, and where the scene's own was seen by another
    camera or has another filter; SettingError with a free camera.
    """
    if settings.free_camera.on:
        raise SettingError("References are seen by the render camera: switch free_camera.on off to compare with one.")
    if source is None and settings.edit.changes:
        raise SceneError("The scene's reference shows it as it is in its file: leave out the edits.")
    camera = resolve_camera(scene, settings.camera)
    path = reference_of(scene) if source is None else Path(source)
    if path is None:
        raise SceneError(f"The scene '{scene.name}' has no reference of its own.", hint="Name an EXR file.")
    own = settings.camera.clip == "off" and camera.sees_like(resolve_camera(scene, size_only(settings.camera)))
    if source is None and not own:
        raise SceneError(
            "The scene's reference is seen by the scene's own camera: leave out the camera settings.", path
        )
    if source is None and not is_own(camera.filter, settings.render):
        raise SceneError(
            "The scene's reference has the scene's own reconstruction filter: leave out render.filter.", path
        )
    if source is None and are_hidden(camera.hides_lights, settings.render) != camera.hides_lights:
        raise SceneError("The scene's reference shows lights as its file says: leave out render.lights.", path)
    reference = load_reference(path)
    reference.check_size((camera.width, camera.height))
    return reference
