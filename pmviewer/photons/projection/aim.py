"""Which lights' photons may aim at what is small on a wide stage (T7), and by how much more of them do."""

from __future__ import annotations

import numpy as np

from pmviewer.photons.projection.gain import gain_of
from pmviewer.photons.projection.projected import CONES, SCALES, WHOLE
from pmviewer.photons.projection.scales import gain
from pmviewer.photons.projection.small import Small, small_of
from pmviewer.scene.description import DirectionalLight, Environment, PointLight, Scene, Shape

MOST_LIGHTS = 64
"""Of more lights, `auto` makes no maps: they would take longer than they spare."""
LEAST_GAIN = {SCALES: 8.0, CONES: 16.0, WHOLE: np.inf}
"""Times that photons start more densely for what is small than by a map, or it isn't worth what is lacking elsewhere.
Skies, gains of 3 to 7 in three scenes: relMSE after 4 CPU s 0.8 to 1.5 times that without, 1.0 in the mean. Lamps
nearby, 5 to 9 in a prism's yard, three glasses and rings: 1.0 to 1.7 times after 5, of a ship under a dome (355) 0.24.
"""
SMALLEST = 1e-6
"""Least radius of the innermost disc or cone, relative to the scene's: float32 tells directions apart to 6e-8."""


def standing(scene: Scene, radius: float) -> Small | None:
    """What photons may aim at in a scene with that bounding sphere; None where nothing is small."""
    small = small_of(scene, radius)
    return None if small is None else small._replace(radius=max(small.radius, SMALLEST * radius))


def described_lights(scene: Scene) -> list[Shape | object]:
    """Shapes that emit and lights without a surface, in the order of the light table; media that emit come after
    them."""
    return [*(shape for shape in scene.shapes if shape.shines), *scene.lights]


def aim_of(light: object, radius: float, small: Small) -> tuple[int, float]:
    """How a described light's photons start more densely for what is small, and how many times, in a scene with that
    bounding sphere."""
    if isinstance(light, Environment | DirectionalLight):
        return SCALES, gain(small.radius, radius)
    if isinstance(light, PointLight):
        return CONES, gain_of(None, np.array(light.position, float), small)
    if isinstance(light, Shape):
        return CONES, gain_of(light.geometry, None, small)
    return WHOLE, 1.0


def may_aim(scene: Scene, radius: float) -> bool:
    """Whether photons of any light would aim if no map of it spared photons; False where no maps are made."""
    lights = described_lights(scene)
    small = standing(scene, radius) if len(lights) <= MOST_LIGHTS else None
    if small is None:
        return False
    return any(times > LEAST_GAIN[mode] for mode, times in (aim_of(light, radius, small) for light in lights))
