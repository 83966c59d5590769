"""Every command of the README runs as it stands, from a checkout."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")
CELLS = re.findall(r"`(condyle [^`]+)`", TEXT)
LINES = re.findall(r"^(condyle .+)$", TEXT, re.MULTILINE)
SERVES = ("view",)  # until it is stopped: tests of the view start it
COMMANDS = [command.split("  #")[0].strip() for command in dict.fromkeys([*CELLS, *LINES])]


@pytest.fixture
def checkout(
    condyle_command: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Any]:
    monkeypatch.setenv("CONDYLE_BACKEND", "auto")
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    return condyle_command


@pytest.mark.ci
def test_commands_run(checkout: Callable[..., Any]) -> None:
    """In their order, since one shows what another wrote."""
    assert len(COMMANDS) > 10
    for command in COMMANDS:
        words = shlex.split(command)[1:]
        if words[0] in SERVES:
            words = [words[0], "--help"]
        outcome = checkout(*words)
        assert outcome.status == 0, f"{command}: {outcome.err}"


def test_targets_of_make_exist() -> None:
    targets = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    named = re.findall(r"\bmake ([a-z]+)", TEXT)
    assert {"run", "test", "quick"} <= set(named) <= set(targets)


def test_exported_c_is_built_as_said(checkout: Callable[..., Any], tmp_path: Path) -> None:
    lines = [line for line in TEXT.splitlines() if line.startswith("make -C")]
    if not lines or shutil.which("cc") is None:
        pytest.skip("no line, or no compiler")
    assert checkout("export", "c", "masticatory", "--out", "jaw").status == 0
    for line in lines:
        command = line.split("  #")[0]
        done = subprocess.run(command, shell=True, cwd=tmp_path, capture_output=True, check=False)
        assert done.returncode == 0, (command, done.stderr)
