"""Passes on real worker processes: the picture of one process, whatever becomes of the workers."""

from __future__ import annotations

import os
import shutil
import signal
import sys
import threading
from dataclasses import replace

import dask
import numpy as np
import pytest
from distributed.utils import get_mp_context

from pmviewer.bench.measures.cluster import until, workers
from pmviewer.engine.cluster import cluster as module
from pmviewer.engine.cluster.cluster import Cluster
from pmviewer.engine.cluster.passes import Elsewhere
from pmviewer.engine.cluster.shared_memory import Segment
from pmviewer.engine.opened import open_scene
from pmviewer.engine.pool import WorkPool
from pmviewer.engine.renderer import Renderer
from pmviewer.engine.session import Session
from pmviewer.engine.store import StageStore
from pmviewer.errors import ClusterError, SettingError
from pmviewer.progress import Cancelled
from pmviewer.resources import data_folder
from pmviewer.settings.access import Settings, with_values

pytestmark = pytest.mark.slow

SMALL = {"camera.width": 20, "camera.height": 16, "photons.N": 3000, "gather.rays": 4, "render.passes": 6}


@pytest.fixture(scope="module")
def borrowed():
    """Two workers of one thread each: Dask's cluster, and ours. They are forked from a process that has imported what
    they need, which otherwise takes most of their time; how one starts on its own is seen where a command does it."""
    forked = {"distributed.worker.multiprocessing-method": "forkserver" if sys.platform == "linux" else "spawn"}
    with dask.config.set(forked):
        if sys.platform == "linux":
            get_mp_context().set_forkserver_preload(["distributed", "pmviewer.engine.cluster.worker"])
        with workers(2) as both:
            yield both


def renderer(scene="cornell_caustic", **values):
    return Renderer(open_scene(scene), with_values(Settings(), {**SMALL, **values}), WorkPool(1), StageStore(0))


def rendered(cluster, made, between=lambda index: None):
    elsewhere = Elsewhere(cluster, made)
    try:
        while not made.finished:
            between(made.passes)
            elsewhere.step()
    finally:
        elsewhere.close()
    return made


def alone(**values):
    made = renderer(**values)
    while not made.finished:
        made.step()
    return made


@pytest.mark.parametrize(
    "values",
    [{}, {"render.filter": "Mitchell-Netravali", "region.on": True, "region.right": 0.5}],
    ids=["as it comes", "region, signed filter"],
)
def test_the_picture_is_that_of_one_process(borrowed, values, monkeypatch):
    seen, whole = [], Segment.increment
    monkeypatch.setattr(Segment, "increment", lambda segment, written: seen.append(written) or whole(segment, written))
    one, many = alone(**values), rendered(borrowed[1], renderer(**values))
    near = (1 if values else many.passes) if sys.platform == "linux" else 0
    assert len(seen) == near, "whole films come through memory that both see; the first pass of a region is one"
    np.testing.assert_array_equal(many.film.sums, one.film.sums)
    np.testing.assert_array_equal(many.frame(0).planes, one.frame(0).planes)
    assert many.error.latest == one.error.latest
    assert many.tally.rays == one.tally.rays
    shares = many.frame(0).statistics.workers
    assert shares.keys() <= borrowed[1].members.here.keys()
    assert sum(passes for _, passes in shares.values()) == many.passes


def test_the_scene_is_read_here_alone(borrowed, tmp_path):
    shutil.copytree(data_folder("scenes") / "cornell_diffuse", tmp_path / "scene")
    made = renderer(scene=str(tmp_path / "scene" / "scene.xml"))
    shutil.rmtree(tmp_path / "scene")
    np.testing.assert_array_equal(rendered(borrowed[1], made).film.sums, alone(scene="cornell_diffuse").film.sums)


def test_a_killed_worker_costs_its_pass(borrowed):
    local, cluster = borrowed

    def kill(index):
        if index == 2:
            os.kill(pid, signal.SIGKILL)

    pid = next(iter(local.workers.values())).pid
    many = rendered(cluster, renderer(), kill)
    np.testing.assert_array_equal(many.film.sums, alone().film.sums)
    # Dask starts another.
    until(lambda: not {pid, None} & {nanny.pid for nanny in local.workers.values()} and len(cluster.members.ready) == 2)


def test_a_frozen_worker_holds_nobody_up(borrowed):
    local, cluster = borrowed
    pid = next(iter(local.workers.values())).pid

    def freeze(index):
        if index == 1:
            os.kill(pid, signal.SIGSTOP)

    try:
        many = rendered(cluster, renderer(), freeze)
    finally:
        os.kill(pid, signal.SIGCONT)
    np.testing.assert_array_equal(many.film.sums, alone().film.sums)
    until(lambda: len(cluster.members.ready) == 2)


