"""Settings of the free camera: looking at what was made for the render camera from somewhere else."""

from __future__ import annotations

from pmviewer.settings.needs import Need
from pmviewer.settings.schema.base import Auto, Group, Vec3, setting

ON = Need(lambda f: f.settings.free_camera.on, "Only with the free camera (free_camera.on).")
CUT = Need(lambda f: f.settings.free_camera.cut, "Nothing is cut open (free_camera.cut).")
FRUSTUM = Need(lambda f: f.settings.free_camera.frustum, "The frustum is not drawn.")


class FreeCamera(Group):
    """Free camera"""

    on: bool = setting(
        False,
        "The picture, its views and overlays as another camera sees them. Importance, stored photons and look-up "
        "radii stay those of the render camera (group 'Camera'), whose frustum is drawn.",
        stage="image",
        scale="switch",
        title="free camera",
    )
    origin: Vec3 | Auto = setting(
        "auto",
        "Eye point. Automatic: behind and above the render camera, so far that scene and camera fit.",
        stage="image",
        scale="vector",
        needs=(ON,),
    )
    target: Vec3 | Auto = setting(
        "auto",
        "Point in the image's centre. Automatic: the centre of scene and render camera.",
        stage="image",
        scale="vector",
        needs=(ON,),
    )
    up: Vec3 | Auto = setting(
        "auto",
        "Direction that is upright. Automatic: the coordinate axis nearest to the render camera's.",
        stage="image",
        scale="vector",
        needs=(ON,),
    )
    fov: float | Auto = setting(
        "auto",
        "Horizontal field of view. Automatic: 45°.",
        stage="image",
        scale="linear",
        unit="°",
        ge=1.0,
        le=170.0,
        title="FOV",
        needs=(ON,),
    )
    cut: bool = setting(
        True,
        "Leave out what lies above the cut height, so that one looks into closed rooms from above. Light is that of "
        "the whole scene. Nothing is left out while the free camera itself is below.",
        stage="image",
        scale="switch",
        title="cut open",
        needs=(ON,),
    )
    cut_height: float = setting(
        0.02,
        "Height of the cut above the render camera's eye.",
        stage="image",
        scale="linear",
        unit="× scene",
        ge=-2.0,
        le=2.0,
        needs=(
            ON,
            CUT,
        ),
    )
    frustum: bool = setting(
        True,
        "Draw the render camera's frustum.",
        stage="display",
        scale="switch",
        needs=(ON,),
    )
    length: float = setting(
        0.3,
        "Distance of the frustum's image plane from the render camera's eye.",
        stage="display",
        scale="log",
        unit="× scene",
        title="frustum length",
        ge=0.01,
        le=10.0,
        needs=(
            ON,
            FRUSTUM,
        ),
    )
