"""The scenes that are compared with Mitsuba open without a warning and hold what their names say."""

from __future__ import annotations

from pmviewer.bench.feature_scenes import LIGHTS, MATERIALS, write_scenes
from pmviewer.scene.description import DirectionalLight, ImageEnvironment, PointLight, SpotLight
from pmviewer.scene.load import load_scene

KINDS = {
    "diffuse": "diffuse",
    "conductor, gold": "conductor",
    "roughconductor, anisotropic": "rough conductor",
    "roughdielectric, GGX": "rough dielectric",
    "thindielectric": "thin dielectric",
    "plastic, nonlinear": "plastic",
    "roughplastic, Beckmann": "rough plastic",
}


def test_every_scene_is_understood_in_full(tmp_path):
    files = write_scenes(tmp_path)
    assert len(files) == len(MATERIALS) + len(LIGHTS)
    scenes = {name: load_scene(file) for name, file in files.items()}
    for name, scene in scenes.items():
        assert scene.warnings == (), name
    for name, kind in KINDS.items():
        scene = scenes[f"material: {name}"]
        assert sum(scene.materials[s.material].kind == kind for s in scene.shapes) >= 3, name
    slots = {"bumpmap": "bump", "normalmap": "normal", "bitmap": "reflectance", "roughness texture": "alpha"}
    for name, slot in slots.items():
        assert any(slot in m.textures for m in scenes[f"material: {name}"].materials), name
    kinds = {"point": PointLight, "spot": SpotLight, "directional": DirectionalLight, "envmap": ImageEnvironment}
    for name, kind in kinds.items():
        assert isinstance(scenes[f"light: {name}"].lights[0], kind)
