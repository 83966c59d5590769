"""Published numbers beside the bundled jaws'."""

from __future__ import annotations

import json

import numpy as np
import pytest

import condyle
from condyle.analysis.literature import ROWS, Literature

pytestmark = pytest.mark.slow  # solves a chewing, and integrates two bites that are let go


@pytest.fixture(scope="module")
def found() -> Literature:
    return condyle.literature()


def ours(found: Literature, start: str) -> dict[str, float]:
    (one,) = [c for c in found.rows if c.row.what.startswith(start)]
    return one.ours


def test_every_row_has_numbers_and_a_source(found: Literature) -> None:
    assert len(found.rows) == len(ROWS)
    for c in found.rows:
        assert c.ours and np.isfinite(list(c.ours.values())).all(), c.row.what
        assert c.row.source and "[M]" not in c.row.source + c.row.theirs
        assert set(c.outside) <= set(c.ours)
        for text in (str(found), found.markdown):
            assert c.row.theirs in text and c.row.source in text and c.ours_text in text
    json.dumps(found.data, allow_nan=False)
    heads = {line.count("|") for line in found.markdown.splitlines()}
    assert heads == {5}


def test_numbers_that_other_tests_and_pages_have(found: Literature) -> None:
    """Static bites by the distribution's own test data; the inclination is the file's slope."""
    molar = ours(found, "Balancing joint's share of the joint loads, bite on one molar")
    assert molar["40 degrees"] == pytest.approx(25.2 / (25.2 + 18.5), abs=2e-3)
    assert list(molar.values())[:4] == sorted(list(molar.values())[:4], reverse=True)
    canine = ours(found, "Balancing joint's share of the joint loads, bite on one canine")
    assert canine["30 degrees"] > 0.5 > canine["40 degrees"]  # where the page says so
    assert ours(found, "Inclination")["human-jaw"] == pytest.approx(40.0, abs=1e-3)
    assert ours(found, "Inclination")["human-jaw-curved"] == pytest.approx(34.9, abs=0.1)
    largest = ours(found, "Largest bite on one molar")
    assert largest["human-jaw"] == pytest.approx(696, abs=1)


def test_a_bite_that_is_let_go(found: Literature) -> None:
    """Cables go on pulling; muscles are out of force within 12 ms, by their speed."""
    travel = ours(found, "Incisors' travel 12 ms")
    assert 4 < travel["human-jaw-muscles"] < 12 < 50 < travel["human-jaw"]
    left = ours(found, "Acceleration 12 ms")
    assert abs(left["human-jaw-muscles"]) < 0.05 < 1 < left["human-jaw"]
