"""Settings of the render camera."""

from __future__ import annotations

from typing import Literal

from pmviewer.settings.needs import LENS, Need
from pmviewer.settings.schema.base import Auto, Group, Vec3, setting

PERSPECTIVE = Need(
    lambda f: f.settings.camera.projection != "orthographic",
    "An orthographic camera has none: see camera.view_width.",
)
OWN_PERSPECTIVE = Need(
    lambda f: f.settings.camera.projection != "auto" or not f.traits.orthographic,
    "The scene's camera is orthographic: see camera.view_width.",
)
ORTHOGRAPHIC = Need(
    lambda f: f.settings.camera.projection != "perspective", "Only of an orthographic camera (camera.projection)."
)
OWN_ORTHOGRAPHIC = Need(
    lambda f: f.settings.camera.projection != "auto" or f.traits.orthographic,
    "The scene's camera is perspective (camera.projection).",
)


class CameraSettings(Group):
    """Camera"""

    name: str = setting(
        "auto",
        "Which of the file's cameras, by its name or its number from 1; auto is the first. The settings below come on "
        "top of it.",
        stage="image",
        scale="name",
        title="camera",
    )
    origin: Vec3 | Auto = setting("auto", "Eye point; auto is the scene file's.", stage="image", scale="vector")
    target: Vec3 | Auto = setting("auto", "Point in the image's centre.", stage="image", scale="vector")
    up: Vec3 | Auto = setting("auto", "Direction that is upright in the image.", stage="image", scale="vector")
    fov: float | Auto = setting(
        "auto",
        "Horizontal field of view.",
        stage="image",
        scale="linear",
        unit="°",
        ge=1.0,
        le=170.0,
        title="FOV",
        needs=(
            PERSPECTIVE,
            OWN_PERSPECTIVE,
        ),
    )
    projection: Literal["auto", "perspective", "orthographic"] = setting(
        "auto",
        "perspective: things look smaller the farther away they are. orthographic: rays are parallel, sizes and angles "
        "stay true. auto is the scene file's.",
        stage="image",
        scale="choice",
    )
    view_width: float | Auto = setting(
        "auto",
        "What the width of an orthographic picture spans. Automatic: the scene file's, or what its perspective camera "
        "sees at its target.",
        stage="image",
        scale="log",
        unit="units",
        ge=1e-12,
        le=1e15,
        title="view width",
        needs=(
            ORTHOGRAPHIC,
            OWN_ORTHOGRAPHIC,
        ),
    )
    shift_x: float | Auto = setting(
        "auto",
        "Moves the picture to the right by that share of its width without turning the camera, as a shift lens does.",
        stage="image",
        scale="linear",
        unit="× width",
        ge=-1000.0,
        le=1000.0,
        title="shift right",
    )
    shift_y: float | Auto = setting(
        "auto",
        "Moves the picture down by that share of its height.",
        stage="image",
        scale="linear",
        unit="× height",
        ge=-1000.0,
        le=1000.0,
        title="shift down",
    )
    aperture: float | Auto = setting(
        "auto",
        "Radius of the lens: what is nearer or farther than camera.focus gets blurred. 0 is a pinhole, which shows all "
        "sharp. Automatic: the scene file's.",
        stage="image",
        scale="linear",
        unit="units",
        ge=0.0,
        le=1e15,
    )
    focus: float | Auto = setting(
        "auto",
        "Distance of what the lens shows sharp, along the view. Automatic: the scene file's, or that of the surface in "
        "the middle of the picture.",
        stage="image",
        scale="log",
        unit="units",
        ge=1e-12,
        le=1e15,
        title="focus distance",
        needs=(LENS,),
    )
    width: int | Auto = setting(
        "auto", "Image width; auto is the scene file's.", stage="image", scale="integer", unit="px", ge=1, le=16384
    )
    height: int | Auto = setting("auto", "Image height.", stage="image", scale="integer", unit="px", ge=1, le=16384)
