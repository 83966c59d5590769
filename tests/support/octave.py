"""Octave, where it is installed: CI must have it, by CONDYLE_OCTAVE=required."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

PROGRAM = shutil.which("octave-cli")
needs_octave = pytest.mark.skipif(
    PROGRAM is None and os.environ.get("CONDYLE_OCTAVE") != "required",
    reason="Octave is not installed",
)


def octave(code: str, folder: Path) -> str:
    """What Octave prints when it runs some lines in a folder."""
    assert PROGRAM is not None
    said = subprocess.run(
        [PROGRAM, "--quiet", "--no-init-file", "--eval", code],
        capture_output=True,
        text=True,
        timeout=300,
        cwd=folder,
    )
    assert said.returncode == 0, said.stderr
    return said.stdout
