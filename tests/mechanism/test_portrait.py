"""A mechanism on a console and in a notebook: a few lines, whatever it is called."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text

import condyle
from condyle.mechanism import Mechanism, parse
from condyle.mechanism.files import from_data
from condyle.mechanism.home import dependent_coordinates
from condyle.mechanism.surface import Unknown


class Cells(HTMLParser):
    """Texts and tags of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.open: list[str] = []
        self.feed(page)
        self.close()

    def handle_starttag(self, tag: str, attrs: object) -> None:
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def test_the_reference(reference: Mechanism) -> None:
    assert repr(reference) == str(reference)
    assert repr(reference).splitlines() == [
        'Mechanism "masticatory": 4 degrees of freedom (X, Y, alpha, beta; dependent Z, gamma)',
        "  chains: 6 RSS (temporalis_left, temporalis_right, masseter_left, masseter_right, "
        "pterygoid_left, pterygoid_right)",
        "  contacts: 2 plane (left_condyle, right_condyle)",
        "  platform: 0.2 kg, radii of gyration 21.5, 25, 30.2 mm",
    ]


@pytest.mark.parametrize("contacts", range(6))
def test_freedoms_and_families(contacts: int) -> None:
    raw = random_mechanism(np.random.default_rng(contacts), contacts=contacts)
    machine = parse(toml_text(raw))
    first, chains, *_ = repr(machine).splitlines()
    assert f"{6 - contacts} degree" in first
    assert all(name in first for name in dependent_coordinates(machine))
    for kind in {chain.kind for chain in machine.chains}:
        count = sum(chain.kind == kind for chain in machine.chains)
        assert f"{count} {kind} (" in chains


def test_many_chains_are_not_all_named(reference: Mechanism) -> None:
    copies = [
        c.model_copy(update={"name": f"c{k}"}) for k in range(50) for c in reference.chains[:1]
    ]
    text = repr(reference.replace(chains=copies))
    assert "50 RSS (c0, c1," in text and "c9 and 40 more)" in text and len(text) < 600


def test_drafts_have_a_portrait_too(reference: Mechanism) -> None:
    """A note in the place of a surface, and contacts that hold nothing."""
    left, right = reference.contacts
    noted = reference.derived(contacts=(left.model_copy(update={"surface": Unknown()}), right))
    assert "4 degrees of freedom\n" in repr(noted) and "1 expression (left_condyle)" in repr(noted)
    held = from_data(
        {**condyle.mechanism.files.read_tables(condyle.dumps(reference), "m"), "dependent": None},
        at_home=False,
    )
    loose = held.derived(contacts=(left, left))
    assert "4 degrees of freedom\n" in repr(loose)


def test_in_a_notebook(reference: Mechanism) -> None:
    name = '<img src="x" onerror="alert(1)">'.replace('"', "'")
    machine = reference.set({"name": name, "chain.masseter_left.name": "<b>left"})
    cells = Cells(machine._repr_html_())
    assert cells.open == [] and name in cells.texts
    assert any("<b>left" in text for text in cells.texts)
    assert {"freedoms", "chains", "contacts", "platform"} <= set(cells.texts)
