"""Contacts that give, against closed forms of impacts of free bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import gamma

import condyle
from condyle.errors import ScenarioError
from condyle.mechanism.compliance import COMPLIANCES
from condyle.simulation.running import Batch
from condyle.simulation.simulating import planned

from .bodies import body, events, lifted, on_plane

pytestmark = pytest.mark.slow  # builds kernels
R, M = 0.05, 0.2
STEEL = {"kind": "hertz", "modulus": 2e9, "poisson": 0.3}
LAWS = {
    "linear": {"kind": "linear", "stiffness": 2e5},
    "hertz": STEEL,
    "foundation": {"kind": "foundation", "modulus": 5e6, "poisson": 0.45, "thickness": 0.004},
}


def thrown(law: dict[str, Any], v: float, duration: float, **more: Any) -> Any:
    """A ball without weight that hits a plane after 1 ms at a speed v."""
    model = body([on_plane((0, 0, 0), R, compliance=law, **more)], M)
    floating = condyle.derive(model.mechanism.replace(gravity=(0.0, 0.0, 0.0)))
    scenario = {"contacts": {"kind": "compliant"}, "rate": 1e5}
    return lifted(floating, {"Z": v * 1e-3, "dZ": -v}, duration, **scenario)


@pytest.mark.parametrize("kind", LAWS)
def test_restitution_over_speed(kind: str) -> None:
    """Hunt and Crossley's force takes speed by ln((1 + d v) / (1 - d v')) = d (v + v'), whatever
    the elastic law [D. W. Marhefka, D. E. Orin, IEEE Trans. SMC A 29, 566 (1999), eq. 8]."""
    d = 0.4
    for v in (0.05, 0.5, 2.0):
        solution = thrown(LAWS[kind] | {"damping": d}, v, 0.02)
        (landing,), (lifting,) = (events(solution, f"contact_{x}") for x in ("landed", "lifted"))
        assert abs(landing["time"] - 1e-3) < 1e-11
        leaves = brentq(
            lambda u, v=v: np.log((1 + d * v) / (1 - d * u)) - d * (v + u),
            v / (1 + 2 * d * v), v, xtol=1e-15,
        )  # fmt: skip
        assert abs(lifting["state"]["dZ"] / leaves - 1) < 1e-8
        energy = solution["energy"].sum("account").values
        lost = solution["energy"].sel(account="contact_friction").values[-1]
        assert np.abs(energy / energy[0] - 1).max() < 1e-8
        assert abs(lost - M * (v * v - leaves**2) / 2) < 1e-9
        pressed = solution["indentation"].values[:, 0]
        assert np.abs(pressed - np.maximum(-solution["contact_gap"].values[:, 0], 0)).max() < 1e-12


def test_time_of_contact_of_an_impact_of_hertz() -> None:
    v = 0.7
    solution = thrown(STEEL, v, 0.01)
    (landing,), (lifting,) = (events(solution, f"contact_{x}") for x in ("landed", "lifted"))
    c = 4 / 3 * STEEL["modulus"] / (1 - STEEL["poisson"] ** 2) * np.sqrt(R)
    depth = (5 * M * v * v / (4 * c)) ** 0.4
    time = 4 * np.sqrt(np.pi) * gamma(0.4) / (5 * gamma(0.9)) * depth / v  # 2.943 depth / v
    assert abs((lifting["time"] - landing["time"]) / time - 1) < 1e-8
    assert abs(lifting["state"]["dZ"] / v - 1) < 1e-8


def test_a_contact_that_has_just_landed_does_not_lift() -> None:
    """A landing is located within 1e-12 s: where the gap is not 0 yet, it went on lifting."""
    model = body([on_plane((0, 0, 0), R, compliance=STEEL)], M)
    (plan,) = planned(model, [{"duration": 0.1, "contacts": {"kind": "compliant"}}])
    batch = Batch([plan.freed])
    lifting, state = batch._lifting, batch.state.copy()
    state[2], state[8] = 1e-13, -0.16  # Z, Z'
    lifting.active[:] = True
    assert not lifting.changes_at_once(0.05, state)
    state[8] = 0.16
    assert lifting.changes_at_once(0.05, state)


def test_a_stiff_ball_comes_to_rest_by_radau() -> None:
    """A damper far beyond the critical one: the ball lands once, and sinks in."""
    law = {"kind": "linear", "stiffness": 2e7, "damping": 2000.0}
    model = body([on_plane((0, 0, 0), R, compliance=law)], M)
    more = {"contacts": {"kind": "compliant"}, "method": "Radau", "rtol": 1e-8}
    solution = lifted(model, {"Z": 1e-4}, 0.3, **more)
    assert solution.condyle.events[-1]["kind"] == "contact_landed"
    assert abs(solution["contact_force"].values[-1, 0] / (M * 9.81) - 1) < 1e-6
    assert abs(solution["contact_gap"].values[-1, 0] / (M * 9.81 / 2e7) + 1) < 1e-6


def test_rest_in_a_socket() -> None:
    """A ball in a spherical socket sinks in by what its weight makes of the relative curvature."""
    wall, law = 0.08, LAWS["foundation"] | {"damping": 100.0}
    socket = {"kind": "sphere", "centre": [0, 0, wall - R], "radius": wall}
    contact = {"name": "ball", "point": [0, 0, 0], "surface": socket, "side": "inside"}
    contact |= {"ball_radius": R, "one_sided": True, "compliance": law}
    more = {"contacts": {"kind": "compliant"}, "method": "Radau", "rtol": 1e-8}
    solution = lifted(body([contact], M), {"Z": 0.0}, 0.5, **more)
    table = COMPLIANCES["foundation"].model_validate(law)
    curvature = np.full(2, 1 / R - 1 / wall)
    depth = table.patch(np.array(M * 9.81), curvature).indentation
    assert abs(solution["contact_gap"].values[-1, 0] / -depth - 1) < 1e-5
    assert not events(solution, "contact_landed")


def test_clearance_gives_on_both_faces() -> None:
    """A ball between two springs with play: half a period on each, and straight between them."""
    k, c, v = 5e4, 1e-3, 0.3
    plane = {"kind": "plane", "slope": [0.0, 0.0], "offset": 0.0}
    ball = {"name": "ball", "point": [0, 0, 0], "surface": plane, "clearance": c}
    model = body([ball | {"compliance": {"kind": "linear", "stiffness": k}}], M)
    floating = condyle.derive(model.mechanism.replace(gravity=(0.0, 0.0, 0.0)))
    solution = lifted(floating, {"dZ": v}, 0.06, contacts={"kind": "compliant"})
    half = np.pi * np.sqrt(M / k)
    times = np.cumsum([c / v, half, 2 * c / v, half, 2 * c / v, half])
    found = [e["time"] for e in solution.condyle.events]
    assert np.abs(np.array(found[:6]) - times).max() < 1e-10
    force = solution["contact_force"].values[:, 0]
    assert abs(force.max() / force.min() + 1) < 1e-2 and force.max() > 0


@pytest.mark.parametrize(
    "law",
    [
        *LAWS.values(),
        STEEL | {"length": 0.01},
        LAWS["foundation"] | {"length": 0.01},
        LAWS["foundation"] | {"large_strain": True},
    ],
)
def test_laws_and_their_inverses(law: dict[str, Any]) -> None:
    """N(d) undoes d(N), and the energy is its integral."""
    table = COMPLIANCES[law["kind"]].model_validate(law)
    force = np.geomspace(1e-3, 50.0, 40)
    curvature = np.tile([12.0, 20.0], (40, 1))
    d = table.patch(force, curvature).indentation
    again, energy = table.pressed(d, curvature)
    assert np.abs(again / force - 1).max() < 1e-12
    x, w = np.polynomial.legendre.leggauss(40)
    inner = d[:, None] * ((1 + x) / 2) ** 2  # smooth in the root
    work, _ = table.pressed(inner, np.broadcast_to(curvature[:, None], (*inner.shape, 2)))
    assert np.abs((work * w * (1 + x) / 2).sum(1) * d / energy - 1).max() < 1e-9
    assert not any(a.any() for a in table.pressed(-d, curvature))


def test_contacts_need_a_law() -> None:
    with pytest.raises(ScenarioError, match="need compliance; give it to contact"):
        condyle.simulate(body([on_plane((0, 0, 0), R)]), {"contacts": {"kind": "compliant"}})
