"""Equations of one structure are written once, and serve all models of a module."""

from collections.abc import Iterator
from functools import cache

import pytest

from condyle.questions import Question

written = cache(Question.variants)


@pytest.fixture(scope="module", autouse=True)
def written_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CONDYLE_BACKEND", "numpy")
        patch.setattr(Question, "variants", lambda question: written(question))
        yield
