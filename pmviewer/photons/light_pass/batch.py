"""Batches of the light pass: photons of some trajectories traced by one thread, and how batches are joined."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pmviewer.errors import SettingError
from pmviewer.photons.emission.window import MOST_PIECES
from pmviewer.photons.light_pass.ledger import C_CAUSTIC, C_GLOBAL, C_VOLUME, N_COUNTS, empty_ledger
from pmviewer.photons.light_pass.paths import PhotonPaths
from pmviewer.photons.light_pass.roulette import EQUAL, MOST_COPIES
from pmviewer.photons.light_pass.trace import PhotonBuffers, trace_photons
from pmviewer.resources import available_memory
from pmviewer.scene.arrays.flatten import FlatScene
from pmviewer.tasks import Runner, in_turn

Float = NDArray[np.float32]
Codes = NDArray[np.uint32]

BATCH = 8192
"""Photons a task where rules judge whole batches: fixed, so that the number of threads does not change the result."""
TASK = 4096
"""Photons a task where nothing depends on batches: with many threads all would wait for the last of large ones."""
PROBED = 16
"""Batches that tell how much memory all of them need, where they might need more than there is."""
_COPIED = 1 << 15
"""Photons that one task copies at least."""
BYTES_PER_STORED = 60
"""A photon as it arrived, joined to the others, and in its map."""


NO_PHOTONS: Float = np.empty((0, 6), np.float32)
NO_NORMALS, GLOBAL_NORMALS, NORMALS = range(3)
"""Whose surface normals are wanted: nobody's, global photons', all photons'."""


@dataclass(frozen=True, eq=False)
class Batch:
    """What a batch leaves behind: photons (n, 6) of both maps, with their surface normals (n,) or (0,) where these were
    not wanted; counts (N_COUNTS,) and ledgers (2, N_LEDGER) of `pmviewer.photons.light_pass.trace`."""

    caustic: Float
    global_: Float
    counts: NDArray[np.int64]
    ledgers: NDArray[np.float64]
    global_normals: Codes
    caustic_normals: Codes
    volume: Float = field(default_factory=lambda: NO_PHOTONS)
    """Photons (n, 6) in media."""


Task = Callable[[], Batch]
Numbered = tuple[int, Task]
"""A batch with a number that no other batch has in any pass."""


def trace_batch(
    scene: FlatScene,
    record: NDArray[np.void],
    emission: NDArray[np.void],
    i0: int,
    i1: int,
    with_normals: int = NO_NORMALS,
    paths: PhotonPaths | None = None,
) -> Batch:
    """Photons i0 … i1−1, resumed with fresh buffers whenever one is full. record: LIGHT_PASS_DTYPE (1,); emission: the
    records (2,) that say how photons start."""
    where = None if paths is None else paths.arguments
    pass_ = record[0]
    most = int(pass_["max_bounces"])
    if pass_["roulette"] == EQUAL:
        most *= MOST_COPIES
    if "pieces_of" in (emission.dtype.names or ()) and emission["pieces_of"][0] > 0:
        most *= MOST_PIECES
    counts, ledgers = np.zeros(N_COUNTS, np.int64), empty_ledger()
    parts: list[tuple[Float, Float, Codes, Codes, Float]] = []
    while i0 < i1:
        rows = 5 * (i1 - i0) + 2 * most
        out = PhotonBuffers(
            global_out := np.empty((rows if i0 < pass_["global_trajectories"] else most, 6), np.float32),
            caustic_out := np.empty((rows // 2 + most if pass_["caustics"] else most, 6), np.float32),
            np.empty(len(global_out) if with_normals != NO_NORMALS else 0, np.uint32),
            np.empty(len(caustic_out) if with_normals == NORMALS else 0, np.uint32),
            np.zeros(N_COUNTS, np.int64),
            ledgers,
            volume_out := np.empty((rows, 6), np.float32) if scene.has_media else None,
        )
        i0 = trace_photons(scene.record, record, emission, i0, i1, out, where)
        n_caustic, n_global = out.counts[C_CAUSTIC], out.counts[C_GLOBAL]
        parts.append(
            (
                out.caustic_out[:n_caustic].copy(),
                out.global_out[:n_global].copy(),
                out.global_normals[:n_global].copy(),
                out.caustic_normals[:n_caustic].copy(),
                NO_PHOTONS if volume_out is None else volume_out[: out.counts[C_VOLUME]].copy(),
            )
        )
        counts += out.counts
    caustic, global_, global_normals, caustic_normals, volume = zip(*parts) if parts else ((), (), (), (), ())
    normals = joined_codes(global_normals), joined_codes(caustic_normals)
    return Batch(joined(caustic), joined(global_), counts, ledgers, *normals, joined(volume))


def bounded(tasks: list[Task], most: int, run: Runner) -> list[Batch]:
    """The batches, of at most so many photons each. Raises SettingError before they fill the memory."""
    available = available_memory()
    if available is None or len(tasks) <= PROBED or len(tasks) * most * BYTES_PER_STORED < available:
        return run(tasks)
    first = run(tasks[:PROBED])
    stored = sum(len(batch.caustic) + len(batch.global_) for batch in first) * len(tasks) / PROBED
    if stored * BYTES_PER_STORED > available:
        need, free = stored * BYTES_PER_STORED / 1e9, available / 1e9
        raise SettingError(
            f"A pass stores about {stored:,.0f} photons here, which need {need:.1f} GB of memory, and {free:.1f} GB "
            "are free. Lower photons.N, photons.q or photons.max_bounces."
        )
    return first + run(tasks[PROBED:])


def joined(parts: Iterable[Float]) -> Float:
    """Photons (n, 6) of all parts, in order."""
    rows = list(parts)
    return rows[0] if len(rows) == 1 else np.concatenate([np.empty((0, 6), np.float32), *rows])


def joined_codes(parts: Iterable[Codes]) -> Codes:
    """Normals (n,) of all parts, in order."""
    codes = list(parts)
    return codes[0] if len(codes) == 1 else np.concatenate([np.empty(0, np.uint32), *codes])


def joined_batches(batches: Sequence[Batch], run: Runner = in_turn) -> Batch:
    """Batches as one; of many photons each thread copies its share."""
    tasks: list[Callable[[], Any]] = []

    def copied(parts: list[Any], join: Callable[[list[Any]], Any]) -> Any:
        ends = np.cumsum([0, *map(len, parts)]).tolist()
        if len(parts) < 2 or ends[-1] < 2 * _COPIED:
            return join(parts)
        whole = np.empty((ends[-1], *parts[0].shape[1:]), parts[0].dtype)
        begin = 0
        for i in range(1, len(ends)):
            if ends[i] - ends[begin] >= _COPIED or i == len(parts):
                tasks.append(partial(np.concatenate, parts[begin:i], out=whole[ends[begin] : ends[i]]))
                begin = i
        return whole

    whole = Batch(
        caustic=copied([b.caustic for b in batches], joined),
        global_=copied([b.global_ for b in batches], joined),
        counts=sum((b.counts for b in batches), np.zeros(N_COUNTS, np.int64)),
        ledgers=sum((b.ledgers for b in batches), empty_ledger()),
        global_normals=copied([b.global_normals for b in batches], joined_codes),
        caustic_normals=copied([b.caustic_normals for b in batches], joined_codes),
        volume=copied([b.volume for b in batches], joined),
    )
    if tasks:
        run(tasks)
    return whole
