"""Published numbers beside the bundled jaws'."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.speeds import first

import condyle
from condyle.analysis import literature
from condyle.analysis.literature import ROWS

DEAR = "chewing", "let go"  # solves a chewing, and integrates two bites that are let go
INCLINATION = "Inclination of the eminence at home, by the method of the smaller"
CHEAP = tuple(row for row in ROWS if not any(word in row.what for word in DEAR))


@pytest.mark.slow
@pytest.mark.parametrize("which", first(["cheap", "all"]))
def test_published_numbers(which: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each row has numbers and a source; some numbers other tests and pages have too."""
    rows = CHEAP if which == "cheap" else ROWS
    monkeypatch.setattr(literature, "ROWS", rows)
    found = condyle.literature()
    assert [c.row for c in found.rows] == [*rows]
    for c in found.rows:
        assert c.computed and np.isfinite(list(c.computed.values())).all(), c.row.what
        assert c.row.source and "[M]" not in c.row.source + c.row.published
        assert set(c.outside) <= set(c.computed)
        for text in (str(found), found.markdown):
            assert c.row.published in text and c.row.source in text and c.computed_text in text
    json.dumps(found.data, allow_nan=False)
    found.save(tmp_path / "rows.csv")
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 1 + len(rows)
    assert {line.count("|") for line in found.markdown.splitlines()} == {5}

    def computed(start: str) -> dict[str, float]:
        (one,) = [c for c in found.rows if c.row.what.startswith(start)]
        return one.computed

    # Static bites by the distribution's own test data; the inclination is the file's slope.
    molar = computed("Balancing joint's share of the joint loads, bite on one molar")
    assert molar["40 degrees"] == pytest.approx(25.2 / (25.2 + 18.5), abs=2e-3)
    assert list(molar.values())[:4] == sorted(list(molar.values())[:4], reverse=True)
    canine = computed("Balancing joint's share of the joint loads, bite on one canine")
    assert canine["30 degrees"] > 0.5 > canine["40 degrees"]  # where the page says so
    assert computed(INCLINATION)["human-jaw"] == pytest.approx(40.0, abs=1e-3)
    assert computed(INCLINATION)["human-jaw-curved"] == pytest.approx(34.9, abs=0.1)
    assert computed(INCLINATION)["human-jaw-nurbs"] == pytest.approx(9.25, abs=0.1)
    assert computed("Largest bite on one molar")["human-jaw"] == pytest.approx(696, abs=1)
    # Single numbers are marked too, and a rounded end of a range is none that is missed.
    marked = {c.row.what: c.outside for c in found.rows}
    ratio = "Load of both joints over a bite on one molar, eminences alone"
    assert "human-jaw" in marked[ratio] and computed(ratio)["human-jaw"] < 0.8 * 1.43
    assert (
        "curved"
        not in marked[
            "Balancing joint's share of the joint loads, bite on one canine, by the eminence"
        ]
    )
    assert all(re.search(r"\d{4}", c.row.source) for c in found.rows)  # a year or an identifier
    if rows is CHEAP:
        return
    # Cables go on pulling; muscles are out of force within 12 ms, by their speed.
    travel, left = computed("Incisors' travel 12 ms"), computed("Acceleration 12 ms")
    assert 4 < travel["human-jaw-muscles"] < 12
    assert "human-jaw" not in travel  # its teeth have met long before
    assert abs(left["human-jaw-muscles"]) < 0.05 < 1 < left["human-jaw"]
