"""Inverse dynamics on curved surfaces: the oracle, and surfaces that coincide."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles import newton_euler
from oracles.random_mechanism import random_mechanism, random_state
from support.loads import load_point_of, parts
from support.surfaces import close

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data
from condyle.mechanism.surface import Expression, Plane, Profile, Quadratic
from condyle.model.model import Model
from condyle.model.model_result import ModelResult

pytestmark = pytest.mark.slow

COUNT = 4
MECHANISMS: dict[str, dict[str, Any]] = {
    "every_kind": {"surface": "mixed", "contacts": 5, "chains": 8},
    "quadratics": {"surface": "quadratic", "contacts": 3},
    "balls": {"surface": ("ellipsoid", "quadratic"), "ball_radius": 4.0},
    "balls_round": {"surface": ("sphere", "cylinder"), "ball_radius": 8.0},
    "one_profile": {"surface": "profile", "contacts": 1},
}


def evaluate(mechanism: Mechanism, states: dict[str, Any], **choices: str) -> ModelResult:
    """At the oracles' states, given in any coordinates."""
    model = Model(mechanism, **choices, backend="numpy")
    q = model.poses.states(states["names"], tuple(states[key] for key in ("q", "qd", "qdd")))
    point = load_point_of(model, states["load_point"])
    load = np.hstack([states["wrench"], np.tile(point, (len(q[0]), 1))])
    return model.inverse_dynamics(*q, *parts(load), outputs=("pose", "pose_acceleration"))


@pytest.mark.parametrize(
    ("name", "formulation"), [*zip(MECHANISMS, FORMULATIONS, strict=True)], ids=[*MECHANISMS]
)
def test_newton_and_euler_of_free_bodies(name: str, formulation: str) -> None:
    rng = np.random.default_rng(sum(map(ord, name)))
    raw = random_mechanism(rng, **MECHANISMS[name])
    states = random_state(rng, raw, COUNT)
    got = evaluate(from_data(raw), states, formulation=formulation)
    assert (got.status == 0).all()
    close(got.pose, states["pose"], 1e-12)
    close(got.pose_acceleration, states["pose_acceleration"], 1e-11)
    for i in range(COUNT):
        keys = ("pose", "pose_rate", "pose_acceleration", "wrench")
        sample = (states[key][i] for key in keys)
        wanted = newton_euler.inverse_dynamics(raw, *sample, states["load_point"])
        close(got.effort[i], wanted["tau"], 1e-11)
        close(got.contact_force[i], wanted["contact"], 1e-10)


@pytest.fixture(scope="module")
def states() -> dict[str, Any]:
    """The same independent states for every variant of the bundled mechanism."""
    rng = np.random.default_rng(8)
    scale = np.array([0.002, 0.002, 0.04, 0.04])
    return {
        "names": ("X", "Y", "alpha", "beta"),
        "q": rng.uniform(-1, 1, (COUNT, 4)) * scale,
        "qd": rng.normal(0, 10, (COUNT, 4)) * scale,
        "qdd": rng.normal(0, 300, (COUNT, 4)) * scale,
        "wrench": rng.normal(0, 10, (COUNT, 6)) * [1, 1, 1, 0.05, 0.05, 0.05],
        "load_point": "right_molar",
    }


@pytest.fixture(scope="module")
def planes(reference: Mechanism, states: dict[str, Any]) -> ModelResult:
    """What the bundled mechanism does on its own planes."""
    return evaluate(reference, states)


def on(reference: Mechanism, *surfaces: Any, **options: Any) -> Mechanism:
    """The bundled mechanism on other surfaces."""
    contacts = tuple(
        type(c)(name=c.name, point=c.point, surface=s, **options)
        for c, s in zip(reference.contacts, surfaces, strict=True)
    )
    return reference.replace(contacts=contacts)


def same(got: ModelResult, wanted: ModelResult, tolerance: float) -> None:
    for name in ("pose", "pose_acceleration", "effort", "contact_force"):
        close(getattr(got, name), getattr(wanted, name), tolerance)


SOCKET = {"offset": 0.013215, "slope": (-1.1, 0.0)}
RADIUS = 0.004
WALL = {"offset": 0.013215 + RADIUS * np.hypot(1.0, 1.1), "slope": (-1.1, 0.0)}
LINE = tuple((x, 0.013215 - 1.1 * x) for x in (-0.04, -0.02, 0.0))
BALL = {"side": "below", "ball_radius": RADIUS}  # the skull is above the ball


@pytest.mark.parametrize(
    ("surface", "options"),
    [
        (Quadratic(**SOCKET), {}),
        (Profile(direction=(1.0, 0.0), points=LINE), {}),
        (Expression(lambda p: 2 * (p[2] + 1.1 * p[0]) - 0.02643), {}),  # phi has no fixed scale
        (Plane(**WALL), BALL),
    ],
    ids=["quadratic", "profile", "expression", "ball"],
)
def test_surfaces_that_are_the_plane(
    reference: Mechanism, states: Any, planes: ModelResult, surface: Any, options: Any
) -> None:
    """Without second order, and balls whose centres stay on it: equal to rounding."""
    same(evaluate(on(reference, surface, surface, **options), states), planes, 1e-12)


def test_direct_route_names_the_core(
    reference: Mechanism, states: dict[str, Any], planes: ModelResult
) -> None:
    with pytest.raises(condyle.UnsupportedError, match=r"quadratic, quadratic.*Use route core"):
        condyle.derive("masticatory-curved", route="direct")
    walls = on(reference, Plane(**WALL), Plane(**WALL), **BALL)
    same(evaluate(walls, states, formulation="momentum", route="direct"), planes, 1e-12)
