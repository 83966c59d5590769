"""How long the fuzzers run: `pytest tests/fuzz --fuzz-runs 100000 --fuzz-seed 7`."""

from __future__ import annotations

import pytest

SHORT = 50  # of the normal tests


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--fuzz-runs", type=int, default=SHORT, help="Broken files of each kind.")
    parser.addoption("--fuzz-seed", type=int, default=0, help="Number of the first one.")


@pytest.fixture
def fuzz_runs(request: pytest.FixtureRequest) -> int:
    """Files to try."""
    return int(request.config.getoption("--fuzz-runs", default=SHORT))


@pytest.fixture
def fuzz_seeds(request: pytest.FixtureRequest) -> range:
    """Seeds, one a run; a run that fails can be repeated with its seed alone."""
    first = request.config.getoption("--fuzz-seed", default=0)
    return range(first, first + request.config.getoption("--fuzz-runs", default=SHORT))


@pytest.fixture
def few_seeds(fuzz_seeds: range) -> range:
    """The same for files that take long to open: a fifth of them."""
    return fuzz_seeds[: max(len(fuzz_seeds) // 5, 1)]
