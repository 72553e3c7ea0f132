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

path, out, *chosen = sys.argv[1:]
pool, pictures = WorkPool(1), []
for pairs in chosen:
    values = {"camera.width": 10, "camera.height": 10, "photons.N": 200, "estimate.radius": 0.1, "gather.rays": 2,
              "render.max_depth": 3, "photons.max_bounces": 3, **dict(pair.split("=") for pair in pairs.split())}
    renderer = Renderer(open_scene(path), with_values(Settings(), values), pool, StageStore(0))
    renderer.step()
    pictures.append(renderer.film.planes())
np.save(out, np.array(pictures))
pool.close()
"""


SETTINGS = (
    "render.method=progressive",
    "render.method=gather",
    "render.method=path",
    "render.method=progressive estimate.lookup=nearest estimate.k=5",
)


def pictures(tmp_path, disabled: str) -> np.ndarray:
    """All settings' in one process, which takes longer to start than to make them."""
    scene, out = tmp_path / "scene.xml", tmp_path / f"{disabled}.npy"
    scene.write_text(SCENE)
    environment = {**os.environ, "NUMBA_DISABLE_JIT": disabled, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM, str(scene), str(out), *SETTINGS]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    return np.load(out)


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    return pictures(folder, "0"), pictures(folder, "1")


@pytest.mark.extensive
@pytest.mark.parametrize("index", range(len(SETTINGS)), ids=SETTINGS)
def test_the_same_picture(both, index):
    compiled, interpreted = (all_[index] for all_ in both)
    assert interpreted.shape == compiled.shape
    assert np.isfinite(interpreted).all()
    assert compiled[..., :15].mean() > 0.01
    difference = np.abs(interpreted - compiled).max(axis=-1)
    # Rounding may send a path past an edge that it met.
    assert (difference <= 1e-4 * np.abs(compiled).max()).mean() >= 0.97
