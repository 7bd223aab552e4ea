"""Whether a Ray cluster answers at an address, found out in seconds: `ray.init` takes minutes."""

from __future__ import annotations

import importlib
import importlib.util
import re
import socket
import subprocess
import sys
from typing import Any

from harness.errors import InputError

AUTO = "auto"
"""The cluster of this machine, or the one that RAY_ADDRESS names."""
CLIENT = "ray://"
"""Start of an address that is reached through Ray's client."""

CONNECT_S = 3.0
PROBE_S = 12.0

_PROBE = (
    "import logging, sys, ray; "
    "ray.init(address=sys.argv[1], log_to_driver=False, logging_level=logging.ERROR)"
)


def import_ray() -> Any:
    """Import Ray, which is an optional extra.

    Raises
    ------
    InputError
        It is not installed.
    """
    try:
        return importlib.import_module("ray")
    except ImportError as error:
        raise InputError(
            f"--engine ray needs Ray ({error}); install it with `pip install 'credence[ray]'`"
        ) from None


def check_address(address: str) -> None:
    """Find out within some fifteen seconds that a Ray cluster answers.

    Parameters
    ----------
    address
        `AUTO`, ``HOST:PORT`` or ``ray://HOST:PORT``.

    Raises
    ------
    InputError
        Ray is missing, the address is malformed, or nothing of Ray answers there.
    """
    import_ray()
    if address != AUTO:
        host, port = _split(address)
        if address.startswith(CLIENT) and importlib.util.find_spec("grpc") is None:
            raise InputError(
                f"--address {address} needs Ray's client; install it with "
                "`pip install 'ray[client]'`, or pass HOST:PORT from a machine of the cluster"
            )
        try:
            socket.create_connection((host, port), timeout=CONNECT_S).close()
        except OSError as error:
            raise _silent(address, error.strerror or str(error)) from None
    # A process of its own, for a connection that hangs cannot be given up from within.
    try:
        done = subprocess.run(
            [sys.executable, "-c", _PROBE, address],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            timeout=PROBE_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise _silent(address, f"nothing of Ray within {PROBE_S:.0f} s") from None
    if done.returncode != 0:
        raise _silent(address, _reason(done.stderr))


def _split(address: str) -> tuple[str, int]:
    host, _, port = address.removeprefix(CLIENT).rpartition(":")
    if not host or not re.fullmatch(r"\d{1,5}", port) or not 0 < int(port) < 1 << 16:
        raise InputError(
            f"--address {address}: should be auto, HOST:PORT (a cluster's port is 6379 by default) "
            "or ray://HOST:PORT (10001 by default)"
        )
    return host.strip("[]"), int(port)


def _silent(address: str, reason: str) -> InputError:
    if address == AUTO:
        return InputError(
            f"--address auto finds no Ray cluster here ({reason}); start one with "
            "`ray start --head`, or pass --address HOST:PORT"
        )
    return InputError(
        f"no Ray cluster answers at {address} ({reason}); start one there with "
        "`ray start --head`, or pass the address that it printed"
    )


def _reason(stderr: str) -> str:
    """Take the exception and its message from what Python printed."""
    lines = stderr.strip().splitlines()
    starts = [
        i for i, line in enumerate(lines) if re.match(r"[\w.]+(Error|Exception|Exit): ", line)
    ]
    text = " ".join(" ".join(lines[starts[-1] :] if starts else lines[-1:]).split())
    return text[:400] or "it ended without a word"
