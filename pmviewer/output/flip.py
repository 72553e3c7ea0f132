"""FLIP, the difference that a viewer sees when two pictures alternate (Andersson et al. 2020; for radiance Andersson
et al. 2021), by its authors' implementation `flip-evaluator`."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import OutputError

MISSING = "Needs FLIP's evaluator: pip install 'pmviewer[flip]'."
PIXELS_PER_DEGREE = 67.0
"""A 0.7 m wide screen of 3840 pixels from 0.7 m: the authors' own."""


def is_installed() -> bool:
    """Whether the evaluator is there; nothing is imported."""
    return find_spec("flip_evaluator") is not None


def flip_error(image: NDArray[Any], reference: NDArray[Any]) -> NDArray[np.float32]:
    """(h, w) in 0 … 1 of two radiances (h, w, 3) by HDR-FLIP, whose exposures follow from the reference; what is
    negative counts as 0. NaN where either is not finite. Raises OutputError where the evaluator lacks."""
    if not is_installed():
        raise OutputError(f"FLIP: {MISSING}")
    import flip_evaluator

    bad = ~(np.isfinite(image).all(axis=-1) & np.isfinite(reference).all(axis=-1))
    test, truth = (
        np.ascontiguousarray(np.where(bad[..., None], 0.0, np.maximum(np.nan_to_num(picture), 0.0)), np.float32)
        for picture in (image, reference)
    )
    if not truth.any() and not test.any():
        error = np.zeros(bad.shape, np.float32)  # two black pictures have no exposure
    else:
        parameters = {"ppd": PIXELS_PER_DEGREE}
        found, _, _ = flip_evaluator.evaluate(truth, test, "HDR", applyMagma=False, parameters=parameters)
        error = np.asarray(found, np.float32).reshape(bad.shape).copy()
    error[bad] = np.nan
    return error
