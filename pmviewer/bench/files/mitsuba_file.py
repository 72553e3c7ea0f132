"""Mitsuba 3 renders a file that somebody wrote: small, to a given depth, and with as little as possible changed.

Runs inside `pmviewer.bench.agree.mitsuba_server`. The file's film gets another size, its integrator is replaced by the
path tracer, and smooth surfaces of files with blends become a little rough (`ROUGH`). A file that Mitsuba refuses then
is tried again with properties that nothing reads ignored, with <lookAt>, as it was written before 0.5, and with 0.6's
<srgb>, texture filters, coefficients of media and shapes without a BSDF by their nearest equivalents. What was changed
beyond that is told.
"""

from __future__ import annotations

import math
import re
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

CHUNK = 16
"""Samples per pixel between two looks at the noise: chunks are the independent pictures that the noise is taken of."""
LEAST_CHUNKS = 8
RR_DEPTH = 8
PROJECTIVE = ("perspective", "thinlens", "orthographic")
FILTERS = {"trilinear": "bilinear", "ewa": "bilinear", "isotropic": "bilinear", "none": "nearest"}
"""Mitsuba 0.6's texture filters in Mitsuba 3."""
ROUGH = {"conductor": "roughconductor", "dielectric": "roughdielectric"}
"""What stands for smooth surfaces in files with a `blendbsdf`: Mitsuba 3.9.1 adds probabilities of smooth lobes to
densities of others there, and shows the blend some percent too dark or too bright."""
NEARLY_SMOOTH = 0.002


def answer(mi: Any, request: dict[str, Any]) -> dict[str, Any]:
    """{"size", "file_size", "means": (n, 3) of chunks of `CHUNK` samples, "adapted": what was changed, "media": whether
    there are some}, or {"error"}.

    `request`: "path", "longest" (pixels of the longer side), "max_depth" and, where there are media, "media_depth"
    (Mitsuba's way of counting), "noise" (relative standard error of the mean that is enough), "cpu" (seconds after
    which it must do).
    """
    import drjit

    # Several of these work side by side. One thread would not do: Mitsuba waits for ever for some textures then.
    drjit.set_thread_count(2)
    try:
        scene, integrator, about = small_scene(mi, request)
    except ValueError as error:
        return {"error": str(error)}
    return {**about, "means": _means(mi, scene, integrator, request)}


def small_scene(mi: Any, request: dict[str, Any]) -> tuple[Any, Any, dict[str, Any]]:
    """The file's scene at another size, the integrator for it, and "size", "file_size", "adapted", "media" as above.
    `request`: "path", "longest", "max_depth", "media_depth". Raises ValueError, in one line."""
    adapted = ""
    try:
        scene, about = _scene(mi, request, lenient=False)
    except (RuntimeError, TypeError, ValueError) as refused:
        try:
            scene, about = _scene(mi, request, lenient=True)
        except (RuntimeError, TypeError, ValueError) as error:
            raise ValueError(_one_line(error)) from None
        adapted = _one_line(refused)
    if about["camera"] not in PROJECTIVE:
        raise ValueError(f"the camera '{about['camera']}' takes no picture to compare")
    # Its path tracer multiplies light samples on masked surfaces by the opacity twice, and leaves out media.
    masked = any(mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null) for shape in scene.shapes() if shape.bsdf())
    media = any(shape.is_medium_transition() for shape in scene.shapes())
    integrator = mi.load_dict(
        {
            # Where extinction has a colour, "volpath" has fireflies that no noise of chunks tells of.
            "type": "volpathmis" if media else "volpath" if masked else "path",
            "max_depth": request["media_depth" if media else "max_depth"],
            "rr_depth": RR_DEPTH,
            "hide_emitters": about["hidden"],
        }
    )
    return scene, integrator, {**about, "adapted": adapted, "media": media}


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:400]


