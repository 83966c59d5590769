"""Words of a jaw on a jaw's pages; those of a machine on a machine's."""

from __future__ import annotations

import matplotlib as mpl
import pytest
import xarray as xr
from support.report_pages import Elements, payload

import condyle
from condyle.motion import Motion, bundled_reference
from condyle.report.figures import PLOTS
from condyle.report.naming import words_of
from condyle.report.page import report_html
from condyle.view.readout import tables_html
from condyle.view.session import Session

MACHINES = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide")
FOREIGN = ("chain", "actuator", "effort", "contact", "platform")


def chewed(name: str) -> xr.Dataset:
    motion = Motion.from_csv(bundled_reference()[0], rate=20)
    return condyle.derive(name, backend="numpy").solve(motion, condyle.reference_load())


@pytest.fixture(scope="module")
def jaw() -> xr.Dataset:
    return chewed("human-jaw-muscles")


def test_a_text_in_the_words_of_a_machine() -> None:
    say = words_of(condyle.load_mechanism("human-jaw"))
    assert say("Efforts of the actuators") == "Forces of the muscles"
    assert say("Contact forces on the platform") == "Joint forces on the jaw"
    assert say("Joint coordinates") == "Shortening" and say("joint") == "shortening"
    assert say("left_contact and chain_2") == "left_contact and chain_2", "parts of a name"
    for name in MACHINES:
        say = words_of(condyle.load_mechanism(name))
        text = "Efforts of the actuators; Contact, chain, joint"
        assert say(text) is text


def test_a_page_of_a_jaw_speaks_of_muscles_and_joints(jaw: xr.Dataset) -> None:
    page = report_html(jaw)
    drawn, text = payload(page), Elements(page).text
    for panel in drawn["panels"]:
        said = f"{panel['title']} {panel['note']} {panel['axes'][1]}".lower()
        assert not any(word in said for word in FOREIGN), said
    shown = text.split("What was run")[0]
    for word in ("Muscles", "Activation", "Joints and load", "Peaks of each muscle", "Peak force"):
        assert word in shown
    assert drawn["words"]["Chain"] == "Muscle" and drawn["words"]["Contact"] == "Joint"


def test_a_page_of_a_machine_keeps_its_words() -> None:
    page = report_html(chewed("masticatory"))
    drawn, text = payload(page), Elements(page).text
    assert all(said == key for key, said in drawn["words"].items())
    for word in ("Chains", "Actuators", "Contacts and load", "Contact tracks", "Peak effort"):
        assert word in text
    assert {"Contact force along the normal", "Actuator torque", "Platform position"} <= {
        panel["title"] for panel in drawn["panels"]
    }


@pytest.mark.parametrize("name", ["effort", "joint", "activation", "contact_force", "share"])
def test_figures_of_a_jaw_have_its_words(name: str, jaw: xr.Dataset) -> None:
    texts = PLOTS[name](jaw).findobj(mpl.text.Text)
    said = " | ".join(t.get_text() for t in texts if "Mechanism" not in t.get_text()).lower()
    assert not any(word in said for word in FOREIGN), said


def test_the_live_page_of_a_jaw_has_its_words() -> None:
    tables = tables_html(Session(condyle.load_mechanism("human-jaw")).snapshot())
    for word in ("Muscle", "shortening", "force", "Joint"):
        assert f">{word}</th>" in tables
    assert ">Chain</th>" not in tables
