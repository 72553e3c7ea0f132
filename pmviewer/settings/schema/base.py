"""What the schema is made of: a field with its bounds, scale, unit and stage, and a frozen group of fields."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from pmviewer.settings.needs import Need, Needs

Scale = Literal["linear", "log", "integer", "choice", "name", "switch", "vector", "edits"]
Stage = Literal["scene", "photons", "maps", "image", "display", "stop"]
Auto = Literal["auto"]
Vec3 = tuple[float, float, float]


def setting(
    default: Any,
    description: str,
    *,
    stage: Stage,
    scale: Scale,
    title: str = "",
    unit: str = "",
    ge: float | None = None,
    le: float | None = None,
    section: str = "",
    needs: Needs = (),
    choice_needs: Mapping[str, Needs] | None = None,
) -> Any:
    """A field of the schema. `ge` and `le` bound numbers, `unit` is shown behind the value, `section` is a heading for
    it and those that follow in the group. `needs` is what must hold for it to have an effect, `choice_needs` for one of
    its choices, besides what its group needs; the first that does not is told."""
    extra: dict[str, Any] = {"stage": stage, "scale": scale, "unit": unit, "ge": ge, "le": le, "section": section}
    extra |= {"needs": needs, "choice_needs": choice_needs or {}}
    return Field(default, description=description, title=title or None, json_schema_extra=extra)


def subgroup(model: type[Group], title: str, *needs: Need, alias: str | None = None) -> Any:
    """A group within a group, with what all of its settings need in this place."""
    extra: dict[str, Any] = {"needs": needs}
    return Field(default_factory=model, title=title, alias=alias, json_schema_extra=extra)


class Group(BaseModel):
    """A frozen group of settings; unknown names are refused. `needs` is what all of its settings need."""

    needs: ClassVar[Needs] = ()

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="after")
    @classmethod
    def _in_bounds(cls, value: Any, field: ValidationInfo) -> Any:
        """Bounds live in the schema's extras, not in pydantic's own constraints, which "auto" would not pass."""
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            extra: Any = cls.__pydantic_fields__[field.field_name or ""].json_schema_extra
            low, high = (extra["ge"], extra["le"]) if extra else (None, None)
            if (low is not None and value < low) or (high is not None and value > high):
                raise ValueError("out of bounds")
        return value
