"""Inverse dynamics on curved surfaces: the oracle, the formulations, and surfaces that coincide."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles import newton_euler
from oracles.random_mechanism import random_mechanism, random_state
from support.loads import load_point_of, parts
from support.speeds import few, slow
from support.surfaces import close

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data
from condyle.mechanism.surface import Expression, Plane, Profile, Quadratic, Sphere
from condyle.model.model import Model
from condyle.model.model_result import ModelResult

pytestmark = pytest.mark.slow

COUNT = 4
MECHANISMS: dict[str, dict[str, Any]] = {
    "quadratic": {"surface": "quadratic"},
    "quadratic_k3": {"surface": "quadratic", "contacts": 3},
    "quadratic_k1": {"surface": "quadratic", "contacts": 1},
    "sphere": {"surface": "sphere"},
    "cylinder": {"surface": "cylinder"},
    "ellipsoid": {"surface": "ellipsoid", "contacts": 3},
    "profile": {"surface": "profile"},
    "every_kind": {"surface": "mixed", "contacts": 5, "chains": 8},
    "balls": {"surface": ("ellipsoid", "quadratic", "plane"), "contacts": 3, "ball_radius": 4.0},
    "balls_round": {"surface": ("sphere", "cylinder"), "ball_radius": 8.0},
}


def interpreted(mechanism: Mechanism, **choices: str) -> Model:
    """A model by the interpreter: what is tested here is the mathematics, not its compilation."""
    return Model(mechanism, **choices, backend="numpy")


def evaluate(model: Model, states: dict[str, Any]) -> ModelResult:
    """At the oracles' states, given in any coordinates."""
    motion = (states[key] for key in ("q", "qd", "qdd"))
    q, q1, q2 = model.poses.states(states["names"], tuple(motion))
    point = load_point_of(model, states["load_point"])
    load = np.hstack([states["wrench"], np.tile(point, (len(q), 1))])
    return model.inverse_dynamics(q, q1, q2, *parts(load), outputs="all")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("every_kind", marks=slow),
        *few([name for name in MECHANISMS if name != "every_kind"], "quadratic_k1"),
    ],
)
def test_oracle_and_formulations(name: str) -> None:
    rng = np.random.default_rng(sum(map(ord, name)))
    raw = random_mechanism(rng, **MECHANISMS[name])
    states = random_state(rng, raw, COUNT)
    mechanism = from_data(raw)
    for formulation in FORMULATIONS:
        got = evaluate(interpreted(mechanism, formulation=formulation), states)
        assert (got.status == 0).all()
        close(got.pose, states["pose"], 1e-12)
        close(got.pose_acceleration, states["pose_acceleration"], 1e-11)
        for i in range(COUNT):
            keys = ("pose", "pose_rate", "pose_acceleration", "wrench")
            wanted = newton_euler.inverse_dynamics(
                raw, *(states[key][i] for key in keys), states["load_point"]
            )
            close(got.effort[i], wanted["tau"], 1e-11)
            close(got.contact_force[i], wanted["contact"], 1e-10)


def masticatory_states(count: int = 6) -> dict[str, Any]:
    """The same independent states for every variant of the bundled mechanism."""
    rng = np.random.default_rng(8)
    scale = np.array([0.002, 0.002, 0.04, 0.04])
    return {
        "names": ("X", "Y", "alpha", "beta"),
        "q": rng.uniform(-1, 1, (count, 4)) * scale,
        "qd": rng.normal(0, 10, (count, 4)) * scale,
        "qdd": rng.normal(0, 300, (count, 4)) * scale,
        "wrench": rng.normal(0, 10, (count, 6)) * [1, 1, 1, 0.05, 0.05, 0.05],
        "load_point": "right_molar",
    }


def with_surfaces(reference: Mechanism, *surfaces: Any, **options: Any) -> Mechanism:
    """The bundled mechanism on other surfaces."""
    contacts = tuple(
        type(c)(name=c.name, point=c.point, surface=s, **options)
        for c, s in zip(reference.contacts, surfaces, strict=True)
    )
    return reference.replace(contacts=contacts)


def same(got: ModelResult, wanted: ModelResult, tolerance: float) -> None:
    close(got.pose, wanted.pose, tolerance)
    close(got.pose_acceleration, wanted.pose_acceleration, tolerance)
    close(got.effort, wanted.effort, tolerance)
    close(got.contact_force, wanted.contact_force, tolerance)


