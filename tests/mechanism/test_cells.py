"""What objects show in a notebook's cell: well-formed, escaped, with the numbers they stand for."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.mechanism.cells import curves, table
from condyle.simulation.scenario import Scenario

HOSTILE = "<script>alert(1)</script>"


def parsed(markup: str) -> ElementTree.Element:
    return ElementTree.fromstring(f"<div>{markup}</div>")


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        (lambda: condyle.load_mechanism("masticatory"), ("masticatory", "6 RSS")),
        (lambda: condyle.derive("masticatory", backend="numpy"), ("virtual_power", "beta")),
        (condyle.reference_motion, ("x, y, z of incisor", "5001 from 0 to 5 s")),
        (condyle.reference_load, ("right_molar", "N m")),
        (lambda: Scenario(duration=2.0, method="Radau"), ("2 s at 1000 Hz", "Radau")),
    ],
    ids=["mechanism", "model", "motion", "load", "scenario"],
)
def test_a_cell_is_whole_and_says_what_it_is(shown: Any, words: tuple[str, ...]) -> None:
    text = "".join(parsed(shown()._repr_html_()).itertext())
    assert all(word in text for word in words)


def test_names_of_strangers_stay_text() -> None:
    names = [HOSTILE, "b"]
    for markup in (table(HOSTILE, HOSTILE, [(HOSTILE, HOSTILE)]), curves(np.eye(2), names)):
        assert "<script>" not in markup and HOSTILE in "".join(parsed(markup).itertext())
    t = np.linspace(0, 1, 10)
    motion = condyle.Motion.from_arrays(t, np.outer(t, [1e-3] * 3), ("x", "y", "z"), source=HOSTILE)
    assert "<script>" not in motion._repr_html_()


def test_a_curve_goes_through_its_samples() -> None:
    values = np.array([[0.0], [1.0], [np.nan], [0.5]])
    (line,) = parsed(curves(values, ["a"])).iter("polyline")
    y = [float(point.split(",")[1]) for point in line.attrib["points"].split()]
    assert len(y) == 3 and y[0] - y[1] == pytest.approx(2 * (y[2] - y[1]), abs=0.11)


@pytest.mark.parametrize("name", condyle.mechanism.bundled_mechanisms())
def test_every_bundled_mechanism_has_a_picture(name: str) -> None:
    machine = condyle.load_mechanism(name)
    drawn = parsed(machine._repr_html_())
    assert len([*drawn.iter("line")]) >= len(machine.chains)
    assert len([*drawn.iter("circle")]) == len(machine.contacts)
    (picture,) = drawn.iter("svg")
    size = [float(picture.attrib[key]) for key in ("width", "height")]
    places = [(float(one.attrib[a]), float(one.attrib[b])) for one in drawn.iter("line")
              for a, b in (("x1", "y1"), ("x2", "y2"))]  # fmt: skip
    assert (np.array(places) >= 0).all() and (np.array(places) <= size).all()
