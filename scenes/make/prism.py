"""A prism that splits a beam of white light (Jensen's course guide 2002, §1.4; after Newton's experiment)."""

from __future__ import annotations

import math

import numpy as np

from make.document import BLACK, MadeScene, bsdf, diffuse, lamp, mesh, number, numbers, panel, rgb
from make.mesh import Mesh, prism

GLASS = "SF11"
MIDDLE_INDEX = 1.795
"""About that of green light: the beam goes through symmetrically for it."""
SIDE, HEIGHT = 0.5, 0.4
BEND = 2 * math.asin(MIDDLE_INDEX / 2) - math.pi / 3
"""The beam's deviation in radians; it comes along +x and is bent towards −z."""
SCREEN = 2.0
"""Distance from the prism's middle, along the bent beam."""
SLIT = 0.014


def _body() -> tuple[Mesh, float]:
    """The prism, upright, and the beam's z. Green light runs through its middle, along its base."""
    along = np.array([math.cos(BEND / 2), -math.sin(BEND / 2)])  # (x, z)
    apex = np.array([-along[1], along[0]])
    radius = SIDE / math.sqrt(3)
    corners = [radius * apex, -radius / 2 * apex - SIDE / 2 * along, -radius / 2 * apex + SIDE / 2 * along]
    body = prism([tuple(corner) for corner in corners], 0.001, HEIGHT)
    bottom = np.array([[0, 1, 2]], np.int32)
    (x0, _, z0), (x1, _, z1), (x2, _, z2) = body.vertices[:3]
    if (z1 - z0) * (x2 - x0) - (x1 - x0) * (z2 - z0) > 0:  # upwards: it must face down
        bottom = bottom[:, ::-1]
    closed = Mesh(body.vertices, np.concatenate([body.faces, bottom]).astype(np.int32))
    return closed, float(-SIDE / 3 * along[1])


def prism_and_screen() -> MadeScene:
    """The spot's cone is narrow and grazes the table; a slit close to the prism makes a sheet of it."""
    body, z = _body()
    spot_at, aim = (-1.8, 0.22, z), (0.0, 0.11, z)
    direction = np.array([math.cos(BEND), 0.0, -math.sin(BEND)])
    across = (1.1 * math.sin(BEND), 0.0, 1.1 * math.cos(BEND))
    middle = SCREEN * direction
    half = 0.2
    spot = (
        f'<emitter type="spot"><transform name="to_world"><lookat origin="{numbers(*spot_at)}" '
        f'target="{numbers(*aim)}" up="0 1 0"/></transform>{rgb("intensity", 300, 300, 300)}'
        f"{number('cutoff_angle', 5)}{number('beam_width', 4.9)}</emitter>"
    )
    return MadeScene(
        "A prism and a screen",
        "A sheet of white light falls through a slit onto a prism of dense flint glass (SF11), and from there as a "
        "spectrum onto a screen.",
        "Dispersion: photons with a wavelength each. Mitsuba's RGB variants don't know it: the reference is "
        "pmviewer's own, with look-ups a tenth as wide as the automatic ones.",
        (-0.25, 1.9, 1.25),
        (0.08, 0.1, -0.64),
        52,
        [
            diffuse("table", 0.5, 0.49, 0.47),
            diffuse("screen", 0.8, 0.8, 0.8),
            diffuse("dark", 0.06, 0.06, 0.07),
            bsdf("dielectric", "glass", f'<string name="glass" value="{GLASS}"/>'),
            BLACK,
        ],
        [
            panel((0, 0, 0), (3.4, 0, 0), (0, 0, -3.4), "table"),
            panel((middle[0], 0.45, middle[2]), across, (0, 0.45, 0), "screen"),
            mesh("prism", "glass", flat=True),
            panel((-0.6, half, z - half - SLIT / 2), (0, 0, half), (0, half, 0), "dark"),
            panel((-0.6, half, z + half + SLIT / 2), (0, 0, half), (0, half, 0), "dark"),
            spot,
            lamp((0.8, 3.2, 1.5), (0.2, 0.0, -0.5), (0.5, 0.5), (8, 8, 8.4)),
        ],
        meshes={"prism": body},
        aspect=(256, 192),
    )