def _means(mi: Any, scene: Any, integrator: Any, request: dict[str, Any]) -> list[list[float]]:
    means: list[list[float]] = []
    started = time.process_time()
    while True:
        image = np.array(mi.render(scene, integrator=integrator, spp=CHUNK, seed=len(means) + 1), np.float64)
        means.append([float(v) for v in image[..., :3].mean(axis=(0, 1))])
        if len(means) < 2:
            continue
        spent = time.process_time() - started
        if spent > request["cpu"] or (len(means) >= LEAST_CHUNKS and noise(np.array(means)) < request["noise"]):
            return means


def noise(means: Any) -> float:
    """Largest relative standard error of the channels' means, (n, 3), of channels that say something."""
    mean = means.mean(axis=0)
    said = mean > 0.01 * mean.max()
    if not said.any() or not np.isfinite(mean).all():
        return 0.0
    return float((means.std(axis=0, ddof=1)[said] / math.sqrt(len(means)) / mean[said]).max())


def _scene(mi: Any, request: dict[str, Any], lenient: bool) -> tuple[Any, dict[str, Any]]:
    path = Path(request["path"])
    known = mi.file_resolver()
    mine = mi.FileResolver(known)
    mine.prepend(str(path.parent))
    mi.set_file_resolver(mine)
    try:
        config = mi.parser.ParserConfig(mi.variant())
        config.parallel = False
        if lenient:
            config.unused_properties = config.unused_parameters = mi.LogLevel.Debug
        state = _parsed(mi, config, path, lenient)
        about = _adapt(mi, state, request["longest"], lenient)
        mi.parser.transform_all(config, state)
        made = mi.parser.instantiate(config, state)
        scene = made[0] if isinstance(made, list) else made
        if not scene.sensors():
            raise RuntimeError("the file has no camera")
        return scene, about
    finally:
        mi.set_file_resolver(known)


def _parsed(mi: Any, config: Any, path: Path, lenient: bool) -> Any:
    if not lenient:
        return mi.parser.parse_file(config, str(path))
    state = mi.parser.parse_string(config, as_of_3(path.read_text("utf-8-sig", errors="replace")))
    mi.parser.transform_upgrade(config, state)
    return state


def as_of_3(text: str) -> str:
    """A scene file's text with elements of older versions as Mitsuba 3 has them."""
    text = re.sub(r"<(/?)lookAt\b", r"<\1lookat", text)
    return _unseen_boundaries(re.sub(r'<srgb\b([^>]*?)value="([^"#]*)"', _linear, text))


def _unseen_boundaries(text: str) -> str:
    """Shapes that bound a medium and have no BSDF let light pass before version 2; in Mitsuba 3 they are diffuse."""
    try:
        root = ElementTree.fromstring(text.encode())
    except ElementTree.ParseError:
        return text
    if int(root.get("version", "3").split(".")[0]) >= 2:
        return text
    bsdfs = {node.get("id") for node in root.iter("bsdf")}
    bounds = [
        shape for shape in root.iter("shape") if any(node.get("name") in ("interior", "exterior") for node in shape)
    ]
    for shape in bounds:
        if not any(node.tag == "bsdf" or (node.tag == "ref" and node.get("id") in bsdfs) for node in shape):
            ElementTree.SubElement(shape, "bsdf", {"type": "null"})
    return ElementTree.tostring(root, "unicode") if bounds else text


def _linear(found: re.Match[str]) -> str:
    """<rgb> of three numbers, or one, that an <srgb> has encoded: not by the reader of files that is compared."""
    encoded = np.array([float(number) for number in found[2].replace(",", " ").split()])
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return f'<rgb{found[1]}value="{" ".join(f"{c:.8g}" for c in linear)}"'


