"""The engine that a person chooses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, TypeAlias

from harness.engines.address import AUTO, check_address
from harness.engines.cluster import RayEngine
from harness.engines.local import LocalEngine
from harness.errors import InputError

if TYPE_CHECKING:
    from harness.engines.engine import Engine

EngineName: TypeAlias = Literal["local", "ray"]


def make_engine(name: EngineName, *, address: str | None, workers: int | None) -> Engine:
    """Make an engine that can be used.

    Parameters
    ----------
    name
        ``local`` or ``ray``.
    address
        Of the Ray cluster, by default the one of this machine.
    workers
        Processes of the local engine, or most tasks at a time on the cluster.

    Raises
    ------
    InputError
        No worker at all; an address for the local engine; Ray is missing, or no cluster answers.
    """
    if workers is not None and workers < 1:
        raise InputError(f"--workers {workers}: should be at least 1")
    if name == "local":
        if address is not None:
            raise InputError(f"--address {address} is a Ray cluster's; pass --engine ray with it")
        return LocalEngine(workers=workers)
    address = AUTO if address is None else address
    check_address(address)
    return RayEngine(address, workers=workers)
