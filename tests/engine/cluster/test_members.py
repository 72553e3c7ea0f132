"""Workers as the scheduler tells of them: who comes, goes, is silent, and who is refused."""

from __future__ import annotations

import pytest

from pmviewer.engine.cluster import members as module
from pmviewer.engine.cluster.address import check_address
from pmviewer.engine.cluster.identity import refusal
from pmviewer.engine.cluster.members import Members
from pmviewer.engine.program import PROCESSOR, program
from pmviewer.errors import ClusterError, PmviewerError

MINE = {"pmviewer": "1.0", "numba": "0.62", PROCESSOR: "znver3 avx2"}


def told(**heard):
    return {name: {"name": name, "nthreads": 2, "last_seen": seen} for name, seen in heard.items()}


def test_workers_come_and_go():
    members = Members(MINE)
    assert [m.address for m in members.update(told(a=1.0, b=1.0))] == ["a", "b"]
    assert [m.address for m in members.update(told(b=2.0, c=1.0))] == ["c"]
    assert members.here.keys() == {"b", "c"}
    assert members.ready == [], "nobody renders before versions are known"
    members.judge(members.here["b"], MINE)
    assert [m.address for m in members.ready] == ["b"]
    assert members.messages == []


def test_a_silent_worker_gets_nothing_until_it_is_heard_again(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    members = Members(MINE)
    members.update(told(a=1.0, b=1.0))
    for member in members.here.values():
        member.changed = now[0]
        members.judge(member, MINE)
    now[0] += module.SILENT_AFTER + 1
    members.update(told(a=1.0, b=2.0))
    assert [m.address for m in members.ready] == ["b"]
    members.update(told(a=1.5, b=2.0))
    assert [m.address for m in members.ready] == ["a", "b"]


def test_another_version_is_refused_with_both():
    members = Members(MINE)
    (worker,) = members.update(told(a=1.0))
    members.judge(worker, {**MINE, "numba": "0.61"})
    assert members.refused
    assert "numba 0.61 there, 0.62 here" in members.messages[0]
    assert "pmviewer 1.0" not in members.messages[0], "what is the same is not named"
    (other,) = members.update(told(a=1.0, b=1.0))
    members.judge(other, "there is no pmviewer there")
    assert "no pmviewer there" in members.messages[1]


def test_another_processor_is_said_once():
    members = Members(MINE)
    for worker in members.update(told(a=1.0, b=1.0)):
        members.judge(worker, {**MINE, PROCESSOR: "skylake"})
    assert len(members.ready) == 2
    assert len(members.messages) == 1
    assert "last bits" in members.messages[0]


def test_a_worker_like_this_process_is_right():
    mine = program()
    assert refusal(mine, program()) == ""
    assert "pmviewer's sources 0 there" in refusal(mine, {**mine, "sources": "0"})


@pytest.mark.parametrize("where", ["nowhere", "local:0", "local:257", "local:x", "tcp:host", "http://a"])
def test_what_is_no_address_is_refused(where):
    with pytest.raises(PmviewerError, match="--cluster " + where):
        check_address(where)


def test_a_scheduler_file_that_is_missing_and_tls_without_certificates(tmp_path):
    with pytest.raises(ClusterError, match="no scheduler file"):
        check_address(str(tmp_path / "none.json"))
    with pytest.raises(ClusterError, match="certificates"):
        check_address("tls://127.0.0.1:9")
    check_address("tcp://127.0.0.1:9")
    check_address("local:2")


def test_why_rendering_ends_is_said_once():
    members = Members(MINE)
    for worker in members.update(told(a=1.0, b=1.0)):
        members.judge(worker, f"nothing fits on {worker.address}")
    assert "nothing fits on b" in members.take_refusal()
    assert [said for said in members.messages if "on b" in said] == []
    assert len(members.messages) == 1