def test_a_wait_ends_when_nobody_wants_the_pass(borrowed):
    made = renderer(**{"photons.N": 5_000_000})
    elsewhere = Elsewhere(borrowed[1], made)
    threading.Timer(0.2, made.pool.cancel.set).start()
    with pytest.raises(Cancelled):
        elsewhere.step()
    elsewhere.close()
    made.pool.cancel.clear()
    np.testing.assert_array_equal(rendered(borrowed[1], renderer()).film.sums, alone().film.sums)


def test_workers_of_another_version_are_refused_with_both(borrowed, monkeypatch):
    mine = module.program()
    monkeypatch.setattr(module, "program", lambda: {**mine, "numba": "9.9"})
    other = Cluster(borrowed[0].scheduler_address)
    try:
        with pytest.raises(ClusterError, match=f"numba {mine['numba']} there, 9.9 here"):
            other.wait_for_workers(lambda text: None)
    finally:
        other.close()


def test_nobody_answers():
    with pytest.raises(ClusterError, match=r"No Dask scheduler answers at tcp://127\.0\.0\.1:9 "):
        Cluster("tcp://127.0.0.1:9")


def test_a_cluster_is_borrowed_and_given_back_in_an_open_session(borrowed):
    expected, session = alone().frame(0).planes, Session(1, with_values(Settings(), SMALL))

    def some_come_from_workers():
        """On a busy machine they are not heard at once, and passes are rendered here."""
        session.restart()
        assert session.wait(timeout=100)
        return session.frame.statistics.workers

    try:
        with pytest.raises(SettingError, match="is no cluster"):
            session.workers.borrow("somewhere")
        assert session.workers.where is None
        session.workers.borrow(borrowed[0].scheduler_address)
        until(lambda: session.workers._cluster is not None and session.workers._cluster.members.ready)
        session.open("cornell_caustic")
        assert session.wait(timeout=100)
        until(some_come_from_workers)
        np.testing.assert_array_equal(session.frame.planes, expected)
        session.workers.borrow(None)
        said = []
        until(lambda: said.extend(session.take_messages()) or any("given back" in message.text for message in said))
        session.restart()
        assert session.wait(timeout=100)
        assert not session.frame.statistics.workers
        np.testing.assert_array_equal(session.frame.planes, expected)
        session.workers.borrow("tcp://127.0.0.1:9")
        assert session.workers.where == "tcp://127.0.0.1:9"
        until(lambda: said.extend(session.take_messages()) or session.workers.where is None)
        said.extend(session.take_messages())
        assert any("No Dask scheduler" in message.text for message in said)
    finally:
        session.close()


@pytest.mark.extensive
def test_the_window_borrows_workers_and_goes_on_without_them(monkeypatch):
    """The session: the same picture, photons of passes from elsewhere when they are looked at, and when the scheduler
    has gone a sentence, and the picture goes on."""
    monkeypatch.setattr(module, "CONNECT", 2.0)
    shown = with_values(Settings(), SMALL)
    with workers(1) as (local, _):
        session = Session(1, shown, cluster=local.scheduler_address)
        try:
            until(lambda: session.workers._cluster is not None and session.workers._cluster.members.ready)
            session.open("cornell_caustic")
            assert session.wait(timeout=100)
            frame = session.frame
            np.testing.assert_array_equal(frame.planes, alone().frame(0).planes)
            # Where the machine is busy a heartbeat may come late, and a pass is rendered here meanwhile.
            assert sum(passes for _, passes in frame.statistics.workers.values()) in range(1, 7)
            assert all(message.level != "error" for message in session.take_messages())
            assert not frame.clouds
            session.set(with_values(shown, {"overlays.global.show": True}))
            until(lambda: session.frame.clouds)
            assert len(session.frame.clouds["global"].photons) == frame.statistics.stored_in_pass["global"]
            assert session.frame.statistics == replace(frame.statistics)
            local.scheduler.loop.add_callback(local.scheduler.close)
            session.set(with_values(shown, {"render.seed": 1}))
            assert session.wait(timeout=100)
            np.testing.assert_array_equal(session.frame.planes, alone(**{"render.seed": 1}).frame(0).planes)
            gone = session.workers._cluster
            until(lambda: gone.lost)
            session.restart()
            until(lambda: session.workers._cluster is None)
            said = [message.text for message in session.take_messages()]
            assert any("has gone" in text and "rendered here" in text for text in said)
            assert session.workers.where is None
        finally:
            session.close()
