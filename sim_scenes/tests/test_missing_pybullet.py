from __future__ import annotations

import subprocess
import sys

import pytest

from sim_scenes import ObjectSet, SceneSpec, SimulatorMissing, require_pybullet, simulate


def test_simulating_without_pybullet_says_for_which_python_there_is_one(
    monkeypatch: pytest.MonkeyPatch, object_set: ObjectSet, small: SceneSpec
) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    expected = r"not installed for this Python .* wheels for CPython up to 3\.11; run with Python"
    with pytest.raises(SimulatorMissing, match=expected):
        require_pybullet()
    with pytest.raises(ImportError, match="pip install pybullet"):
        simulate(small, 0, object_set)


def test_everything_else_imports_without_it() -> None:
    code = (
        "import sys; sys.modules['pybullet'] = None; sys.modules['pybullet_data'] = None\n"
        "import sim_scenes; sim_scenes.SceneSpec.single('mug')\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
    assert SceneSpec.single("mug").views == 3
