"""A real Ray cluster of two nodes on this machine, each of one CPU, for tests."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from harness.tests.fake_scenes import is_alive

RAY = Path(sys.executable).parent / "ray"
QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_enable_metrics_collection": "0",
    # A node that dies is noticed in seconds.
    "RAY_health_check_initial_delay_ms": "0",
    "RAY_health_check_period_ms": "1000",
    "RAY_health_check_failure_threshold": "3",
    # The least processes that a node can do with.
    "RAY_DISABLE_MEMORY_MONITOR": "1",
}
MEMORY = ("--object-store-memory=80000000",)
START_S = 60.0


class Node:
    """The processes of one node: a session of their own, by which they are found and killed."""

    def __init__(self, *options: str, folder: Path, orders: Path) -> None:
        self._log = folder / f"node-{len(list(folder.glob('node-*')))}"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [RAY, "start", "--block", "--num-cpus=1", *MEMORY, *options],
                env=os.environ | QUIET | {"FAKE_SCENES": str(orders)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    def wait_for(self, pattern: str) -> str:
        """Wait until it has printed something; returns the first group."""
        deadline = time.monotonic() + START_S
        while (found := re.search(pattern, self._log.read_text(encoding="utf-8"))) is None:
            assert time.monotonic() < deadline, self._log.read_text(encoding="utf-8")
            assert self._process.poll() is None, self._log.read_text(encoding="utf-8")
            time.sleep(0.05)
        return found.group(1)

    def processes(self) -> list[int]:
        """Every process of the node that is alive."""
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                status = (entry / "stat").read_text(encoding="ascii", errors="replace")
            except OSError:
                continue
            session = int(status.rpartition(")")[2].split()[3])
            if session == self._process.pid and is_alive(int(entry.name)):
                found.append(int(entry.name))
        return found

    def kill(self) -> None:
        """Let the node drop dead, all of it."""
        deadline = time.monotonic() + START_S
        while alive := self.processes():
            assert time.monotonic() < deadline
            for pid in alive:
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    continue
            self._process.poll()
            time.sleep(0.02)
        self._process.wait()


class FakeCluster:
    """The cluster; `close` leaves nothing of it behind."""

    def __init__(self) -> None:
        # Under a short name: a path of Ray's sockets may have 107 letters.
        self.folder = Path(tempfile.mkdtemp(prefix="ray"))
        self.orders = self.folder / "orders"
        self.orders.mkdir()
        head = Node(
            "--head",
            "--port=0",
            "--include-dashboard=false",
            "--disable-usage-stats",
            f"--temp-dir={self.folder}",
            folder=self.folder,
            orders=self.orders,
        )
        self.nodes = [head]
        self.address = head.wait_for(r"ray start --address='([^']+)'")
        self.add_node()

    def add_node(self) -> Node:
        """Start another node."""
        node = Node(f"--address={self.address}", folder=self.folder, orders=self.orders)
        self.nodes.append(node)
        node.wait_for("(Ray runtime started)")
        return node

    def forget_orders(self) -> None:
        """Let the next test begin anew."""
        for path in self.orders.iterdir():
            path.unlink()

    def close(self) -> None:
        """Kill every node."""
        for node in reversed(self.nodes):
            node.kill()
        shutil.rmtree(self.folder)
        assert not any(node.processes() for node in self.nodes)
