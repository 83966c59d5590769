"""A fit derives a model at every step: here each graph is derived once in a process."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import pytest

from condyle.questions import Question

written = cache(Question.variants)


@pytest.fixture(autouse=True, scope="module")
def written_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Question, "variants", lambda question: written(question))
        yield
