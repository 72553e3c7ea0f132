"""Settings of the light that a scene is seen by."""

from __future__ import annotations

from typing import Literal

from pmviewer.settings.schema.base import Group, setting


class Light(Group):
    """Light"""

    rig: Literal["auto", "file", "studio", "overcast", "sun", "headlight"] = setting(
        "auto",
        "Where light comes from. auto: from the file's lights, and where these bring next to nothing from a studio. "
        "file: from the file's alone. studio: a soft light above, a dim sky and a floor, in a room a light under its "
        "ceiling. overcast: a grey sky. sun: sun and blue sky. headlight: a point where the scene's camera stands. All "
        "but auto and file take the place of the file's lights; surfaces that glow go on glowing.",
        stage="scene",
        scale="choice",
        title="light rig",
    )
