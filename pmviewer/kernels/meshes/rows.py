"""Rows of a table in which some columns are lists with their length before them, in bytes or in numbers; and strips of
triangles."""

from __future__ import annotations

import numpy as np

from pmviewer.kernels.compile.jit import device, kernel
from pmviewer.kernels.meshes.text import SPACE, next_line, number, skip_blanks


@device
def _count_at(data, at, size, signed, big):
    """The integer of `size` bytes at a place."""
    value = np.int64(0)
    for k in range(size):
        value = (value << 8) | np.int64(data[at + k] if big else data[at + size - 1 - k])
    if signed and value >= np.int64(1) << (8 * size - 1):
        value -= np.int64(1) << (8 * size)
    return value


@kernel
def walk_bytes(data, at, sizes, count_sizes, count_signed, big, places, lengths):
    """Fill places and lengths (n, columns) int64: where each row's columns begin, in bytes, and how many items they
    hold; a column with a count_size of 0 is no list. Returns the place behind the last row, −1 where the data end
    before, −2 where a length is negative."""
    n, columns = places.shape
    for i in range(n):
        for p in range(columns):
            length = np.int64(1)
            if count_sizes[p] > 0:
                if at + count_sizes[p] > len(data):
                    return -1
                length = _count_at(data, at, count_sizes[p], count_signed[p], big)
                at += count_sizes[p]
                if length < 0:
                    return -2
            places[i, p], lengths[i, p] = at, length
            if length > (len(data) - at) // sizes[p]:
                return -1
            at += length * sizes[p]
    return at


@kernel
def walk_numbers(words, at, is_list, places, lengths):
    """The same for numbers in text, `words` (m,) float64; places count words."""
    n, columns = places.shape
    for i in range(n):
        for p in range(columns):
            length = np.int64(1)
            if is_list[p]:
                if at >= len(words):
                    return -1
                count = words[at]
                if not 0 <= count <= len(words):
                    return -2
                length = np.int64(count)
                at += 1
            places[i, p], lengths[i, p] = at, length
            if length > len(words) - at:
                return -1
            at += length
    return at


@kernel
def gather(data, places, lengths, size, out):
    """Copy the items of `size` elements of data at each place into out, one behind the other."""
    at = 0
    for i in range(len(places)):
        for k in range(lengths[i] * size):
            out[at] = data[places[i] + k]
            at += 1


@kernel
def count_words(data, start):
    """How many words there are from `start` on."""
    count, inside = 0, False
    for i in range(start, len(data)):
        blank = data[i] <= SPACE
        count += 1 if inside and blank else 0
        inside = not blank
    return count + (1 if inside else 0)


@kernel
def strips(indices, starts, out):
    """Triangles (T, 3) int32 of strips of vertices, in which a negative number begins a new one; returns T. Every
    second triangle of a strip is turned round."""
    count = 0
    for s in range(len(starts) - 1):
        run = 0
        for i in range(starts[s], starts[s + 1]):
            if indices[i] < 0:
                run = 0
                continue
            run += 1
            if run < 3:
                continue
            a, b, c = indices[i - 2], indices[i - 1], indices[i]
            if run % 2 == 0:
                a, b = b, a
            out[count, 0], out[count, 1], out[count, 2] = a, b, c
            count += 1
    return count


@kernel
def text_facets(data, corners, solids):
    """The triangles of a text STL: corners (3 m, 3) float64 of its `vertex` lines, and `solids` (k, 2) int64: the place
    of each `solid` line and the number of corners before it. Returns the numbers of corners and of solids; arrays of
    length 0 are left alone, so that a first call counts."""
    from_text = len(corners) > 0
    i, n, k = 0, 0, 0
    while i < len(data) - 8:
        i = _skip(data, i)
        if i >= len(data) - 8:
            break
        c = data[i] | 32
        if c == 118 and (data[i + 1] | 32) == 101 and data[i + 6] <= SPACE:  # "ve…"
            if from_text:
                j = i + 6
                for axis in range(3):
                    j = skip_blanks(data, j)
                    corners[n, axis], j = number(data, j)
            n += 1
        elif c == 115 and (data[i + 1] | 32) == 111 and data[i + 5] <= SPACE:  # "so…"
            if from_text:
                solids[k, 0], solids[k, 1] = i, n
            k += 1
        i = next_line(data, i)
    return n, k


@device
def _skip(data, i):
    while i < len(data) - 8 and data[i] <= SPACE:
        i += 1
    return i
