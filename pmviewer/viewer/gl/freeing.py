"""Freeing OpenGL objects on the window's thread.

Whoever makes an object releases it. What is dropped without (by an error in between, say) is found by Python's garbage
collector, which may run on any thread, where OpenGL can't be called: moderngl keeps such objects for us.
"""

from __future__ import annotations

import moderngl


def free_collected(context: moderngl.Context) -> int:
    """Free what the collector has found since the last call; returns how many objects. For the window's thread.

    `moderngl.Context.gc` fails for objects that were released before they were collected.
    """
    count = 0
    while context.objects:
        found = context.objects.popleft()
        if not isinstance(found, moderngl.InvalidObject):
            found.release()
            count += 1
    return count
