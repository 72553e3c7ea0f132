"""A glass sphere in fog: the light that it focuses is seen in the air (course guide 2002, figure 2.5)."""

from __future__ import annotations

from make.document import BLACK, MadeScene, boundary, dielectric, diffuse, fog, lamp, panel

SPHERE, RADIUS = (0.1, 1.35, 0.0), 0.6
LAMP = (-1.6, 3.4, 0.3)


def fog_sphere() -> MadeScene:
    """The fog fills everything, the camera stands in it. The lamp is small, so that the cone of light is sharp."""
    center = " ".join(f"{c:g}" for c in SPHERE)
    ball = (
        f'<shape type="sphere"><float name="radius" value="{RADIUS:g}"/><point name="center" value="{center}"/>'
        '<ref id="glass"/><ref name="exterior" id="fog"/></shape>'
    )
    return MadeScene(
        "A glass sphere in fog",
        "A sphere of glass in thin fog, lit by one lamp from above: a shadow with a cone of light in it, both in the "
        "air and on the floor.",
        "A volume caustic, single and multiple scattering: the volume map and its beam estimate against paths.",
        (0.0, 1.3, 4.6),
        (0.0, 1.15, 0.0),
        44,
        [
            diffuse("floor", 0.4, 0.37, 0.33),
            diffuse("wall", 0.05, 0.07, 0.1),
            dielectric("glass", 1.5),
            BLACK,
        ],
        [
            panel((0, 0, 0), (3, 0, 0), (0, 0, -3), "floor"),
            panel((0, 2, -2.2), (3, 0, 0), (0, 2, 0), "wall"),
            boundary((-3.2, -0.2, -2.4), (3.2, 4.2, 5.2), "fog"),
            ball,
            lamp(LAMP, SPHERE, (0.15, 0.15), (420, 390, 330)),
        ],
        aspect=(256, 192),
        max_depth=64,
        media=(fog("fog", 0.14, (0.95, 0.95, 0.95)),),
        around="fog",
    )
