"""The metal ring and the caustic inside it on planes from diffuse to nearly a mirror (Jensen, "Rendering Caustics on
Non-Lambertian Surfaces", figure 1)."""

from __future__ import annotations

from make.document import BLACK, MadeScene, bsdf, cylinder, lamp, mesh, number, rgb
from make.mesh import quad

_ABOUT = {
    1.0: "The diffuse end of the series: the classic cardioid, bright from everywhere.",
    0.5: "Halfway to glossy: the caustic fades where its light leaves away from the camera.",
    0.1: "A glossy plane: only the part of the caustic whose light turns to the camera stays bright.",
    0.01: "Nearly a mirror: what is left of the caustic lies where the plane reflects the ring's light to the camera.",
}


def cardioid(alpha: float) -> MadeScene:
    """A mirror ring of 0.5 m on a plane with Schlick's model; the light stands beyond its edge."""
    chrome = ('<string name="material" value="none"/>', rgb("specular_reflectance", 0.9))
    return MadeScene(
        f"Cardioid on a plane, Schlick's α = {alpha:g}",
        f"A mirror ring on a plane with Schlick's reflection model, factor {alpha:g}, one small light.",
        _ABOUT[alpha],
        (0.22, 1.55, 1.05),
        (0.0, 0.12, -0.06),
        43,
        [
            bsdf("schlick", "plane", rgb("reflectance", 0.75, 0.7, 0.65), number("alpha", alpha), two_sided=True),
            bsdf("conductor", "ring", *chrome, two_sided=True),
            BLACK,
        ],
        [
            mesh("plane", "plane", flat=True),
            cylinder((0, 0, 0), (0, 0.28, 0), 0.5, "ring"),
            lamp((-0.04, 0.7, -0.5), (0.0, 0.0, 0.1), (0.03, 0.03), (330, 305, 260)),
        ],
        {"plane": quad((-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2))},
        aspect=(320, 256),
    )
