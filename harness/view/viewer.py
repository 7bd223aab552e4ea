"""The Rerun viewer as a process of its own: in a window, or served to a browser.

The SDK's own servers listen on every interface and report a taken port as a log line; the program
that comes with it can be told to listen on this machine alone.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING
from urllib.parse import quote

from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

HOST = "127.0.0.1"


def check_display() -> None:
    """Refuse a machine that can open no window.

    Raises
    ------
    InputError
        Neither X11 nor Wayland is there.
    """
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise InputError(
            "there is no display to open the viewer on (DISPLAY and WAYLAND_DISPLAY are unset); "
            "pass --serve for a browser, or --save x.rrd and open that elsewhere with `rerun x.rrd`"
        )


def check_ports(port: int) -> None:
    """Refuse a port that cannot be had, or the one after it, for the viewer and for its data.

    Raises
    ------
    InputError
        A number that is no port, or a port that is taken.
    """
    if not 1 <= port <= 65534:
        raise InputError(f"--port {port}: use a number from 1 to 65534")
    for number in (port, port + 1):
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((HOST, number))
            except OSError as error:
                raise InputError(
                    f"port {number} cannot be had ({error.strerror}); --serve takes two ports from "
                    f"--port {port} on: pass another"
                ) from None


def web_address(port: int) -> str:
    """Where a browser finds the served viewer, with its data's address in it."""
    data = quote(f"rerun+http://{HOST}:{port + 1}/proxy", safe="")
    return f"http://{HOST}:{port}/?url={data}"


def show(file: Path) -> None:
    """Open a file in a window, until it is closed; raises InputError if that fails."""
    _run_viewer([str(file)])


def serve(file: Path, *, port: int) -> None:
    """Serve a file to browsers on this machine, until interrupted; raises like `show`."""
    ports = ("--web-viewer-port", str(port), "--port", str(port + 1))
    try:
        _run_viewer(["--serve-web", "--bind", HOST, *ports, str(file)])
    except KeyboardInterrupt:
        return


def _run_viewer(arguments: Sequence[str]) -> None:
    with _terminated_as_interrupted():
        # A group of its own: the package's script starts the viewer proper, which would outlive it.
        viewer = subprocess.Popen(
            [sys.executable, "-m", "rerun", *arguments], stdout=sys.stderr, process_group=0
        )
        try:
            code = viewer.wait()
        finally:
            if viewer.poll() is None:
                os.killpg(viewer.pid, signal.SIGTERM)
                viewer.wait()
    if code != 0:
        raise InputError(
            f"the Rerun viewer ended with {code}; what it printed stands above; "
            "pass --save x.rrd to keep the scene as a file"
        )


@contextmanager
def _terminated_as_interrupted() -> Iterator[None]:
    """Take SIGTERM like Ctrl-C, so that no viewer stays behind."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
