"""A whole small picture, with numba's compiler and without it.

Nothing in the scene is parallel to an axis: zeros of either sign would turn tangents round, and compiled code does not
tell them apart.
"""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

SCENE = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="45"/><transform name="to_world">
<lookat origin="0.3, 3.1, -7.2" target="0.1, 0.9, 0.2" up="0.1, 1, 0.03"/></transform></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate x="1" angle="-83"/>
<rotate z="1" angle="4"/></transform>
<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.5, 0.3"/></bsdf></bsdf></shape>
<shape type="rectangle"><transform name="to_world"><scale value="4"/><rotate y="1" angle="171"/>
<translate x="0.2" y="2" z="2.7"/></transform>
<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.2, 0.6, 0.7"/></bsdf></bsdf></shape>
<shape type="sphere"><point name="center" x="-1.1" y="1.1" z="0.13"/><float name="radius" value="0.8"/>
<bsdf type="conductor"/></shape>
<shape type="sphere"><point name="center" x="1.15" y="1.2" z="-0.4"/><float name="radius" value="0.7"/>
<bsdf type="dielectric"/></shape>
<shape type="rectangle"><transform name="to_world"><scale value="0.9"/><rotate x="1" angle="83"/>
<rotate z="1" angle="9"/><translate x="0.4" y="4.3" z="-0.3"/></transform>
<emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape></scene>"""

PROGRAM = """
import sys
import numpy as np
from pmviewer.engine.store import StageStore
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.settings.access import Settings, with_values

path, out, *pairs = sys.argv[1:]
values = {"camera.width": 10, "camera.height": 10, "photons.N": 200, "estimate.radius": 0.1, "gather.rays": 2,
          "render.max_depth": 3, "photons.max_bounces": 3, **dict(pair.split("=") for pair in pairs)}
pool = WorkPool(1)
renderer = Renderer(open_scene(path), with_values(Settings(), values), pool, StageStore(0))
renderer.step()
np.save(out, renderer.film.planes())
pool.close()
"""


def picture(tmp_path, disabled: str, settings: tuple[str, ...]) -> np.ndarray:
    scene, out = tmp_path / "scene.xml", tmp_path / f"{disabled}.npy"
    scene.write_text(SCENE)
    environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM, str(scene), str(out), *settings]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    return np.load(out)


@pytest.mark.parametrize(
    "settings",
    [
        ("render.method=progressive",),
        ("render.method=gather",),
        ("render.method=path",),
        ("render.method=progressive", "estimate.lookup=nearest", "estimate.k=5"),
    ],
)
def test_the_same_picture(tmp_path, settings):
    compiled, interpreted = picture(tmp_path, "0", settings), picture(tmp_path, "1", settings)
    assert interpreted.shape == compiled.shape
    assert np.isfinite(interpreted).all()
    assert compiled[..., :15].mean() > 0.01
    difference = np.abs(interpreted - compiled).max(axis=-1)
    # Rounding may send a path past an edge that it met.
    assert (difference <= 1e-4 * np.abs(compiled).max()).mean() >= 0.97
