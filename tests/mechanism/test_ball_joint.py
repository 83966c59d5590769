"""A ball joint of a file: three contacts, whose forces are its reactions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism
from oracles.rotations import bryant
from support.families import Case, close, of_raw

import condyle
from condyle.errors import CondyleError
from condyle.mechanism import Mechanism, parse
from condyle.mechanism.ball_joint import BallJoint, joined
from condyle.mechanism.files import from_data
from condyle.mechanism.library import bundled_text

HELD = ("X", "Y", "Z", "alpha", "gamma")
PROSTHESIS = bundled_text("human-jaw-prosthesis")


@pytest.fixture(scope="module")
def jointed() -> Case:
    return of_raw(random_mechanism(np.random.default_rng(4), surface=("ball", "quadratic")))


def test_it_is_three_contacts_and_one_table_of_the_file() -> None:
    jaw = parse(PROSTHESIS)
    assert jaw.degrees_of_freedom == 2
    names = [f"left_condyle_{axis}" for axis in "xyz"]
    assert jaw.contact_names == (*names, "right_condyle")
    assert 'kind = "ball"' in condyle.dumps(jaw) and parse(condyle.dumps(jaw)) == jaw
    assert "1 ball (left_condyle), 1 plane" in str(jaw)
    joint, _ = joined(jaw.contacts)
    assert isinstance(joint, BallJoint) and joint.point == jaw.contacts[0].point
    moved = jaw.set({f"contact.{name}.point": (-0.04, 0.05, 0.04) for name in names}, keep="home")
    assert joined(moved.contacts)[0].point == (-0.04, 0.05, 0.04)
    lone = jaw.set("contact.left_condyle_x.friction.coefficient", 0.1)
    assert "ball" not in condyle.dumps(lone) and parse(condyle.dumps(lone)) == lone


def test_what_it_cannot_have_is_refused() -> None:
    for line, words in (
        ("one_sided = true", "one_sided: a ball joint has a name, its kind and a point"),
        ("friction = { coefficient = 0.1 }", "friction: a ball joint has"),
        ("colour = 1", "colour: is not a key"),
    ):
        with pytest.raises(CondyleError, match=words):
            parse(PROSTHESIS.replace('kind = "ball"', f'kind = "ball"\n{line}'))
    for point, words in (("[1, 2]", "is missing"), ("[1, 2, true]", "expected a number")):
        text = PROSTHESIS.replace("point = [-40.98, 51.78, 43.56]", f"point = {point}")
        with pytest.raises(CondyleError, match="left_condyle.*" + words):
            parse(text)
    data = {
        "contact": [
            {"kind": "ball", "name": n, "point": [0, y, 0]} for n, y in (("a", 0), ("b", 1))
        ]
    }
    with pytest.raises(CondyleError, match="two ball joints"):
        from_data(data)


def test_two_joints_that_slide_are_a_hinge() -> None:
    """Five coordinates held, at two points of an axis along Y: beta alone is free."""
    jaw = parse(PROSTHESIS)
    point = jaw.contacts[3].point
    held: list[Any] = [*jaw.contacts[:3]]
    for axis, x in (("x", point[0]), ("z", point[2])):
        surface = {"kind": "coordinate", "axis": axis, "offset": x}
        held.append({"name": f"right_{axis}", "point": point, "surface": surface})
    hinge = Mechanism(**{**jaw.entries(), "contact": held, "dependent": HELD})
    model = condyle.derive(hinge, backend="numpy")
    assert model.independent == ("beta",)
    pose = model.inverse_dynamics([0.1], [0.0], [0.0], outputs="all").pose
    r = np.array(point)
    turned = (
        np.array([[np.cos(0.1), 0, np.sin(0.1)], [0, 1, 0], [-np.sin(0.1), 0, np.cos(0.1)]]) @ r
    )
    close(pose[:3], r - turned, 1e-12)


def test_its_centre_stays_and_every_backend_and_derivative_agrees(jointed: Case) -> None:
    c = jointed
    ours = c.evaluate()
    assert (ours.status == 0).all()
    compiled = c.evaluate(backend="compiled")
    close(compiled.contact_force, ours.contact_force, 1e-11)
    for choice in (("newton_euler",), ("lagrange",), ("momentum",)):
        close(c.evaluate(*choice).contact_force, ours.contact_force, 1e-9)
    centre = np.array(c.mechanism.contacts[0].point)
    found = ours.pose[:, :3] + np.array([bryant(x) @ centre for x in ours.pose[:, 3:]])
    close(found, np.tile(centre, (len(found), 1)), 1e-12)
    q, v, a = (c.states[key][2:3] for key in ("q", "qd", "qdd"))
    path = "contact.left_condyle_y.point[2]"  # its own surface, of another axis, stays
    model, step = c.model(), 1e-6
    exact = model.derivatives("contact_force", ("q", path), q=q, v=v, a=a)
    for j, unit in enumerate(np.eye(q.shape[1])):
        high, low = (model.inverse_dynamics(q + s * step * unit, v, a) for s in (1, -1))
        slope = (high.contact_force - low.contact_force) / (2 * step)
        close(exact["contact_force", "q"][..., j], slope, 1e-6)
    high, low = (
        condyle.derive(c.mechanism.set(path, c.mechanism.get(path) + s * step), backend="numpy")
        .inverse_dynamics(q, v, a)
        .contact_force
        for s in (1, -1)
    )
    close(exact["contact_force", path], (high - low) / (2 * step), 1e-6)
