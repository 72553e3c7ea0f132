"""The process that asks Mitsuba. Only where Mitsuba 3 is installed."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from pmviewer.bench import peer
from pmviewer.bench.agree.generate import scene_of
from pmviewer.bench.agree.xml import write_scene

pytestmark = pytest.mark.skipif(not peer.installed(), reason="Mitsuba 3 is not installed")


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="processors can't be taken away here")
def test_mitsuba_reads_a_sky_where_there_is_one_processor(tmp_path):
    """It waited for ever."""
    scenes = (scene_of(1, i) for i in range(200))
    scene = next(s for s in scenes if any(light["type"] == "envmap" for light in s["lights"]))
    _, path = write_scene(scene, tmp_path, "scene")
    assert list(tmp_path.glob("*.exr"))
    request = {
        "path": str(path),
        "mode": "path",
        "seeds": [1],
        "spp": 1,
        "max_depth": 2,
        "out": str(tmp_path / "p.npy"),
    }
    one = {min(os.sched_getaffinity(0))}
    done = subprocess.run(
        [sys.executable, "-m", "pmviewer.bench.agree.mitsuba_server"],
        input=json.dumps(request) + "\n",
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=lambda: os.sched_setaffinity(0, one),
    )
    assert json.loads(done.stdout) == {}
    assert np.load(request["out"]).mean() > 0
