"""The watchdog: a process that hangs, computes for ever, grows or dies is ended, and the next request is answered."""

import mmap
import os
import signal
import subprocess
import sys
import threading
from dataclasses import replace

import pytest

from pmviewer.bench.guarded import Ended, Guarded, Limits, forget_peak, resident_bytes

LIMITS = Limits(cpu=1.0, idle=1.0, wall=120.0, memory=400 << 20)
linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells CPU time and memory")


@pytest.fixture
def server():
    with Guarded("tests.bench.odd_server") as running:
        yield running


def test_answers_come_from_one_process(server):
    first = server.ask({"do": "answer", "say": "ä\n1"}, LIMITS)
    assert first["said"] == "ä\n1"
    assert server.ask({"do": "answer"}, LIMITS)["pid"] == first["pid"]


@linux
@pytest.mark.parametrize(
    ("do", "kind", "said"),
    [
        ("wait", "time", "no work for 1 s"),
        ("compute", "cpu", "1 s of CPU time"),
        ("grow", "memory", "more than 400 MiB"),
        ("die", "died", "status 3: what a pity"),
    ],
)
def test_a_process_without_an_answer_is_ended_and_started_again(server, do, kind, said):
    limits = replace(LIMITS, cpu=1.0 if kind == "cpu" else 60.0)
    before = server.ask({"do": "answer"}, LIMITS)["pid"]
    with pytest.raises(Ended, match=said) as ended:
        server.ask({"do": do}, limits)
    assert ended.value.kind == kind
    assert server.ask({"do": "answer"}, LIMITS)["pid"] != before


@linux
@pytest.mark.parametrize("do", ["wait", "die"])
def test_an_error_that_is_kept_keeps_no_pipe_open(server, do):
    before = len(os.listdir("/proc/self/fd"))
    with pytest.raises(Ended) as kept:
        server.ask({"do": do}, LIMITS)
    assert len(os.listdir("/proc/self/fd")) == before
    assert kept.traceback


@linux
def test_a_process_that_holds_too_much_is_replaced_between_requests(server):
    server.renew(0)
    before = server.ask({"do": "answer"}, LIMITS)["pid"]
    server.renew(LIMITS.memory)
    assert server.ask({"do": "answer"}, LIMITS)["pid"] == before
    server.renew(1 << 20)
    assert server.ask({"do": "answer"}, LIMITS)["pid"] != before


@linux
def test_a_process_that_somebody_stops_does_not_hang(server):
    pid = server.ask({"do": "answer"}, LIMITS)["pid"]
    os.kill(pid, signal.SIGSTOP)
    going_on = threading.Timer(2 * LIMITS.idle, os.kill, (pid, signal.SIGCONT))
    going_on.start()
    assert server.ask({"do": "answer"}, LIMITS)["pid"] == pid
    going_on.join()


def test_the_clock_ends_what_the_system_does_not_watch(server, monkeypatch):
    monkeypatch.setattr("pmviewer.bench.guarded.works", lambda pid: True)
    monkeypatch.setattr("pmviewer.bench.guarded.cpu_seconds", lambda pid: 0.0)
    with pytest.raises(Ended, match=r"after 0\.5 s"):
        server.ask({"do": "wait"}, Limits(wall=0.5))


def test_a_process_ends_with_the_one_that_asks_it():
    """Even while it does what would never end."""
    command = [sys.executable, "-m", "tests.bench.odd_server"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write('{"do": "answer"}\n')
        process.stdin.flush()
        assert process.stdout.readline()
        process.stdin.write('{"do": "wait"}\n')
        process.stdin.close()
        assert process.wait(60) == 0


@linux
def test_the_peak_of_memory_counts_from_where_it_was_forgotten():
    size = 64 << 20
    forget_peak()
    before = resident_bytes()
    # Mapped, not allocated: an allocator may have memory left that already counts.
    with mmap.mmap(-1, size) as held:
        held.write(b"x" * size)
        if resident_bytes() - before < size // 2:
            pytest.skip("this system does not count memory as it is touched")
        assert resident_bytes(peak=True) - before >= size // 2
    forget_peak()
    if resident_bytes(peak=True) - resident_bytes() > size // 2:
        pytest.skip("this system does not forget the peak")
    assert resident_bytes(peak=True) - before < size // 2
