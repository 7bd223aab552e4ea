"""Engines as a person chooses them: addresses that answer, and those that do not."""

from __future__ import annotations

import importlib.util
import socket
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest

from harness import cli, cli_bench
from harness.engines import address as checking
from harness.engines.choice import make_engine
from harness.engines.cluster import RayEngine
from harness.engines.local import LocalEngine
from harness.errors import InputError
from harness.tests.fake_wiring import WIRING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from harness.engines.choice import EngineName


@pytest.fixture
def port() -> Iterator[int]:
    """A port that takes connections and says nothing."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        yield listener.getsockname()[1]


def refused(name: EngineName, address: str | None) -> str:
    with pytest.raises(InputError) as caught:
        make_engine(name, address=address, workers=None)
    return str(caught.value)


def test_an_engine_is_made_when_its_cluster_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    def answer(command: list[str], **_: Any) -> subprocess.CompletedProcess[str]:
        asked.append(command)
        return subprocess.CompletedProcess(command, 0, stderr="")

    monkeypatch.setattr(subprocess, "run", answer)
    assert make_engine("ray", address=None, workers=3) == RayEngine("auto", workers=3)
    assert [command[-1] for command in asked] == ["auto"]
    assert make_engine("local", address=None, workers=3) == LocalEngine(workers=3)


def test_an_address_that_nobody_listens_at_is_refused_at_once(port: int) -> None:
    with socket.socket() as closed:
        closed.bind(("127.0.0.1", 0))
        free = closed.getsockname()[1]
        start = time.monotonic()
        assert refused("ray", f"127.0.0.1:{free}") == (
            f"no Ray cluster answers at 127.0.0.1:{free} (Connection refused); start one there "
            "with `ray start --head`, or pass the address that it printed"
        )
    assert time.monotonic() - start < 3
    assert "(Name or service not known)" in refused("ray", "no-such-host.invalid:6379")


def test_a_listener_that_is_not_ray_is_given_up(port: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert checking.CONNECT_S + checking.PROBE_S <= 15
    monkeypatch.setattr(checking, "PROBE_S", 0.2)
    assert refused("ray", f"127.0.0.1:{port}") == (
        f"no Ray cluster answers at 127.0.0.1:{port} (nothing of Ray within 0 s); start one there "
        "with `ray start --head`, or pass the address that it printed"
    )


def test_no_cluster_on_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    trace = "Traceback (most recent call last):\n  x\nConnectionError: Could not find\nany Ray.\n"
    monkeypatch.setattr(
        subprocess,
        "run",
        lambda command, **_: subprocess.CompletedProcess(command, 1, stderr=trace),
    )
    assert refused("ray", None) == (
        "--address auto finds no Ray cluster here (ConnectionError: Could not find any Ray.); "
        "start one with `ray start --head`, or pass --address HOST:PORT"
    )


@pytest.mark.parametrize("address", ["nonsense", "host:", ":6379", "host:port", "host:99999", ""])
def test_what_is_no_address(address: str) -> None:
    assert refused("ray", address) == (
        f"--address {address}: should be auto, HOST:PORT (a cluster's port is 6379 by default) "
        "or ray://HOST:PORT (10001 by default)"
    )


def test_an_address_for_this_machine_is_refused() -> None:
    assert refused("local", "head:6379") == (
        "--address head:6379 is a Ray cluster's; pass --engine ray with it"
    )


def test_ray_that_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    message = refused("ray", "auto")
    assert message.startswith("--engine ray needs Ray (")
    assert message.endswith("; install it with `pip install 'credence[ray]'`")


def test_rays_client_that_is_not_installed(monkeypatch: pytest.MonkeyPatch, port: int) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert refused("ray", f"ray://127.0.0.1:{port}") == (
        f"--address ray://127.0.0.1:{port} needs Ray's client; install it with "
        "`pip install 'ray[client]'`, or pass HOST:PORT from a machine of the cluster"
    )


def test_ray_is_imported_only_when_it_is_chosen() -> None:
    command = "import sys, harness.cli; print([n for n in sys.modules if n.split('.')[0] == 'ray'])"
    done = subprocess.run(
        [sys.executable, "-c", command], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_an_address_that_does_not_answer_leaves_no_run(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cli_bench, "wiring", WIRING)
    run = tmp_path / "run"
    assert cli.main(["bench", "--engine", "ray", "--address", "x", "--out", str(run)]) == 2
    assert "harness: --address x: should be auto, HOST:PORT" in capsys.readouterr().err
    assert not run.exists()
