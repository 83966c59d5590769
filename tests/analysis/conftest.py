"""Studies run by numpy."""

from collections.abc import Iterator

import pytest


@pytest.fixture(scope="module", autouse=True)
def by_numpy() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CONDYLE_BACKEND", "numpy")
        yield
