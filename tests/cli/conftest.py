"""Files for the command: states, motions and mechanisms, and tables read back."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

Write = Callable[[Sequence[str], np.ndarray, str], Path]


@pytest.fixture
def write_csv(tmp_path: Path) -> Write:
    """Writes columns with all digits."""

    def write(header: Sequence[str], rows: np.ndarray, name: str) -> Path:
        with open(tmp_path / name, "w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows(np.asarray(rows).tolist())
        return tmp_path / name

    return write


@pytest.fixture
def read_csv(tmp_path: Path) -> Callable[[str], tuple[list[str], list[list[str]]]]:
    """Column names and cells of a file."""

    def read(name: str) -> tuple[list[str], list[list[str]]]:
        with open(tmp_path / name, newline="") as file:
            header, *rows = list(csv.reader(file))
        return header, rows

    return read
