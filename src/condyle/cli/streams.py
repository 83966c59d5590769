"""Streams that may be closed or broken: what is said on them never decides how a command ends."""

from __future__ import annotations

import io
import os
from contextlib import suppress
from typing import Any, TextIO


class Forgiving(io.TextIOBase):
    """A text stream that nobody may be reading; None stands for one closed from the start."""

    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            self._try("write", text)
        except UnicodeError:  # a file name that is no text
            self._try("write", text.encode("ascii", "backslashreplace").decode())
        return len(text)

    def flush(self) -> None:
        self._try("flush")

    def isatty(self) -> bool:
        return self._stream is not None and self._stream.isatty()

    def fileno(self) -> int:
        if self._stream is None:
            raise io.UnsupportedOperation("fileno")
        return self._stream.fileno()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        return getattr(self._stream, "encoding", None) or "utf-8"

    def _try(self, method: str, *text: str) -> None:
        if self._stream is None:
            return
        try:
            getattr(self._stream, method)(*text)
        except UnicodeError:
            raise
        except (OSError, ValueError):
            drop(self._stream)
            self._stream = None


def drop(stream: Any) -> None:
    """Let what is left of a stream go nowhere, so that Python's own last flush cannot fail."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
