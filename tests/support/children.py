"""Processes of their own, to race, to be killed, and to be looked at from outside."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import condyle

PATIENCE = 300  # seconds; a loaded machine is slow


def start(code: str, *arguments: object, **options: object) -> subprocess.Popen[str]:
    """Python with the library under test; its own group, so that its compiler dies with it."""
    paths = [str(Path(condyle.__file__).parents[1]), str(Path(__file__).parents[1])]
    path = os.pathsep.join([*paths, os.environ.get("PYTHONPATH", "")])
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": path},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=_heed_signals,
        **options,
    )


def _heed_signals() -> None:
    """Whoever started the tests may ignore some, as a shell does for its background jobs."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


def end(child: subprocess.Popen[str], number: int) -> None:
    """Send a signal to a process and all that it has started, and wait for its end."""
    os.killpg(child.pid, number)
    child.wait(PATIENCE)


def wait_for(what: Callable[[], object], child: subprocess.Popen[str]) -> None:
    """Until something is so; an error if the process ends before that."""
    until = time.monotonic() + PATIENCE
    while not what():
        assert child.poll() is None, child.communicate()
        assert time.monotonic() < until
        time.sleep(0.02)
