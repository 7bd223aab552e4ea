"""How a process computes a job; and the local one, which takes jobs over a pipe until it closes.

`LocalEngine` starts it as a fresh interpreter that calls `main`.
"""

from __future__ import annotations

import faulthandler
import importlib
import os
import queue
import resource
import sys
import threading
import time
import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable


@dataclass(frozen=True)
class Done:
    """A scene that was computed.

    Attributes
    ----------
    result
        What the scene function returned.
    seconds
        Wall time.
    peak_memory_mib
        Highest resident memory during the scene, MiB.
    """

    result: Any
    seconds: float
    peak_memory_mib: float


@dataclass(frozen=True)
class Raised:
    """A scene whose function raised.

    Attributes
    ----------
    failure
        The exception on one line.
    trace
        Its traceback.
    """

    failure: str
    trace: str


@dataclass(frozen=True)
class Unusable:
    """A worker that cannot import its target; no other worker could."""

    reason: str


def load_target(target: str) -> Callable[..., Any]:
    """Import the function that ``package.module:name`` names."""
    module, _, name = target.partition(":")
    function = getattr(importlib.import_module(module), name)
    if not callable(function):
        raise TypeError(f"{target} is not a function")
    return function  # type: ignore[no-any-return]


def main(descriptor: int, target: str) -> None:
    """Serve jobs until the parent closes the pipe or dies."""
    faulthandler.enable()
    connection = Connection(descriptor)
    inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(connection, inbox), daemon=True).start()
    try:
        function = load_target(target)
    except Exception as error:
        traceback.print_exc()
        connection.send(Unusable(one_line(error)))
        return
    while True:
        message = compute(function, inbox.get())
        if isinstance(message, Raised):
            print(message.trace, file=sys.stderr, flush=True)  # noqa: T201 - goes into the log
        connection.send(message)


def _receive(connection: Connection, inbox: queue.SimpleQueue[Any]) -> None:
    """Pass jobs on; leave at once, in the middle of a scene too, when the parent has gone."""
    while True:
        try:
            inbox.put(connection.recv())
        except (EOFError, OSError):
            os._exit(0)


def compute(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Done | Raised:
    """Call a job's function, take its time and its memory, and catch what it raises."""
    _reset_peak_memory()
    start = time.perf_counter()
    try:
        result = function(*arguments)
    except Exception as error:
        return Raised(one_line(error), traceback.format_exc())
    return Done(result, time.perf_counter() - start, _peak_memory_mib())


def one_line(error: Exception) -> str:
    """Name an exception and say its message, without line breaks."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def _reset_peak_memory() -> None:
    """Start a new peak where the kernel can; elsewhere the peak is that of the worker's life."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return


def _peak_memory_mib() -> float:
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    line = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
    return int(line.split()[1]) / 1024
