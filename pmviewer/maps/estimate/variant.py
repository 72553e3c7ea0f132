"""Which density estimate a map is looked up with, told by the type of its record.

Kernels specialise on the type: a map without a mark compiles the plain disc estimate and nothing else.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Estimator = Literal["disc", "hull", "differential"]


def marked(record: NDArray[np.void], estimator: Estimator) -> NDArray[np.void]:
    """The record (1,) of a map, marked for that estimate by a field of its name; "disc" leaves it as it is.

    The mark comes first: to numba's types a record with further fields at its end is also one without them.
    """
    if estimator == "disc":
        return record
    dtype = record.dtype
    assert dtype.fields is not None
    fields = [(name, field[0]) for name, field in dtype.fields.items()]
    made = np.zeros(1, np.dtype([(estimator, np.int32), *fields], align=True))
    for name, _ in fields:
        made[name] = record[name]
    return made
