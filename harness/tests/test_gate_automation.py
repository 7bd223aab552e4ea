"""The workflow and the hook: they call the gate as it is, and do what they say."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]

from harness.cli_gate import gate
from harness.gate.run import BASELINE_FOLDER

ROOT = Path(__file__).parents[2]
HOOK = ROOT / "docs" / "pre-push"
WORKFLOW = ROOT / ".github" / "workflows" / "credence.yml"


def run(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command,
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ
        | {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}
        | environment,
    )


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A clone with the hook, whose harness writes down its arguments and exits with EXIT."""
    run("git", "init", "-q", "--bare", "remote", cwd=tmp_path)
    run("git", "init", "-q", "-b", "main", "clone", cwd=tmp_path)
    clone = tmp_path / "clone"
    run("git", "remote", "add", "origin", "../remote", cwd=clone)
    hook = clone / ".git" / "hooks" / "pre-push"
    hook.parent.mkdir(exist_ok=True)
    hook.symlink_to(HOOK)
    fake = clone / ".venv" / "bin" / "harness"
    fake.parent.mkdir(parents=True)
    fake.write_text('#!/bin/sh\necho "$@" >> asked\nexit "${EXIT:-0}"\n', encoding="utf-8")
    fake.chmod(0o755)
    (clone / ".gitignore").write_text(".venv\nasked\n", encoding="utf-8")
    run("git", "add", ".gitignore", cwd=clone)
    author = ("-c", "user.name=A", "-c", "user.email=a@example.org")
    assert run("git", *author, "commit", "-qm", "First", cwd=clone).returncode == 0
    return clone


def test_the_hook_lets_a_passing_revision_go(clone: Path) -> None:
    pushed = run("git", "push", "-q", "origin", "main", cwd=clone)
    assert (pushed.returncode, pushed.stderr) == (0, "")
    asked = (clone / "asked").read_text(encoding="utf-8")
    command, _, scratch = asked.strip().rpartition(" --out ")
    assert command == "gate --against results/baseline --quick --speed skip"
    assert not Path(scratch).parent.exists()
    assert run("git", "rev-parse", "--verify", "-q", "main", cwd=clone.parent / "remote").stdout


def test_the_hook_stops_a_failing_revision(clone: Path) -> None:
    (clone / ".gitignore").write_text(".venv\nasked\n\n", encoding="utf-8")
    pushed = run("git", "push", "-q", "origin", "main", cwd=clone, EXIT="1", BASELINE="other")
    assert pushed.returncode != 0
    assert "pre-push: the checkout has changes that are not pushed" in pushed.stderr
    assert "pre-push: not pushed (harness gate: exit 1); git push --no-verify" in pushed.stderr
    assert "--against other --quick" in (clone / "asked").read_text(encoding="utf-8")
    assert not run("git", "rev-parse", "-q", "--verify", "main", cwd=clone.parent / "remote").stdout
    assert run("git", "push", "-q", "--no-verify", "origin", "main", cwd=clone).returncode == 0


def test_the_hook_judges_nothing_where_a_branch_is_deleted(clone: Path) -> None:
    run("git", "push", "-q", "origin", "main:old", cwd=clone)
    (clone / "asked").unlink()
    assert run("git", "push", "-q", "origin", ":old", cwd=clone, EXIT="1").returncode == 0
    assert not (clone / "asked").exists()


def test_the_workflow_lints_tests_and_gates() -> None:
    workflow: Any = yaml.safe_load(WORKFLOW.read_text(encoding="utf-8"))
    steps = workflow["jobs"]["check"]["steps"]
    commands_run = [step["run"].strip() for step in steps if "run" in step]
    for wanted in ("make setup", "make lint", "make test"):
        assert wanted in commands_run
    (gate,) = [command for command in commands_run if "harness gate" in command]
    assert f"--against {BASELINE_FOLDER} --quick" in gate
    assert {"pip", "Swatinem/rust-cache@v2"} <= {
        *(step.get("with", {}).get("cache") for step in steps),
        *(step.get("uses") for step in steps),
    }


def test_the_options_that_they_pass_exist() -> None:
    options = set(gate.__annotations__)
    for text in (HOOK.read_text(encoding="utf-8"), WORKFLOW.read_text(encoding="utf-8")):
        line = next(line for line in text.splitlines() if " gate --against" in line)
        names = {word[2:] for word in line.split() if word.startswith("--")}
        assert names <= options
