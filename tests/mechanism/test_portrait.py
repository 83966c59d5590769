"""Objects on a console and in a notebook's cell: a few lines, well-formed, whatever the names."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.machines import model

import condyle
from condyle.mechanism import Mechanism, parse
from condyle.mechanism.cells import curves, table
from condyle.mechanism.home import dependent_coordinates
from condyle.mechanism.surface import UnknownSurface
from condyle.report.scene import parts_of, place, rgb, tint_of
from condyle.simulation.scenario import Scenario

HOSTILE = "<script>alert(1)</script>"


def drawn(markup: str) -> ElementTree.Element:
    return ElementTree.fromstring(f"<div>{markup}</div>")


def text_of(markup: str) -> str:
    return "".join(drawn(markup).itertext())


def test_the_reference(reference: Mechanism) -> None:
    assert repr(reference) == str(reference)
    assert repr(reference).splitlines() == [
        'Mechanism "masticatory": 4 degrees of freedom (X, Y, alpha, beta; dependent Z, gamma)',
        "  chains: 6 RSS (temporalis_left, temporalis_right, masseter_left, masseter_right, "
        "pterygoid_left, pterygoid_right)",
        "  contacts: 2 plane (left_condyle, right_condyle)",
        "  platform: 0.2 kg, radii of gyration 21.5, 25, 30.2 mm",
    ]


def test_a_flat_machine_is_seen_from_its_broad_side() -> None:
    robot = condyle.load_mechanism("cable-robot")
    ends = {
        f"chain.{c.name}.{end}": getattr(c, end)
        for c in robot.chains
        for end in ("base", "platform")
    }
    views = []
    for part in (1.0, 0.01):
        one = robot.set({f"{what}[1]": part * at[1] for what, at in ends.items()})
        home = place(one, np.zeros((1, 6)), np.zeros((1, len(one.chains))))
        views.append(parts_of(one, home).view)
    assert views == ["Oblique", "Side"]


def test_freedoms_and_families() -> None:
    for contacts in (0, 3, 5):
        rng = np.random.default_rng(contacts)
        raw = random_mechanism(rng, families=("RSS", "PSS", "SPS"), contacts=contacts)
        machine = parse(toml_text(raw))
        first, chains, *_ = repr(machine).splitlines()
        assert f"{6 - contacts} degree" in first
        assert all(name in first for name in dependent_coordinates(machine))
        kinds = [chain.kind for chain in machine.chains]
        assert all(f"{kinds.count(kind)} {kind} (" in chains for kind in kinds)


def test_many_chains_and_drafts(reference: Mechanism) -> None:
    """Not all are named; a note stands in the place of a surface; contacts may hold nothing."""
    first = reference.chains[0]
    copies = [first.model_copy(update={"name": f"c{k}"}) for k in range(50)]
    text = repr(reference.replace(chains=copies))
    assert "50 RSS (c0, c1," in text and "c9 and 40 more)" in text and len(text) < 600
    left, right = reference.contacts
    noted = reference.derived(
        contacts=(left.model_copy(update={"surface": UnknownSurface()}), right)
    )
    assert "4 degrees of freedom\n" in repr(noted) and "1 expression (left_condyle)" in repr(noted)
    loose = reference.derived(contacts=(left, left))
    assert "4 degrees of freedom\n" in repr(loose)


def test_a_cell_is_whole_and_says_what_it_is(reference: Mechanism) -> None:
    for shown, words in (
        (reference, ("masticatory", "6 RSS")),
        (model("masticatory"), ("virtual_power", "beta")),
        (condyle.reference_motion(), ("x, y, z of incisor", "5001 from 0 to 5 s")),
        (condyle.reference_load(), ("right_molar", "N m")),
        (Scenario(duration=2.0, method="Radau"), ("2 s at 1000 Hz", "Radau")),
    ):
        assert all(word in text_of(shown._repr_html_()) for word in words)


def test_names_of_strangers_stay_text(reference: Mechanism) -> None:
    machine = reference.set({"name": HOSTILE, "chain.masseter_left.name": "<b>left"})
    texts = [text.strip() for text in drawn(machine._repr_html_()).itertext()]
    assert HOSTILE in texts and any("<b>left" in text for text in texts)
    assert {"freedoms", "chains", "contacts", "platform"} <= set(texts)
    for markup in (table(HOSTILE, HOSTILE, [(HOSTILE, HOSTILE)]), curves(np.eye(2), [HOSTILE, ""])):
        assert "<script>" not in markup and HOSTILE in text_of(markup)
    t = np.linspace(0, 1, 10)
    motion = condyle.Motion.from_arrays(t, np.outer(t, [1e-3] * 3), ("x", "y", "z"), source=HOSTILE)
    assert "<script>" not in motion._repr_html_()


def test_a_curve_goes_through_its_samples() -> None:
    values = np.array([[0.0], [1.0], [np.nan], [0.5]])
    (line,) = drawn(curves(values, ["a"])).iter("polyline")
    y = [float(point.split(",")[1]) for point in line.attrib["points"].split()]
    assert len(y) == 3 and y[0] - y[1] == pytest.approx(2 * (y[2] - y[1]), abs=0.11)


def test_pictures_have_every_chain_and_contact() -> None:
    """By their colours, which light and shade make darker alone."""
    for name in ("masticatory", "gough-stewart", "cable-robot", "human-jaw-muscles"):
        machine = condyle.load_mechanism(name)
        (picture,) = drawn(machine._repr_html_()).iter("svg")
        paths = [*picture.iter("path")]
        fills = {path.attrib["fill"] for path in paths}
        scene = place(machine, np.zeros((1, 6)), np.zeros((1, len(machine.chains))))
        for solid in parts_of(machine, scene).of_group("chains", "balls"):
            pure = np.array(rgb(tint_of(solid.colour)))
            shades = [(np.max(rgb(fill)) / pure.max(), rgb(fill)) for fill in fills]
            assert any(0.5 < s <= 1 and abs(fill - s * pure).max() <= 1 for s, fill in shades)
        width, height = (float(n) for n in picture.attrib["viewBox"].split()[2:])
        starts = np.array([re.findall(r"M(\d+) (\d+)", path.attrib["d"])[0] for path in paths])
        assert (starts.astype(float) <= [width, height]).all() and len(starts) > 100
