"""Where numbers of seconds were measured."""

from __future__ import annotations

import platform
from pathlib import Path


def processor() -> str:
    """The processor's name, as good as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    for line in lines:
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()
