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
from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data
from condyle.mechanism.home import home_residuals
from condyle.mechanism.surface import Expression, Plane, Profile, Quadratic
from condyle.model.model import Model
from condyle.model.model_result import ModelResult

pytestmark = pytest.mark.slow

COUNT = 4


def evaluate(mechanism: Mechanism, states: dict[str, Any], **choices: str) -> ModelResult:
    """At the oracles' states, given in any coordinates."""
    own = Model(mechanism, **choices, backend="numpy")
    q = own.poses.states(states["names"], tuple(states[key] for key in ("q", "qd", "qdd")))
    point = load_point_of(own, states["load_point"])
    load = np.hstack([states["wrench"], np.tile(point, (len(q[0]), 1))])
    return own.inverse_dynamics(*q, *parts(load), outputs=("pose", "pose_acceleration"))


# Chains of one family, whose laws are cheap; those of other families meet curves in `kinematics`.
CABLES: dict[str, Any] = {"families": ("cable",), "chains": 9}
MECHANISMS: dict[str, dict[str, Any]] = {
    "newton_euler": {"surface": "mixed", "contacts": 5, "families": ("SPS",)},
    "virtual_power": {"surface": "ellipsoid", "contacts": 1, "ball_radius": 4.0} | CABLES,
    "momentum": {"surface": ("sphere", "profile"), "ball_radius": 8.0} | CABLES,
}


@pytest.mark.parametrize("formulation", MECHANISMS)
def test_newton_and_euler_of_free_bodies(formulation: str) -> None:
    rng = np.random.default_rng(6)
    raw = random_mechanism(rng, **MECHANISMS[formulation])
    states = random_state(rng, raw, COUNT)
    mechanism = from_data(raw)
    got = evaluate(mechanism, states, formulation=formulation, distribution="minimum_norm")
    assert (got.status == 0).all()
    close(got.pose, states["pose"], 1e-12)
    close(got.pose_acceleration, states["pose_acceleration"], 1e-11)
    for i in range(COUNT):
        keys = ("pose", "pose_rate", "pose_acceleration", "wrench")
        sample = (states[key][i] for key in keys)
        wanted = newton_euler.inverse_dynamics(raw, *sample, states["load_point"])
        close(got.effort[i], wanted["tau"], 1e-11)
        close(got.contact_force[i], wanted["contact"], 1e-10)


SOCKET = {"offset": 0.013215, "slope": (-1.1, 0.0)}
RADIUS = 0.004
WALL = Plane(offset=0.013215 + RADIUS * np.hypot(1.0, 1.1), slope=(-1.1, 0.0))
LINE = tuple((x, 0.013215 - 1.1 * x) for x in (-0.04, -0.02, 0.0))
BALL = {"side": "below", "ball_radius": RADIUS}  # the skull is above the ball


def on(reference: Mechanism, *surfaces: Any, **options: Any) -> Mechanism:
    """The bundled mechanism on other surfaces."""
    contacts = tuple(
        type(c)(name=c.name, point=c.point, surface=s, **options)
        for c, s in zip(reference.contacts, surfaces, strict=True)
    )
    return reference.replace(contacts=contacts)


def test_surfaces_that_are_the_plane(reference: Mechanism) -> None:
    """Without second order, and balls whose centres stay on it: equal to rounding, by any route."""
    rng = np.random.default_rng(8)
    scale = np.array([0.002, 0.002, 0.04, 0.04])
    states = {
        "names": ("X", "Y", "alpha", "beta"),
        "q": rng.uniform(-1, 1, (COUNT, 4)) * scale,
        "qd": rng.normal(0, 10, (COUNT, 4)) * scale,
        "qdd": rng.normal(0, 300, (COUNT, 4)) * scale,
        "wrench": rng.normal(0, 10, (COUNT, 6)) * [1, 1, 1, 0.05, 0.05, 0.05],
        "load_point": "right_molar",
    }
    planes = evaluate(reference, states)
    scaled = Expression(lambda p: 2 * (p[2] + 1.1 * p[0]) - 0.02643)  # phi has no fixed scale
    line, walls = Profile(direction=(1.0, 0.0), points=LINE), on(reference, WALL, WALL, **BALL)
    for got in (
        evaluate(on(reference, Quadratic(**SOCKET), line), states),
        evaluate(on(reference, scaled, Plane(**SOCKET)), states),
        evaluate(walls, states, formulation="momentum", route="direct"),
    ):
        for name in ("pose", "pose_acceleration", "effort", "contact_force"):
            close(getattr(got, name), getattr(planes, name), 1e-12)
    with pytest.raises(condyle.UnsupportedError, match=r"quadratic, quadratic.*Use route core"):
        condyle.derive("masticatory-curved", route="direct")


def test_the_bundled_curved_mechanism(reference: Mechanism) -> None:
    """Tangent to the paper's planes at home, with the radii of curvature that its file states."""
    curved = condyle.load_mechanism("masticatory-curved")
    for ours, plane in zip(curved.contacts, reference.contacts, strict=True):
        s, (x, y, _) = ours.surface, ours.point
        assert s.kind == "quadratic"
        slope = (s.slope[0] + 2 * s.xx * x, s.slope[1] + 2 * s.yy * y)
        assert slope == pytest.approx(plane.surface.slope, abs=1e-14)
        # Radii of curvature: along the steepest line, and across it.
        assert (1 + 1.1**2) ** 1.5 / (2 * s.xx) == pytest.approx(45.6e-3, abs=1e-4)
        assert np.hypot(1, 1.1) / (2 * s.yy) == pytest.approx(-59.5e-3, abs=1e-4)
    assert np.abs(home_residuals(curved)).max() < 1e-15
    assert curved.chains == reference.chains and curved.platform == reference.platform
