"""Lights that the camera does not see (Mitsuba's `hide_emitters`): camera rays pass all surfaces that shine, and find
the sky black where they meet nothing. What lights shine on, and mirrors and glass that show them, stay as they are.

Eye records without the field `hides` show them, and compile none of it.
"""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.accel.raycast import closest_hit
from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.scene import light_of
from pmviewer.render.cast import Ray

HIDDEN_FIELDS: list[tuple[str, str]] = [("hides", "i4")]
"""Of eye records: 1, its presence says it."""
MOST_PASSED = 1024
"""Surfaces that shine on a camera ray; the next one would be seen."""

_f4 = np.float32
_i8 = np.int64
_BEYOND = _f4(1.0 + 2.0**-21)


@specialised
def hides_lights(eye):
    """Whether the camera does not see lights and the sky."""
    if has(eye, "hides"):
        return lambda eye: True
    return lambda eye: False


@specialised
def past_lights(scene, eye, ray):
    """The camera ray, from behind the lights that the camera does not see. The scene has no media."""
    if not has(eye, "hides"):
        return lambda scene, eye, ray: ray
    return lambda scene, eye, ray: _past(scene, ray)


@device
def _past(scene, ray):
    o, d, near = ray.o, ray.d, ray.near
    for _ in range(MOST_PASSED):
        t, found, _, _ = closest_hit(scene, o[0], o[1], o[2], d[0], d[1], d[2], near, ray.far)
        if found < 0 or light_of(scene, _i8(found)) < 0:
            break
        near = t * _BEYOND  # the same ray meets the same surface at the same distance
    return Ray(o, d, near, ray.far, ray.medium, ray.wave)
