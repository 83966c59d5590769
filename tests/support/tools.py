"""Compilers and tools that tests of exported C call; without one a test says why it is skipped."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest


def need(*tools: str) -> None:
    """Skips the test where one is missing, unless CONDYLE_TOOLS=required."""
    missing = [tool for tool in tools if shutil.which(tool) is None]
    if missing and os.environ.get("CONDYLE_TOOLS") == "required":
        pytest.fail(f"CONDYLE_TOOLS=required, but there is no {', '.join(missing)}")
    if missing:
        pytest.skip(f"needs {', '.join(missing)}")


def run(*call: object, folder: Path, seconds: float = 300) -> str:
    """What a command says; fails with it where the command fails, or takes longer."""
    words = [str(word) for word in call]
    if not words[0].startswith("./"):
        need(words[0])
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=seconds)
    assert done.returncode == 0, f"{' '.join(words)}\n{(done.stdout + done.stderr)[-3000:]}"
    return done.stdout + done.stderr
