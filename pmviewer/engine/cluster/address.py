"""Where a cluster can be, in the user's words. Light to import: the window waits for it."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

from pmviewer.errors import ClusterError, SettingError

LOCAL = re.compile(r"local:(\d{1,4})")
MOST_LOCAL = 256
_ADDRESS = re.compile(r"(tcp|tls|ucx|ws|wss)://\S+")
_TLS = (
    "set distributed.comm.tls.ca-file, .client.cert and .client.key in Dask's configuration, for example by "
    "DASK_DISTRIBUTED__COMM__TLS__CA_FILE=ca.pem."
)
_NO_LIBRARY = "The extra 'cluster' is not installed here: pip install 'pmviewer[cluster]'."


def check_address(where: str) -> None:
    """Raises SettingError for what can't be the address of a cluster, ClusterError without Dask."""
    local = LOCAL.fullmatch(where)
    if local and not 1 <= int(local[1]) <= MOST_LOCAL:
        raise SettingError(f"--cluster {where}: from 1 to {MOST_LOCAL} workers can be started here.")
    if not (local or _ADDRESS.fullmatch(where) or where.endswith(".json")):
        raise SettingError(
            f"--cluster {where} is no cluster: write local:N for N processes of this machine, the address of a Dask "
            "scheduler (tcp://host:8786, tls://host:8786), or its scheduler file (.json)."
        )
    if where.endswith(".json") and not Path(where).is_file():
        raise ClusterError(
            f"There is no scheduler file {where}; start one with: dask scheduler --scheduler-file {where}"
        )
    if not (find_spec("distributed") and find_spec("lz4")):
        raise ClusterError(_NO_LIBRARY)
    if where.startswith(("tls:", "wss:")):
        from distributed import Security

        if Security().get_connection_args("client").get("ssl_context") is None:
            raise ClusterError(f"--cluster {where} needs certificates: {_TLS}")
