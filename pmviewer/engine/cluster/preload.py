"""Loaded by each worker process that is started here, as Dask's preload: Ctrl+C on the terminal reaches them too, but
it is their client that ends them."""

from __future__ import annotations

import signal
import threading
from typing import Any


def dask_setup(worker: Any) -> None:
    """Called by Dask in a new worker process."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
