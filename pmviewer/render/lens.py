"""The thin lens: rays from a disc in the eye's plane that meet where the pinhole's ray meets the plane in focus.

The camera's picture is that of a pinhole in the lens's middle, each point of it blurred to a disc (Cook, Porter and
Carpenter 1984, as Mitsuba's `thinlens` has it). With R the lens's radius and F the distance in focus, a ray starts at
the lens's point a, |a| ≤ R, and goes to o + F·d, d being the pinhole's direction with a part of 1 along the view: along
d − a/F. An orthographic camera's rays start around their pixel's place (a telecentric lens).

Records without the field `inverse_focus` are pinholes, and nothing of this is compiled for them.
"""

from __future__ import annotations

import math

import numpy as np

from pmviewer.kernels.compile.jit import device
from pmviewer.kernels.compile.specialise import has, specialised
from pmviewer.kernels.dimensions import LENS
from pmviewer.kernels.random import draw4
from pmviewer.kernels.vector import add, along, dot, scale
from pmviewer.kernels.warp import square_to_disk
from pmviewer.render.cast import ray_of_camera

_f4 = np.float32

LENS_FIELDS: list[tuple[str, str]] = [
    *[(f"{axis}_lens_{part}", "f4") for part in ("right", "top") for axis in "xyz"],  # half axes of the disc
    ("inverse_focus", "f4"),  # one over the distance of the plane in focus
]
"""Of the eye records of cameras with a lens."""


@specialised
def lens_numbers(eye, seed):
    """Two numbers for the place on the lens of the camera ray of the pixel with that seed; without a lens none are
    drawn, and they are 0."""
    if not has(eye, "inverse_focus"):
        return lambda eye, seed: (_f4(0.0), _f4(0.0))

    def drawn(eye, seed):
        a, b, _, _ = draw4(eye.sequence, seed, eye.index, LENS)
        return a, b

    return drawn


@device
def lens_point(eye, a, b):
    """Place on the lens from its middle, uniform on the disc for (a, b) in [0, 1)²."""
    x, y = square_to_disk(a, b)
    right = (eye.x_lens_right, eye.y_lens_right, eye.z_lens_right)
    return along(scale(right, x), (eye.x_lens_top, eye.y_lens_top, eye.z_lens_top), y)


@device
def through_lens(eye, raw, a, b):
    """The ray of a lens from its point (a, b) in [0, 1)², and its direction before it was made a unit vector.

    raw: of the pinhole's ray the direction, 1 along the view, or of an orthographic camera the place from the eye.
    """
    forward = (eye.x_forward, eye.y_forward, eye.z_forward)
    point = lens_point(eye, a, b)
    place, towards = point, raw
    if eye.orthographic != 0:
        place, towards = add(point, raw), forward
    towards = along(towards, point, -eye.inverse_focus)
    d = scale(towards, _f4(1.0) / _f4(math.sqrt(dot(towards, towards))))
    return ray_of_camera(eye, place, d), towards
