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
CLIPPED = Need(lambda f: f.settings.camera.clip != "off", "Nothing is clipped (camera.clip).")


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
    clip: Literal["off", "view", "x", "y", "z"] = setting(
        "off",
        "Leaves out what lies on the camera's side of a plane, so that one looks into closed rooms from outside: "
        "across the view or across an axis. Light is that of the whole scene.",
        stage="image",
        scale="choice",
        title="clipping plane",
    )
    clip_at: float = setting(
        0.0,
        "Place of the clipping plane, from the scene's centre along the axis or the view.",
        stage="image",
        scale="linear",
        unit="× scene",
        ge=-1.0,
        le=1.0,
        title="place of the plane",
        needs=(CLIPPED,),
    )
    width: int | Auto = setting(
        "auto", "Image width; auto is the scene file's.", stage="image", scale="integer", unit="px", ge=1, le=16384
    )
    height: int | Auto = setting("auto", "Image height.", stage="image", scale="integer", unit="px", ge=1, le=16384)
