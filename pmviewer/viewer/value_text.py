"""Values of settings in words, as widgets, tooltips and the history show them."""

from __future__ import annotations

from typing import Any

from pmviewer.settings.access import SettingInfo
from pmviewer.settings.edits import as_text
from pmviewer.viewer.format import grouped, short


def value_text(info: SettingInfo, value: Any) -> str:
    """The value with separators and unit."""
    if value is None:
        return "not known yet"
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, tuple | list):
        return ", ".join(f"{v:.4g}" for v in value)
    if isinstance(value, dict):
        return as_text(value) or "none"
    number = grouped(value) if info.kind is int else short(value)
    return f"{number} {info.unit}".rstrip()