def test_surfaces_that_are_the_plane(reference: Mechanism) -> None:
    """Quadratic without second order, straight profile, expression: equal to rounding."""
    states = masticatory_states()
    wanted = evaluate(interpreted(reference), states)
    s = (-0.04, -0.02, 0.0)
    points = tuple((x, 0.013215 - 1.1 * x) for x in s)
    for surface in (
        Quadratic(offset=0.013215, slope=(-1.1, 0.0)),
        Profile(direction=(1.0, 0.0), points=points),
        Expression(lambda p: p[2] + 1.1 * p[0] - 0.013215),
        Expression(lambda p: 2 * (p[2] + 1.1 * p[0]) - 0.02643),  # phi has no fixed scale
    ):
        got = evaluate(interpreted(with_surfaces(reference, surface, surface)), states)
        same(got, wanted, 1e-12)


@pytest.mark.slow
def test_ball_on_a_wall_is_its_centre_on_a_shifted_one(reference: Mechanism) -> None:
    states = masticatory_states()
    wanted = evaluate(interpreted(reference), states)
    radius = 0.004
    lift = 0.013215 + radius * np.hypot(1.0, 1.1)  # the skull is above the ball
    for wall in (
        Plane(offset=lift, slope=(-1.1, 0.0)),
        Quadratic(offset=lift, slope=(-1.1, 0.0)),
        Expression(lambda p: p[2] + 1.1 * p[0] - lift),
    ):
        machine = with_surfaces(reference, wall, wall, side="below", ball_radius=radius)
        same(evaluate(interpreted(machine), states), wanted, 1e-12)


@pytest.mark.slow
def test_a_large_sphere_tends_to_its_tangent_plane(reference: Mechanism) -> None:
    """As 1 / r: ten times the radius, a tenth of the difference."""
    states = masticatory_states()
    wanted = evaluate(interpreted(reference), states).effort
    n = np.array([1.1, 0.0, 1.0]) / np.hypot(1.1, 1.0)
    differences = []
    for radius in (1.0, 10.0, 100.0, 1e3, 1e4):
        spheres = [
            Sphere(centre=tuple(np.array(c.point) - radius * n), radius=radius)
            for c in reference.contacts
        ]
        got = evaluate(interpreted(with_surfaces(reference, *spheres)), states).effort
        differences.append(np.abs(got - wanted).max() / np.abs(wanted).max())
    ratios = np.array(differences[:-1]) / differences[1:]
    assert (np.abs(ratios / 10 - 1) < [0.01, 1e-3, 1e-4, 1e-4]).all()
    assert differences[0] < 0.1


@pytest.mark.slow
def test_a_profile_through_a_quadratic(reference: Mechanism) -> None:
    """Equal between its points to spline order: 4 times finer, the torques far nearer."""
    states = masticatory_states()

    def height(x: np.ndarray) -> np.ndarray:
        return 0.04253 - 1.1 * (x + 0.02665) + 18 * (x + 0.02665) ** 2

    slope = -1.1 + 36 * 0.02665
    curved = Quadratic(offset=float(height(np.zeros(1))[0]), slope=(slope, 0.0), xx=18.0)
    wanted = evaluate(interpreted(with_surfaces(reference, curved, curved)), states)
    errors = []
    for count in (15, 61):
        s = np.linspace(-0.09, 0.05, count)
        points = tuple(zip(map(float, s), map(float, height(s)), strict=True))
        line = Profile(direction=(1.0, 0.0), points=points)
        offset = line.phi(reference.contacts[0].point)  # home is on the spline, not between
        line = line.model_copy(update={"points": tuple((a, b + offset) for a, b in points)})
        got = evaluate(interpreted(with_surfaces(reference, line, line)), states)
        errors.append(np.abs(got.effort - wanted.effort).max())
    scale = np.abs(wanted.effort).max()
    assert errors[0] < 0.05 * scale and errors[1] < 1e-7 * scale


def test_direct_route_names_the_core(reference: Mechanism) -> None:
    curved = condyle.load_mechanism("masticatory-curved")
    with pytest.raises(condyle.UnsupportedError, match=r"quadratic, quadratic.*Use route core"):
        condyle.derive(curved, route="direct")
    walls = with_surfaces(
        reference,
        *[Plane(offset=0.02, slope=(-1.1, 0.0))] * 2,
        side="below",
        ball_radius=0.006785 / np.hypot(1.1, 1.0),
    )
    states = masticatory_states()
    choices = {"formulation": "momentum", "route": "direct"}
    direct = evaluate(interpreted(walls, **choices), states)
    same(direct, evaluate(interpreted(reference, **choices), states), 1e-12)


def test_expression_sees_the_point_only() -> None:
    wave = Expression(lambda p: p[2] - 0.002 * ca.sin(50 * p[0]))
    assert wave.form != Expression(lambda p: p[2] - 0.003 * ca.sin(50 * p[0])).form
