"""What a scene needs: looked at once, so that stages nobody needs neither run nor compile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from pmviewer.scene.arrays.material_lobes import (
    always_followed,
    glossy_roughness,
    has_diffuse_lobe,
    is_delta,
    is_rough_glass,
)
from pmviewer.scene.arrays.material_row import is_rich, used_materials
from pmviewer.scene.arrays.media import has_media, media_emitting
from pmviewer.scene.description import (
    Camera,
    DirectionalLight,
    Environment,
    Material,
    PixelFilter,
    PointLight,
    ProjectorLight,
    Scene,
    SpotLight,
)


@dataclass(frozen=True)
class SceneTraits:
    """`has_specular`: a smooth or transparent surface that can make caustics; `has_diffuse`: a surface that photons can
    be stored on whatever the settings; `many_lights`: more than one light to choose from; `rich`: materials beyond
    diffuse, mirrors that reflect the same at all angles, and clear smooth glass; `has_delta`: a smooth mirror, glass or
    coat; `has_rough_glass`; `has_delta_lights`: point, spot or directional lights or projectors, which no ray can meet;
    `orthographic`: the scene's own camera; `lenses`: the names, as `camera.name` takes them, of cameras with a lens;
    `filters`: the reconstruction filters of cameras whose film has one, by the same names.

    `thin_glass`: rules of the panes that light may pass straight (`Material.thin_rule`), ascending;
    `has_other_specular`: `has_specular` without these.

    `glossy_roughness`: the roughness of every glossy reflection, ascending; those below the setting `glossy` are
    followed like mirrors, the others store photons.
    """

    has_specular: bool
    has_diffuse: bool
    has_environment: bool
    has_smooth_normals: bool
    n_lights: int
    rich: bool = False
    glossy_roughness: tuple[float, ...] = ()
    has_delta: bool = False
    has_rough_glass: bool = False
    has_delta_lights: bool = False
    orthographic: bool = False
    lenses: frozenset[str] = frozenset()
    filters: tuple[tuple[str, PixelFilter], ...] = ()
    hiding: frozenset[str] = frozenset()
    """The names of cameras that do not see lights, as `camera.name` takes them."""
    thin_glass: tuple[str, ...] = ()
    has_other_specular: bool = False
    has_media: bool = False
    """Participating media."""
    media_emit: bool = False
    """Do some of them emit light?"""
    has_scattering: bool = False
    """Media that scatter light."""
    straightest: float = 0.0
    """The largest |g| of their phase functions."""
    has_dispersion: bool = False
    """Glass that splits light into colours."""
    has_findable_lights: bool = True
    """Lights that rays can meet."""
    has_smooth_glass: bool = False
    """Surfaces that reflect and refract as deltas."""
    aims: bool = False
    """Something is so small on a wide stage that photons aim at it (`pmviewer.photons.projection.aim`). `analyse`
    doesn't tell, `pmviewer.engine.opened` does."""

    @property
    def lit_media(self) -> bool:
        """Whether media send light along rays: they scatter or emit it. Others only tint what passes."""
        return self.has_scattering or self.media_emit

    @property
    def many_lights(self) -> bool:
        """Whether direct light has a choice of lights to make."""
        return self.n_lights > 1

    def follows(self, glossy: float) -> bool:
        """Are lobes followed, so that there may be caustics, when roughness from `glossy` on is stored?"""
        return self.has_specular or any(alpha < glossy for alpha in self.glossy_roughness)

    def follows_beside_thin(self, glossy: float) -> bool:
        """The same without the panes that light may pass straight."""
        return self.has_other_specular or any(alpha < glossy for alpha in self.glossy_roughness)

    def stores(self, glossy: float) -> bool:
        """Are photons stored for any lobe, when roughness from `glossy` on is stored?"""
        return self.has_diffuse or any(alpha >= glossy for alpha in self.glossy_roughness)

    def unfound(self, glossy: float) -> bool:
        """Is there light on followed lobes that no path from the eye finds: from lights that no ray can meet, over
        smooth mirrors or glass alone, on a lobe that is followed but not smooth?"""
        return self.has_delta_lights and self.has_delta and self.follows_rough(glossy)

    def follows_rough(self, glossy: float) -> bool:
        """Are lobes followed that are not smooth, when roughness from `glossy` on is stored?"""
        return self.has_rough_glass or any(alpha < glossy for alpha in self.glossy_roughness)


def thin_panes(scene: Scene) -> list[Material]:
    """Materials of shapes that light may pass straight; a part of a blend never lets it."""
    shown = sorted({s.material for s in scene.all_shapes if s.material < len(scene.materials)})
    return [m for m in (scene.materials[i] for i in shown) if m.thin_rule != "exact"]


def analyse(scene: Scene) -> SceneTraits:
    """Traits of what is actually used by the scene's shapes."""
    used = [m for m in used_materials(scene) if m.kind != "blend"]  # what blends do, their parts do
    panes = thin_panes(scene)
    return SceneTraits(
        has_specular=any(always_followed(m) for m in used),
        has_diffuse=any(has_diffuse_lobe(m) for m in used),
        has_environment=any(isinstance(light, Environment) for light in scene.lights),
        has_smooth_normals=any(getattr(s.geometry, "normals", None) is not None for s in scene.all_shapes),
        n_lights=len(scene.lights)
        + sum(s.radiance is not None and max(s.radiance) > 0 for s in scene.shapes)
        + media_emitting(scene),
        rich=is_rich(scene),
        has_delta=any(is_delta(m) for m in used),
        has_rough_glass=any(is_rough_glass(m) for m in used),
        has_smooth_glass=any(m.transparent and is_delta(m) for m in used),
        has_delta_lights=any(
            isinstance(light, PointLight | SpotLight | ProjectorLight | DirectionalLight) for light in scene.lights
        ),
        orthographic=scene.camera.projection == "orthographic",
        lenses=frozenset(name for name, camera in _cameras(scene) if camera.aperture > 0),
        hiding=frozenset(name for name, camera in _cameras(scene) if camera.hides_lights),
        filters=tuple((name, camera.filter) for name, camera in _cameras(scene) if camera.filter is not None),
        thin_glass=tuple(sorted({m.thin_rule for m in panes})),
        has_other_specular=any(always_followed(m) and not any(m is pane for pane in panes) for m in used),
        has_media=has_media(scene),
        media_emit=media_emitting(scene) > 0,
        straightest=max((m.phase.straightest for m in scene.media), default=0.0),
        has_findable_lights=any(isinstance(light, Environment) for light in scene.lights)
        or any(s.radiance is not None and max(s.radiance) > 0 for s in scene.shapes),
        has_scattering=has_media(scene) and any(max(m.albedo) > 0 and max(m.sigma_t) > 0 for m in scene.media),
        has_dispersion=any(m.disperses for m in used),
        glossy_roughness=tuple(sorted({alpha for m in used for alpha in glossy_roughness(m)})),
    )


def _cameras(scene: Scene) -> Iterator[tuple[str, Camera]]:
    """The file's cameras by all names that `camera.name` has for them."""
    yield "auto", scene.camera
    for i, named in enumerate(scene.cameras):
        yield str(i + 1), named.camera
    for named in reversed(scene.cameras):  # of two with one name the first is meant
        yield named.name, named.camera
