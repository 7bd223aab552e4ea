from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sim_scenes.scratch import LOCK, PREFIX, mesh_file, remove_orphans, texture_file

TRIANGLE = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], dtype=np.float32).astype(np.float64)
FACES = np.array([[0, 1, 2]])


def test_meshes_survive_their_file_bit_for_bit() -> None:
    random = np.random.default_rng(0)
    vertices = random.standard_normal((40, 3)).astype(np.float32).astype(np.float64)
    faces = random.integers(0, 40, (20, 3))
    read = trimesh.load_mesh(mesh_file(vertices, faces), process=False)
    corners = np.asarray(read.vertices, dtype=np.float32)[read.faces]
    np.testing.assert_array_equal(corners, vertices.astype(np.float32)[faces])


@pytest.mark.parametrize(
    ("extras", "corner"),
    [
        ({}, "f 1 2 3"),
        ({"uv": TRIANGLE[:, :2]}, "f 1/1 2/2 3/3"),
        ({"normals": TRIANGLE}, "f 1//1 2//2 3//3"),
        ({"uv": TRIANGLE[:, :2], "normals": TRIANGLE}, "f 1/1/1 2/2/2 3/3/3"),
    ],
)
def test_faces_name_what_there_is(extras: dict[str, np.ndarray], corner: str) -> None:
    path = mesh_file(TRIANGLE, FACES, **extras)
    assert path.read_text(encoding="ascii").splitlines()[-1] == corner


def test_one_file_per_mesh_and_one_per_texture_ever() -> None:
    assert mesh_file(TRIANGLE, FACES) == mesh_file(TRIANGLE.copy(), FACES.copy())
    assert mesh_file(TRIANGLE, FACES) != mesh_file(2 * TRIANGLE, FACES)
    picture = np.zeros((4, 4, 3), dtype=np.uint8)
    assert texture_file(picture) != texture_file(picture)


HOLD = """
import time
from sim_scenes.scratch import scratch_folder
print(scratch_folder(), flush=True)
time.sleep(60)
"""


def test_a_killed_process_is_cleaned_up_after_and_a_living_one_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    folders, processes = [], []
    for _ in range(2):
        process = subprocess.Popen(
            [sys.executable, "-c", HOLD], stdout=subprocess.PIPE, text=True, env=environment
        )
        assert process.stdout is not None
        folders.append(Path(process.stdout.readline().strip()))
        process.stdout.close()
        processes.append(process)
    try:
        processes[0].send_signal(signal.SIGKILL)
        processes[0].wait()
        assert folders[0].is_dir()
        monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
        remove_orphans()
        # Too young: it might be about to be locked.
        assert folders[0].is_dir()
        for folder in folders:
            long_ago = time.time() - 3600
            os.utime(folder / LOCK, (long_ago, long_ago))
        remove_orphans()
        assert [path.name for path in tmp_path.glob(f"{PREFIX}*")] == [folders[1].name]
    finally:
        processes[1].kill()
        processes[1].wait()
