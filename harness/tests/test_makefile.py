"""What `make` says before it sets anything up."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]

FAKE_PYTHON = f"""#!/bin/sh
exec '{sys.executable}' -c 'import sys; sys.version_info = (3, 12, 0); exec(sys.argv[1])' "$2"
"""


def test_a_later_python_is_refused_with_the_remedy(tmp_path: Path) -> None:
    python = tmp_path / "python3.12"
    python.write_text(FAKE_PYTHON, encoding="utf-8")
    python.chmod(0o755)
    venv = tmp_path / "venv"
    made = subprocess.run(
        ["make", f"VENV={venv}", f"PYTHON={python}", str(venv / "bin" / "python")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=30,
    )
    assert made.returncode == 2
    assert made.stderr.splitlines()[0] == (
        f"make: '{python}' is not Python 3.11, and PyBullet has no wheels for later ones: "
        "install Python 3.11 or pass PYTHON=/path/to/python3.11"
    )
    assert not venv.exists()
