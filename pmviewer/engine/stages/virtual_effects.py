"""Why a setting of virtual lights has no effect just now."""

from __future__ import annotations

from pmviewer.engine.method import Plan
from pmviewer.maps.virtual_lights import CLAMPED, ESTIMATORS, PRINTED, SINGLE, UNWEIGHTED
from pmviewer.settings.access import Settings


def virtual_inactive(path: str, settings: Settings, plan: Plan) -> str | None:
    """A sentence for a setting of the group that changes nothing, None for one that does."""
    how = settings.virtual
    estimator = ESTIMATORS.index(how.estimator)
    if not plan.virtual:
        return "Only with the method 'virtual lights' (render.method), where surfaces store photons."
    if path == "virtual.clamp" and estimator != CLAMPED:
        return "Only with the estimator 'clamped'."
    if path == "virtual.density" and estimator != SINGLE:
        return "Only with the estimator 'single step'."
    if path == "virtual.photons" and not (estimator == SINGLE and how.density == "photon map"):
        return "Only with a single step by the photon map's density."
    if path == "virtual.k" and how.estimator not in ("single step", "printed single step"):
        return "Only with a single step."
    if path in ("virtual.normalisation", "virtual.walks", "virtual.window"):
        if estimator in (UNWEIGHTED, CLAMPED):
            return "The plain sum is not weighted."
        if estimator in PRINTED and path != "virtual.walks":
            return "The printed forms are not normalised."
        if path == "virtual.window" and how.normalisation != "interpolated":
            return "Only with an interpolated normalisation."
    return None
