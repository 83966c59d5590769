"""What became of a sample: one place for the words."""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """Status of a sample, as results and files have it."""

    OK = 0
    UNREACHABLE = 1
    SINGULAR = 2
    OVERFLOW = 3

    @property
    def label(self) -> str:
        return self.name.lower()


STATUS_NAMES = tuple(status.label for status in Status)
