"""Python's collector rests while modules are imported, and leaves alone what stays."""

import subprocess
import sys

import pytest

CODE = """
import gc
from pmviewer.heap import importing

class Node:
    pass

def circle():
    node = Node()
    node.itself = node

assert gc.isenabled()
try:
    with importing(for_long={for_long}):
        assert not gc.isenabled()
        kept = [Node() for _ in range(10_000)]
        {fails}
except ZeroDivisionError:
    pass
print(gc.isenabled(), gc.get_freeze_count() > 10_000)
circle()
print(gc.collect() >= 1)
frozen = gc.get_freeze_count()
with importing(for_long=True):
    more = [Node() for _ in range(10_000)]
print(gc.get_freeze_count() - frozen > 10_000)
"""


@pytest.mark.parametrize("for_long", [False, True])
@pytest.mark.parametrize("fails", [False, True])
def test_it_rests_meanwhile_and_freezes_once(for_long, fails):
    code = CODE.format(for_long=for_long, fails="1 / 0" if fails else "")
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert run.stdout.split() == ["True", str(for_long), "True", str(not for_long)]


def test_it_stays_off_where_it_was_off():
    code = "import gc; from pmviewer.heap import importing; gc.disable()\nwith importing(): pass\nprint(gc.isenabled())"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert run.stdout.split() == ["False"]
