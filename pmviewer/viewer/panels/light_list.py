"""The most important lights in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # numba, which the window doesn't wait for
    from pmviewer.photons.emission.light_importance import LightImportance


def top_lights(lights: LightImportance, count: int) -> list[int]:
    """Numbers of at most `count` lights that light the picture, the most important ones first."""
    order = np.argsort(-lights.lit, kind="stable")[:count]
    return [int(i) for i in order if lights.lit[i] > 0]


def is_guided(lights: LightImportance) -> bool:
    """Whether photons leave the lights otherwise than by power."""
    return bool(np.any(np.abs(lights.factor - 1.0) > 1e-6))


def share_text(lights: LightImportance, light: int) -> str:
    """How much of the picture a light lights; with guided emission also how many of the photons leave it."""
    text = f"{lights.lit[light]:.1%}"
    if is_guided(lights):
        text += f", {lights.share[light]:.1%} of photons ({lights.factor[light]:.2g}×)"
    return text


def light_rows(lights: LightImportance, count: int) -> list[tuple[str, str]]:
    """Names and shares of the most important lights, and what is left for all others."""
    chosen = top_lights(lights, count)
    rows = [(f"{i + 1}: {lights.names[i]}", share_text(lights, i)) for i in chosen]
    others = len(lights.names) - len(chosen)
    if others:
        rows.append((f"{others} others", f"{max(0.0, 1.0 - float(lights.lit[chosen].sum())):.1%}"))
    return rows
