"""The cases of a parametrised test, put apart by how often they run (CONTRIBUTING, *Testing*)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

slow, ci = pytest.mark.slow, pytest.mark.ci


def few(cases: Iterable[Any], *kept: Any, rest: pytest.MarkDecorator = ci) -> list[Any]:
    """All cases; `kept` stand for the others in quicker runs, the others have the mark `rest`."""
    cases = [*cases]
    assert all(case in cases for case in kept), f"no case: {kept}"
    return [case if case in kept else _marked(case, rest) for case in cases]


def first(cases: Iterable[Any], count: int = 1, rest: pytest.MarkDecorator = ci) -> list[Any]:
    """All cases; the first `count` stand for the others in quicker runs."""
    cases = [*cases]
    return cases[:count] + [_marked(case, rest) for case in cases[count:]]


def _marked(case: Any, mark: pytest.MarkDecorator) -> Any:
    return pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=mark)
