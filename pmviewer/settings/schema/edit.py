"""Settings of what is changed in the open scene."""

from __future__ import annotations

from typing import Any

from pydantic import field_validator

from pmviewer.settings.edits import checked
from pmviewer.settings.schema.base import Group, setting


class Edit(Group):
    """Edits"""

    changes: dict[str, tuple[float, ...]] = setting(
        {},
        "Changes to the scene's lights, materials and objects, such as light.lamp.power = 2; the panel Scene makes "
        "them. Names are those of the file, or numbers from 1 in its order. The file stays as it is.",
        stage="scene",
        scale="edits",
        title="edits",
    )

    @field_validator("changes", mode="before")
    @classmethod
    def _known(cls, value: Any) -> dict[str, tuple[float, ...]]:
        return checked(value)
