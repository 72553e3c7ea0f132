"""What a scene needs: looked at once, so that stages nobody needs neither run nor compile."""

from __future__ import annotations

from dataclasses import dataclass

from pmviewer.scene.description import ConstantEnvironment, Material, Scene


@dataclass(frozen=True)
class SceneTraits:
    """`has_specular`: a mirror or glass that can make caustics; `has_diffuse`: a surface that photons can be stored on;
    `many_lights`: more than one light to choose from."""

    has_specular: bool
    has_diffuse: bool
    has_environment: bool
    has_smooth_normals: bool
    n_lights: int

    @property
    def many_lights(self) -> bool:
        return self.n_lights > 1


def _scatters_specularly(material: Material) -> bool:
    if material.kind == "conductor":
        return max(material.reflectance) > 0
    return material.kind == "dielectric" and max(*material.reflectance, *material.transmittance) > 0


def analyse(scene: Scene) -> SceneTraits:
    """Traits of what is actually used by the scene's shapes."""
    used = [scene.materials[i] for i in {s.material for s in scene.shapes}]
    return SceneTraits(
        has_specular=any(_scatters_specularly(m) for m in used),
        has_diffuse=any(m.kind == "diffuse" and max(m.reflectance) > 0 for m in used),
        has_environment=any(isinstance(light, ConstantEnvironment) for light in scene.lights),
        has_smooth_normals=any(getattr(s.geometry, "normals", None) is not None for s in scene.shapes),
        n_lights=len(scene.lights) + sum(s.radiance is not None and max(s.radiance) > 0 for s in scene.shapes),
    )
