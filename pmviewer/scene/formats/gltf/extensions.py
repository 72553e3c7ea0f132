"""Which extensions of glTF are honoured; the others are named once, with what that does to the picture."""

from __future__ import annotations

from pmviewer.scene.formats.gltf.document import Document

HONOURED = frozenset(
    {
        "EXT_lights_image_based",
        "EXT_mesh_gpu_instancing",
        "EXT_meshopt_compression",
        "EXT_texture_avif",
        "EXT_texture_webp",
        "KHR_draco_mesh_compression",
        "KHR_lights_punctual",
        "KHR_materials_anisotropy",
        "KHR_materials_clearcoat",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_dispersion",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_sheen",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_unlit",
        "KHR_materials_variants",
        "KHR_materials_volume",
        "KHR_mesh_quantization",
        "KHR_meshopt_compression",
        "KHR_node_visibility",
        "KHR_texture_basisu",
        "KHR_texture_transform",
        "MSFT_texture_dds",
    }
)
"""Read as far as the program's surfaces and lights go; what is beyond them gets a warning where it occurs."""

INVISIBLE = frozenset(
    {
        "ADOBE_materials_thin_transparency",  # written beside KHR_materials_transmission
        "CESIUM_primitive_outline",
        "EXT_instance_features",
        "EXT_mesh_features",
        "EXT_mesh_manifold",
        "EXT_structural_metadata",
        "FB_ngon_encoding",
        "GODOT_single_root",
        "KHR_audio_emitter",
        "KHR_interactivity",
        "KHR_node_hoverability",
        "KHR_node_selectability",
        "KHR_physics_rigid_bodies",
        "KHR_implicit_shapes",
        "KHR_xmp",
        "KHR_xmp_json_ld",
        "MSFT_lod",
        "MSFT_packing_normalRoughnessMetallic",
        "MSFT_packing_occlusionRoughnessMetallic",
    }
)
"""Of no consequence for a picture of the whole: metadata, behaviour, other forms of what is there anyway."""

_EFFECTS = {
    "KHR_animation_pointer": "what it animates stands as the file says without it",
    "KHR_materials_iridescence": "thin films do not shimmer in colours",
    "KHR_materials_volume_scatter": "light is not scattered inside of bodies",
    "KHR_gaussian_splatting": "splats are left out",
    "KHR_spz_gaussian_splats_compression": "splats are left out",
    "KHR_techniques_webgl": "surfaces with shaders of their own are grey or white",
}


def warn_of_others(document: Document) -> None:
    """One warning for each extension that the file uses and that is not honoured, whether it is required or not."""
    used: list[str] = []
    for key in ("extensionsUsed", "extensionsRequired"):
        found = document.header.get(key)
        used += [str(name)[:80] for name in found] if isinstance(found, list) else []
    for name in dict.fromkeys(used):
        if name not in HONOURED and name not in INVISIBLE:
            effect = _EFFECTS.get(name, "what it stands for is not shown")
            document.warn(f"The file's extension {name} is not supported: {effect}.")
