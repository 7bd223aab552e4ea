"""The viewer's process: where it is shown, where it is served, and how it ends."""

from __future__ import annotations

import signal
import socket
import stat
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

from harness.errors import InputError
from harness.tests.fake_view import recording
from harness.view import viewer
from harness.view.stream import encode

PATIENCE_S = 60.0

SERVE = """
import sys
from pathlib import Path
from harness.view.viewer import serve
serve(Path(sys.argv[1]), port=int(sys.argv[2]))
print("ended")
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems have a display")
def test_without_a_display_two_ways_out_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError) as refused:
        viewer.check_display()
    assert str(refused.value) == (
        "there is no display to open the viewer on (DISPLAY and WAYLAND_DISPLAY are unset); "
        "pass --serve for a browser, or --save x.rrd and open that elsewhere with `rerun x.rrd`"
    )
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    viewer.check_display()


def free_ports() -> int:
    """A port that is free, as the one after it is."""
    while True:
        with socket.socket() as first, socket.socket() as second:
            first.bind((viewer.HOST, 0))
            port: int = first.getsockname()[1]
            try:
                second.bind((viewer.HOST, port + 1))
            except (OSError, OverflowError):
                continue
            return port


@pytest.mark.parametrize("taken", [0, 1])
def test_a_taken_port_is_named(taken: int) -> None:
    port = free_ports()
    viewer.check_ports(port)
    with socket.socket() as other:
        other.bind((viewer.HOST, port + taken))
        other.listen()
        with pytest.raises(InputError) as refused:
            viewer.check_ports(port)
    assert str(refused.value) == (
        f"port {port + taken} cannot be had (Address already in use); --serve takes two ports from "
        f"--port {port} on: pass another"
    )


def test_the_address_leads_to_the_data() -> None:
    assert viewer.web_address(9090) == (
        "http://127.0.0.1:9090/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9091%2Fproxy"
    )


def pretend(folder: Path, monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
    """Let a shell script stand for Python with Rerun."""
    script = folder / "python"
    script.write_text("\n".join(["#!/bin/sh", *lines, ""]), encoding="utf-8")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(sys, "executable", str(script))


def test_a_window_is_opened_on_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(tmp_path, monkeypatch, f'echo "$@" > {tmp_path}/asked')
    viewer.show(tmp_path / "x.rrd")
    asked = (tmp_path / "asked").read_text(encoding="utf-8")
    assert asked == f"-m rerun {tmp_path / 'x.rrd'}\n"


def test_a_viewer_that_fails_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pretend(tmp_path, monkeypatch, "exit 3")
    with pytest.raises(InputError) as refused:
        viewer.show(tmp_path / "x.rrd")
    assert str(refused.value) == (
        "the Rerun viewer ended with 3; what it printed stands above; "
        "pass --save x.rrd to keep the scene as a file"
    )


def test_a_browser_is_served_until_the_command_is_ended(tmp_path: Path) -> None:
    """On this machine alone, and nothing of it stays behind."""
    file, port = tmp_path / "scene.rrd", free_ports()
    file.write_bytes(
        encode(recording(), name="run", model="metric", tolerance_m=0.005, about="# mug")
    )
    with (tmp_path / "log").open("w", encoding="utf-8") as log:
        served = subprocess.Popen(
            [sys.executable, "-c", SERVE, str(file), str(port)],
            cwd=Path(__file__).parents[2],
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
        )
        try:
            page = fetch(f"http://{viewer.HOST}:{port}/", patience_s=PATIENCE_S)
            assert "<title>" in page
            assert set(listeners(port)) == {"0100007F"}
            assert set(listeners(port + 1)) == {"0100007F"}
        finally:
            served.send_signal(signal.SIGTERM)
            said, _ = served.communicate(timeout=PATIENCE_S)
    assert (served.returncode, said) == (0, "ended\n")
    assert listeners(port) == listeners(port + 1) == []


def fetch(address: str, *, patience_s: float) -> str:
    """A page, as soon as it is served."""
    until = time.monotonic() + patience_s
    while True:
        try:
            with urllib.request.urlopen(address, timeout=5.0) as page:
                return str(page.read().decode())
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


def listeners(port: int) -> list[str]:
    """Addresses, as the kernel writes them, on which a port is listened at."""
    found = []
    for table in ("tcp", "tcp6"):
        if Path(f"/proc/net/{table}").exists():
            for line in Path(f"/proc/net/{table}").read_text(encoding="ascii").splitlines()[1:]:
                address, number = line.split()[1].split(":")
                if int(number, 16) == port and line.split()[3] == "0A":
                    found.append(address)
    return found
