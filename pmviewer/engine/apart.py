"""Whether the passes of a rendering can be rendered apart: in any order, by whoever has time."""

from __future__ import annotations

from pmviewer.engine.method import radii_of_pixels
from pmviewer.errors import SettingError
from pmviewer.settings.needs import Facts


def bound_passes(facts: Facts) -> str:
    """Why a pass needs what those before it found, and what to set instead; "" where passes stand alone."""
    if radii_of_pixels(facts):
        return (
            "estimate.radius_rule = pixel: the radii of a pass depend on the passes before it, so that passes can't be "
            "rendered apart, as on a cluster; set estimate.radius_rule=pass."
        )
    if facts.plan.emission != "off":
        return (
            f"importance.emission = {facts.plan.emission}: where photons leave depends on what those of the passes "
            "before met, so that passes can't be rendered apart, as on a cluster; set importance.emission=off."
        )
    if facts.plan.adaptive:
        return (
            "render.adaptive = on: how many samples a pixel has depends on the passes before, so that passes can't be "
            "rendered apart, as on a cluster; set render.adaptive=off."
        )
    return ""


def check_apart(facts: Facts) -> None:
    """Raises SettingError where passes can't be rendered apart."""
    if said := bound_passes(facts):
        raise SettingError(said)
