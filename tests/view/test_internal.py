"""Internal efforts in the live view, against statics by hand."""

from __future__ import annotations

import numpy as np
import pytest

import condyle
from condyle.errors import InputError
from condyle.view.readout import effects_html, internal_text, tables_html
from condyle.view.session import MOST_INTERNAL, Session


@pytest.fixture(scope="module")
def jaw() -> condyle.Mechanism:
    return condyle.load_mechanism("human-jaw")


def test_cables_and_contacts_balance_by_hand(jaw: condyle.Mechanism) -> None:
    """Pulls along the lines of the muscles, and pushes along the normals, add up to nothing."""
    session = Session(jaw)
    found = session.directions()
    assert found.effort.shape == (24, 20) and found.contact.shape == (2, 20)
    total = np.zeros((6, 20))
    for i, chain in enumerate(jaw.chains):
        at = np.array(chain.platform)
        pull = np.subtract(chain.base, at) / np.linalg.norm(np.subtract(chain.base, at))
        total += np.outer([*pull, *np.cross(at, pull)], found.effort[i])
    for k, contact in enumerate(jaw.contacts):
        slope = contact.surface.slope
        normal = np.array([-slope[0], -slope[1], 1.0])
        normal /= np.linalg.norm(normal)
        total += np.outer([*normal, *np.cross(contact.point, normal)], found.contact[k])
    assert abs(total).max() < 1e-10
    assert np.linalg.matrix_rank(found.effort) == 20
    assert np.allclose(abs(found.effort).max(axis=0), 1.0)
    # Two contacts: two directions load them, the others leave them alone.
    assert (abs(found.contact[:, :2]) > 1).all() and not found.contact[:, 2:].any()


@pytest.mark.parametrize(("name", "count"), [("masticatory", 2), ("hexaglide", 1)])
def test_directions_do_no_work_at_any_pose(name: str, count: int) -> None:
    session = Session(condyle.load_mechanism(name))
    session.set_coordinate("beta", 0.08)
    session.snapshot()
    model = session.model
    J = model.jacobians(session.q[None])
    A = (J.J_theta @ J.M_J)[0]
    found = session.directions()
    assert found.count == len(session.internal) == count == len(A) - A.shape[1]
    assert abs(A.T @ found.effort).max() < 1e-9 * abs(A).max()


def test_sliders_keep_their_meaning_along_a_motion(jaw: condyle.Mechanism) -> None:
    session = Session(jaw)
    before = session.directions()
    for beta in np.linspace(0, 0.2, 21)[1:]:
        session.set_coordinate("beta", beta)
        session.snapshot()
        now = session.directions()
        assert abs(now.effort - before.effort).max() < 0.15
        before = now


def test_internal_efforts_add_to_efforts_and_contacts_live(reference: condyle.Mechanism) -> None:
    session = Session(reference)
    before = session.snapshot()
    session.set_internal(0, 0.5)
    after = session.snapshot()
    found = session.directions()
    assert np.allclose(after.effort - before.effort, 0.5 * found.effort[:, 0], atol=1e-12)
    assert np.allclose(after.contact_force - before.contact_force, 0.5 * found.contact[:, 0])
    assert np.allclose(np.linalg.norm(after.force_vector, axis=1), abs(after.contact_force))
    assert after.over == () and np.array_equal(after.pose, before.pose)
    session.set_internal(0, 3.5)
    beyond = session.snapshot()
    assert beyond.level == "warning" and len(beyond.over) >= 1
    assert any(f"{beyond.over[0]} is above its effort limit" in m for m in beyond.messages)
    assert "⚠" in tables_html(beyond) and "⚠" not in tables_html(after)
    with pytest.raises(InputError, match="has 2, counted from 0"):
        session.set_internal(2, 1.0)


def test_a_muscle_that_would_push_is_named(jaw: condyle.Mechanism) -> None:
    session = Session(jaw)
    session.set_internal(0, 20.0)
    snapshot = session.snapshot()
    pushing = {name for name, t in zip(jaw.chain_names, snapshot.effort, strict=True) if t < 0}
    assert pushing and pushing <= set(snapshot.over)
    [told] = [message for message in snapshot.messages if message.startswith("Slack")]
    assert told.endswith(f"and {len(pushing) - 4} more") and told.count(" N)") == 4
    assert tables_html(snapshot).count("slack") == len(pushing)


def test_what_no_muscles_can_hold_is_called_infeasible(jaw: condyle.Mechanism) -> None:
    session = Session(jaw)
    session.set_load(np.array([0.0, 0.0, -5000.0]), "right_molar")
    snapshot = session.snapshot()
    assert np.isnan(snapshot.effort).all() and snapshot.over == ()
    assert snapshot.messages == ("Infeasible: no efforts within the limits balance the load",)


def test_no_directions_without_redundancy() -> None:
    session = Session(condyle.load_mechanism("gough-stewart"))
    assert session.directions().count == len(session.internal) == 0
    assert "No actuation redundancy" in internal_text(0, 0)


def test_words_say_what_has_no_slider(jaw: condyle.Mechanism) -> None:
    session = Session(jaw)
    assert "20 directions" in internal_text(20, MOST_INTERNAL)
    assert "of which 6 have a slider" in internal_text(20, MOST_INTERNAL)
    assert internal_text(2, 2).startswith("2 directions") and "of which" not in internal_text(2, 2)
    session.set_internal(1, 2.0)
    html = effects_html(jaw, session.directions(), session.internal, MOST_INTERNAL)
    assert html.count("<tr>") == 1 + MOST_INTERNAL + 1 + 24
