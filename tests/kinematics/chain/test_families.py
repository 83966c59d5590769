"""Every family in every formulation against free bodies; what is particular to cables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import newton_euler
from oracles.description import read
from oracles.random_mechanism import toml_text
from oracles.rotations import platform_motion
from support.families import LINES, MECHANISMS, Case, case, close
from support.speeds import few

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import parse
from condyle.mechanism.chain import limits
from condyle.model.joint_reactions import Reaction, reactions
from condyle.motion import trial_motion
from condyle.questions.numbers import has_closed_form
from condyle.report.scene import place

pytestmark = pytest.mark.slow

MINIMUM_NORM = {"distribution": "minimum_norm"}
# Formulations and routes in turn: each meets several families.
TURNS = [
    (name, [*FORMULATIONS][i % len(FORMULATIONS)], ("core", "direct")[i % 3 == 2])
    for i, name in enumerate([*LINES, *MECHANISMS])
    if name not in ("mixed_k0_n8", "mixed_k3", "pss_k3_n8", "sps_k3")  # slow, of nothing new
]
SHARED = ("newton_euler", "core")  # as in the turn of mixed_k1: derived already
FEW = ("k2_n9", "along_x", "mixed_k1", "mixed_k2", "pss_k1", "sps_k1", "sps_along_x", "mixed")


@pytest.mark.parametrize(
    ("name", "formulation", "route"), few(TURNS, *(turn for turn in TURNS if turn[0] in FEW))
)
def test_free_bodies_solved_at_once(name: str, formulation: str, route: str) -> None:
    c = case(name)
    if route == "direct" and not has_closed_form(c.mechanism):
        route = "core"
    one_unit = len({t["kind"] == "RSS" for t in c.raw["chain"]}) == 1  # else no least norm
    found = c.evaluate(formulation, route, **(MINIMUM_NORM if one_unit else {}))
    assert (found.status == 0).all()
    jacobians = None if one_unit else c.model(formulation, route).jacobians(c.states["q"])
    for i in range(len(c.load)):
        theirs = newton_euler.inverse_dynamics(c.raw, *c.sample(i))
        if jacobians is None:
            close(found.effort[i], theirs["tau"], 1e-9)
            close(found.contact_force[i], theirs["contact"], 1e-9)
        else:  # other efforts that balance the same
            A = jacobians.J_theta[i] @ jacobians.M_J[i]
            close(A.T @ found.effort[i], A.T @ theirs["tau"], 1e-9)
        close(found.joint_rate[i], theirs["joint_rate"], 1e-10)
        close(found.joint_acceleration[i], theirs["joint_acceleration"], 1e-10)
        np.testing.assert_allclose(found.configuration.joint[i], theirs["joint"], atol=1e-14)


def test_a_leg_without_mass_pushes_where_a_cable_pulls() -> None:
    """Efforts, joints and rates are equal with opposite sign; all else is the same."""
    c = case("mixed_k2")
    nothing = dict.fromkeys(("mass", "com", "transverse", "axial"), 0.0)
    legs = {"kind": "SPS", "cylinder": nothing, "piston": nothing}
    chains = [t | legs if t["kind"] == "cable" else t for t in c.raw["chain"]]
    raw, q = c.raw | {"chain": chains}, c.states["q"]
    other = replace(c, raw=raw, mechanism=parse(toml_text(raw)))
    sign = np.array([-1.0 if t["kind"] == "cable" else 1.0 for t in c.raw["chain"]])
    ways = ("virtual_power", "direct")  # as in the turn of mixed_k2: derived already
    cable, leg = c.evaluate(*ways, **MINIMUM_NORM), other.evaluate(*ways, **MINIMUM_NORM)
    for quantity in ("effort", "joint_rate", "joint_acceleration"):
        close(getattr(cable, quantity) * sign, getattr(leg, quantity), 1e-12)
    ours, theirs = cable.configuration, leg.configuration
    np.testing.assert_allclose(ours.joint * sign, theirs.joint, atol=1e-14)
    close(ours.singularity.J_W_sigma, theirs.singularity.J_W_sigma, 1e-12)
    np.testing.assert_array_equal(ours.singularity.transmission[:, sign < 0], 1.0)
    model, legs_model = c.model(*ways, **MINIMUM_NORM), other.model(*ways, **MINIMUM_NORM)
    close(model.mass_matrix(q), legs_model.mass_matrix(q), 1e-12)
    rows = (m.jacobians(q).J_theta for m in (model, legs_model))
    close(next(rows) * sign[:, None], next(rows), 1e-12)


@pytest.fixture(scope="module")
def lines() -> tuple[Case, condyle.Model, dict[str, Reaction]]:
    """Cables, rails and legs about one contact."""
    c = case("mixed_k1")
    model, found = c.model(*SHARED, **MINIMUM_NORM), c.evaluate(*SHARED, **MINIMUM_NORM)
    close(found.share.sum(axis=1), found.effort, 1e-12)
    assert "load" in model.parts and "internal" not in model.parts
    return c, model, reactions(model, found)


def test_the_one_reaction_of_a_cable_is_its_pull(
    lines: tuple[Case, condyle.Model, dict[str, Reaction]],
) -> None:
    """And Newton for the platform, by the reactions alone."""
    c, _, found = lines
    d, effort = read(c.raw), c.evaluate(*SHARED, **MINIMUM_NORM).effort
    for i in range(len(c.load)):
        motion = platform_motion(*c.sample(i)[:3])
        for k, chain in enumerate(d.chains):
            if chain.kind == "cable":
                (pull,) = [r for r in found.values() if r.owner == chain.name]
                places = (pull.quantity, pull.body, pull.by)
                assert places == ("platform_joint", "platform", "cable")
                M = motion.point(chain.M)[0]
                home = (chain.S - M) / np.linalg.norm(chain.S - M)  # towards the base
                close(pull.array[i], effort[i, k] * home, 1e-12)
                close(pull.point[i], M, 1e-12)
        pushes = [r.array[i] for r in found.values() if r.body == "platform"]
        wanted = d.mass * (motion.acceleration - d.gravity) - c.load[i, :3]
        assert len(pushes) == len(d.chains) + len(d.contacts)
        close(np.sum(pushes, axis=0), wanted, 1e-10)


def test_a_cable_is_no_part_and_a_thin_line() -> None:
    assert case("k2_n9").model(**MINIMUM_NORM).parts == ("platform", "load")
    mechanism = case("mixed_k2").mechanism
    assert case("mixed_k2").model(**MINIMUM_NORM).parts == ("platform", "rods", "sliders", "load")
    pose = np.array([[1e-3, 0, 2e-3, 0.01, 0, 0.02]])
    drawn = place(mechanism, pose, np.zeros((1, 7))).chains
    rods = {chain.kind: drawn[chain.name].rods for chain in mechanism.chains}
    (line,) = rods["cable"]
    assert line.thickness < min(rod.thickness for rod in rods["PSS"])
    cable = next(chain for chain in mechanism.chains if chain.kind == "cable")
    points = drawn[cable.name].points
    np.testing.assert_array_equal(points[line.start], cable.base)
    assert points[line.end].shape == (1, 3)


def test_results_tell_of_slack() -> None:
    """Minimum-norm efforts ignore limits; every cable that pushes is reported."""
    c = case("k2_n9")
    mechanism, model = c.mechanism, c.model("momentum", "core", **MINIMUM_NORM)  # derived already
    solution = model.solve(trial_motion(mechanism, rate=20))
    slack = [n for n in solution.condyle.notices if n.kind == "effort_limit"]
    pushing = solution["effort"].values.min(axis=0) < 0
    names = {name for name, p in zip(mechanism.chain_names, pushing, strict=True) if p}
    assert names and {notice.owner for notice in slack} == names
    assert all("below its minimum of 0" in notice.text for notice in slack)


def test_cables_beside_motors_within_limits() -> None:
    """N and N m, each weighed by its limit: balanced, within limits, and of least weighed norm."""
    drawn = case("k2_two_units")
    limit = {"cable": {"force_limit": 1000.0}, "RSS": {"torque_limit": 10.0}}
    raw = drawn.raw | {"chain": [t | {"actuator": limit[t["kind"]]} for t in drawn.raw["chain"]]}
    c = replace(drawn, raw=raw, mechanism=parse(toml_text(raw)))
    model, found = c.model(distribution="weighted"), c.evaluate(distribution="weighted")
    assert model.parts[-1] == "internal" and (found.status == 0).all()
    close(found.share.sum(axis=1), found.effort, 1e-12)
    low, high = np.array([limits(chain)[:2] for chain in model.mechanism.chains]).T
    jacobians, slack = model.jacobians(c.states["q"]), 1e-9 * high
    for i, effort in enumerate(found.effort):
        theirs = newton_euler.inverse_dynamics(raw, *c.sample(i))["tau"]
        A = jacobians.J_theta[i] @ jacobians.M_J[i]
        close(A.T @ effort, A.T @ theirs, 1e-9)
        assert (effort >= low - slack).all() and (effort <= high + slack).all()
        # Least: nothing along the null space but what limits hold back, where it would go out.
        scaled, at_low, at_high = effort / high, effort <= low + slack, effort >= high - slack
        free = ~(at_low | at_high)
        multipliers = np.linalg.lstsq((A * high[:, None])[free], scaled[free], rcond=None)[0]
        rest = scaled - high * (A @ multipliers)
        assert np.abs(rest[free]).max() < 1e-8 * np.abs(scaled).max()
        assert (rest[at_low] >= -1e-8).all()
