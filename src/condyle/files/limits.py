"""The most that each door takes: the limits on what strangers' files and arguments ask for.

Work is bounded before it is done. A message names the limit, as in "(limit COLUMNS)".
"""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import InputError


@dataclass(frozen=True)
class WorkLimit:
    """Attributes: name: of the limit;  most: that is taken;  counted: of what;  remedy: or ""."""

    name: str
    most: int
    counted: str
    remedy: str = ""

    def check(self, got: float, where: str) -> None:
        """Raises InputError for more than is taken; `where` says of what."""
        if got <= self.most:
            return
        numbers = (f"{n:.0f}" if n < 1e9 else f"{n:.3g}" for n in (got, self.most))
        said = f"{where}: {{}} {self.counted}, expected at most {{}} (limit {self.name})"
        raise InputError(said.format(*numbers) + (self.remedy and f"; {self.remedy}"))


COLUMNS = WorkLimit("COLUMNS", 10_000, "columns")
COLUMN_NAME = WorkLimit("COLUMN_NAME", 1_000, "characters in the name of a column")
LINE = WorkLimit("LINE", 1 << 24, "bytes in a line")
NUMBERS = WorkLimit(
    "NUMBERS",
    100_000_000,
    "numbers in a table that is read at once",  # a few bytes of Parquet hold more
    "a command that streams rows, such as `condyle solve`, takes it",
)
# MCAP: what writers make is a twentieth of a chunk's limit.
CHUNK = WorkLimit("CHUNK", 1 << 25, "bytes in a chunk or a record")
MESSAGE = WorkLimit("MESSAGE", 1 << 20, "bytes in a message")
RECORDING = WorkLimit("RECORDING", 500_000_000, "bytes in a file that is read at once")  # a day's
TOML = WorkLimit("TOML", 1_000_000, "bytes of TOML")  # the bundled mechanisms have some thousands
NESTING = WorkLimit("NESTING", 20, "tables and lists within each other")  # the format needs six
# A key of many parts costs a reader of TOML their square: of memory, too.
KEY_PARTS = WorkLimit("KEY_PARTS", 100, "parts in a dotted key")
XML = WorkLimit("XML", 50_000_000, "bytes of XML")
XML_DEPTH = WorkLimit("XML_DEPTH", 100, "elements within each other")
XML_ELEMENTS = WorkLimit("XML_ELEMENTS", 1_000_000, "elements of XML")
LISTS = WorkLimit("LISTS", 32, "lists within each other")
SAMPLES = WorkLimit(  # three hours at 1 kHz
    "SAMPLES", 10_000_000, "samples", "lower rate, or what makes it last so long"
)
HARMONICS = WorkLimit("HARMONICS", 100, "harmonics")
MAP_AXES = WorkLimit("MAP_AXES", 3, "coordinates")
MAP_POINTS = WorkLimit("MAP_POINTS", 10**10, "points of a map")
LABELS = WorkLimit("LABELS", 10_000, "labels")
TEXT = WorkLimit("TEXT", 1 << 20, "characters of text")
ATTRIBUTE = WorkLimit("ATTRIBUTE", 1 << 26, "characters of text")
ENTRIES = WorkLimit("ENTRIES", 32, "texts in an attribute")
# Numbers that are packed are smaller, but not by more; a small file may be all of one number.
DENSITY = WorkLimit("DENSITY", 100, "bytes of arrays for each byte of the file; it is damaged")


def sample_count(duration: float, rate: float) -> float:
    """Samples of a duration [s] at a rate [Hz].

    Raises: InputError: for more than are made.
    """
    count = duration * rate
    SAMPLES.check(count, f"{duration:.4g} s at {rate:g} Hz")
    return count