def _adapt(mi: Any, state: Any, longest: int, lenient: bool) -> dict[str, Any]:
    """Change the parsed file; what kind of camera it has, its size, and whether its integrator hides emitters."""
    about: dict[str, Any] = {"camera": "", "size": [longest, longest], "file_size": None, "hidden": False}
    blends = any(node.props.plugin_name() == "blendbsdf" for node in state.nodes)
    for node in state.nodes:
        props = node.props
        if blends and props.plugin_name() in ROUGH:
            props.set_plugin_name(ROUGH[props.plugin_name()])
            props["distribution"], props["alpha"] = "ggx", NEARLY_SMOOTH
        if node.type == mi.ObjectType.Sensor and not about["camera"]:
            about["camera"] = props.plugin_name()
        elif node.type == mi.ObjectType.Film:
            about |= _resized(mi, node, longest)
        elif node.type == mi.ObjectType.Integrator:
            hidden = next((props[k] for k in ("hide_emitters", "hideEmitters") if k in props), False)
            about["hidden"] = about["hidden"] or bool(hidden)
            node.props = mi.Properties("path")
        elif node.type == mi.ObjectType.Sampler:
            node.props = mi.Properties("independent")
        elif lenient and props.plugin_name() == "homogeneous" and {"sigma_a", "sigma_s"} <= set(props.keys()):
            by_extinction(mi, props)
        elif lenient and node.type == mi.ObjectType.Texture:
            for key in ("filter_type", "filterType"):
                if key in props and props[key] in FILTERS:
                    props[key] = FILTERS[props[key]]
    return about


def by_extinction(mi: Any, props: Any) -> None:
    """A medium's coefficients as Mitsuba 3 knows them, where 0.6 has absorption and scattering, all of one kind."""

    def colour(value: Any) -> NDArray[np.float64]:
        return np.array(value.values if hasattr(value, "wavelengths") else value, float) * np.ones(3)

    absorbed, scattered = (colour(props[name]) for name in ("sigma_a", "sigma_s"))
    extinction = absorbed + scattered
    for name in ("sigma_a", "sigma_s"):
        del props[name]
    densest = max(float(extinction.max()), 1e-30)
    props["scale"] = densest * (float(props["scale"]) if "scale" in props else 1.0)
    props["sigma_t"] = mi.ScalarColor3f(extinction / densest)  # colours of more than 1 are refused
    props["albedo"] = mi.ScalarColor3f(np.divide(scattered, extinction, out=np.zeros(3), where=extinction > 0))


def _resized(mi: Any, node: Any, longest: int) -> dict[str, Any]:
    """A film of that many pixels for the same picture, which may be a piece of a larger one."""

    def number(default: int, *names: str) -> int:
        return next((int(node.props[name]) for name in names if name in node.props), default)

    whole = number(768, "width"), number(576, "height")
    left, top = number(0, "crop_offset_x", "cropOffsetX"), number(0, "crop_offset_y", "cropOffsetY")
    width = number(whole[0] - left, "crop_width", "cropWidth")
    height = number(whole[1] - top, "crop_height", "cropHeight")
    size = small_size(width, height, longest)
    film = mi.Properties("hdrfilm")
    if (width, height) == whole:
        film["width"], film["height"] = size
    else:
        film["width"], film["height"] = round(whole[0] * size[0] / width), round(whole[1] * size[1] / height)
        film["crop_offset_x"], film["crop_offset_y"] = round(left * size[0] / width), round(top * size[1] / height)
        film["crop_width"], film["crop_height"] = size
    for name in list(node.props.keys()):
        if node.props.type(name) == mi.Properties.Type.ResolvedReference:  # the filter
            film[name] = node.props[name]
    node.props = film
    return {"size": list(size), "file_size": [width, height]}


def small_size(width: int, height: int, longest: int) -> tuple[int, int]:
    """The size nearest in proportion to (width, height) among those whose longer side has 2/3 of `longest` to
    `longest` pixels: the picture's edges are then where the file has them."""
    small, large = sorted((max(width, 1), max(height, 1)))

    def off(side: int) -> float:
        other = side * small / large
        return abs(max(round(other), 1) - other) / other

    side = min(range(longest, 2 * longest // 3, -1), key=lambda s: (round(off(s), 6), -s))
    other = max(round(side * small / large), 1)
    return (side, other) if width >= height else (other, side)
