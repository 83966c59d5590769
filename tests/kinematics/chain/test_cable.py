"""Cables: chains without bodies, in every formulation, route and backend."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles import newton_euler
from oracles.description import read
from oracles.random_mechanism import toml_text
from oracles.rotations import platform_motion
from support.families import LINES, Case, case, close, same
from support.loads import parts
from support.speeds import few, slow

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import parse
from condyle.mechanism.chain import limits
from condyle.model.joint_reactions import reactions
from condyle.motion import trial_motion
from condyle.report.scene import place

pytestmark = pytest.mark.slow

LEAST = {"distribution": "minimum_norm"}
LIMITED = {"cable": {"force_limit": 1000.0}, "RSS": {"torque_limit": 10.0}}
NOTHING = {"mass": 0.0, "com": 0.0, "transverse": 0.0, "axial": 0.0}


def telescopic(c: Case) -> Case:
    """The same mechanism with legs without mass in the place of cables."""
    legs = {"kind": "SPS", "cylinder": NOTHING, "piston": NOTHING}
    chains = [t | legs if t["kind"] == "cable" else t for t in c.raw["chain"]]
    raw = c.raw | {"chain": chains}
    return replace(c, raw=raw, mechanism=parse(toml_text(raw)))


@pytest.mark.parametrize("route", ["core", "direct"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("name", few(LINES, "mixed_k2"))
def test_formulations_and_routes_agree(name: str, formulation: str, route: str) -> None:
    if route == "direct" and "curved" in name:
        pytest.skip("no parasitic motion in closed form")
    c = case(name)
    same(c.evaluate(formulation, route, **LEAST), c.evaluate(**LEAST), 1e-10)


@pytest.mark.parametrize("name", LINES)
def test_against_free_bodies(name: str) -> None:
    c = case(name)
    found = c.evaluate(**LEAST)
    for i in range(len(c.load)):
        theirs = newton_euler.inverse_dynamics(c.raw, *c.sample(i))
        close(found.effort[i], theirs["tau"], 1e-9)
        close(found.contact_force[i], theirs["contact"], 1e-9)
        close(found.joint_rate[i], theirs["joint_rate"], 1e-10)
        close(found.joint_acceleration[i], theirs["joint_acceleration"], 1e-10)
        np.testing.assert_allclose(found.configuration.joint[i], theirs["joint"], atol=1e-14)


@slow
@pytest.mark.parametrize("formulation", ["virtual_power", "newton_euler"])
@pytest.mark.parametrize("name", few(["k2_n9", "mixed_k1", "mixed_k2"], "mixed_k2"))
def test_compiled_kernels_agree(name: str, formulation: str) -> None:
    """In a batch, and one sample at a time by the kernel of least latency."""
    c = case(name)
    model = c.model(formulation, backend="compiled", **LEAST)
    q = [c.states[key] for key in ("q", "qd", "qdd")]
    compiled = model.inverse_dynamics(*q, *parts(c.load), outputs="all")
    same(compiled, c.evaluate(formulation, **LEAST), 1e-10)
    for i, wanted in enumerate(compiled.effort):
        one = (a[i : i + 1] for a in (*q, *parts(c.load)))
        close(model.inverse_dynamics(*one).effort[0], wanted, 1e-10)


@pytest.mark.parametrize("name", LINES)
def test_a_leg_without_mass_pushes_where_a_cable_pulls(name: str) -> None:
    """Efforts, joints and rates are equal with opposite sign; all else is the same."""
    c, q = case(name), case(name).states["q"]
    sign = np.array([-1.0 if t["kind"] == "cable" else 1.0 for t in c.raw["chain"]])
    model, other = c.model(**LEAST), telescopic(c).model(**LEAST)
    cable, leg = c.evaluate(**LEAST), telescopic(c).evaluate(**LEAST)
    for quantity in ("effort", "joint_rate", "joint_acceleration"):
        close(getattr(cable, quantity) * sign, getattr(leg, quantity), 1e-12)
    np.testing.assert_allclose(
        cable.configuration.joint * sign, leg.configuration.joint, atol=1e-14
    )
    close(cable.contact_force, leg.contact_force, 1e-11)
    close(model.mass_matrix(q), other.mass_matrix(q), 1e-12)
    close(model.gravity(q), other.gravity(q), 1e-12)
    ours, theirs = model.jacobians(q), other.jacobians(q)
    close(ours.J_theta * sign[:, None], theirs.J_theta, 1e-12)
    ours_s, theirs_s = cable.configuration.singularity, leg.configuration.singularity
    close(ours_s.J_W_sigma, theirs_s.J_W_sigma, 1e-12)
    lines = sign < 0
    np.testing.assert_array_equal(ours_s.transmission[:, lines], 1.0)


def test_a_line_has_no_share_and_no_part() -> None:
    c, mixed = case("k2_n9"), case("mixed_k2")
    found = c.evaluate(**LEAST)
    assert c.model(**LEAST).parts == ("platform", "load")
    close(found.share.sum(axis=1), found.effort, 1e-12)
    assert mixed.model(**LEAST).parts == ("platform", "rods", "sliders", "load")


@pytest.mark.parametrize("name", ["k2_n9", "mixed_k1"])
def test_its_one_reaction_is_its_pull(name: str) -> None:
    c = case(name)
    evaluation, d = c.evaluate(**LEAST), read(c.raw)
    found = reactions(c.model(**LEAST), evaluation)
    lines = [i for i, chain in enumerate(d.chains) if chain.kind == "cable"]
    for i in lines:
        chain = d.chains[i]
        mine = [r for r in found.values() if r.owner == chain.name]
        assert [(r.quantity, r.body, r.by) for r in mine] == [
            ("platform_joint", "platform", "cable")
        ]
        for sample, pose in enumerate(c.states["pose"]):
            M = platform_motion(pose).point(chain.M)[0]
            home = (chain.S - M) / np.linalg.norm(chain.S - M)  # towards the base
            close(mine[0].array[sample], evaluation.effort[sample, i] * home, 1e-12)
            close(mine[0].point[sample], M, 1e-12)


def test_forces_on_the_platform_balance() -> None:
    """Newton for the platform, by the reactions alone."""
    c = case("mixed_k1")
    found, d = reactions(c.model(**LEAST), c.evaluate(**LEAST)), read(c.raw)
    for i in range(len(c.load)):
        motion = platform_motion(*c.sample(i)[:3])
        pushes = [r.array[i] for r in found.values() if r.body == "platform"]
        wanted = d.mass * (motion.acceleration - d.gravity) - c.load[i, :3]
        assert len(pushes) == len(d.chains) + len(d.contacts)
        close(np.sum(pushes, axis=0), wanted, 1e-10)


def test_effort_times_joint_rate_is_power() -> None:
    """The tension's power on M, both ways."""
    line, rng = case("k0").mechanism.chains[1], np.random.default_rng(5)
    for M, V in zip(
        line.platform + rng.normal(0, 2e-3, (5, 3)), rng.normal(size=(5, 3)), strict=True
    ):
        B, tension, step = np.asarray(line.base), 30.0, 1e-6
        pull = tension * (B - M) / np.linalg.norm(B - M)
        wound = np.linalg.norm(B - (M - step * V)) - np.linalg.norm(B - (M + step * V))
        assert pull @ V == pytest.approx(tension * wound / (2 * step), rel=1e-7)


def test_it_is_drawn_as_a_thin_line() -> None:
    mechanism = case("mixed_k2").mechanism
    pose = np.array([[1e-3, 0, 2e-3, 0.01, 0, 0.02]])
    drawn = place(mechanism, pose, np.zeros((1, 7))).chains
    rods = {chain.kind: drawn[chain.name].rods for chain in mechanism.chains}
    (line,) = rods["cable"]
    assert line.thickness < min(rod.thickness for rod in rods["PSS"])
    for chain in mechanism.chains:
        if chain.kind == "cable":
            points = drawn[chain.name].points
            np.testing.assert_array_equal(points[line.start], chain.base)
            assert points[line.end].shape == (1, 3)


def test_results_tell_of_slack() -> None:
    """Minimum-norm efforts ignore limits; every cable that pushes is reported."""
    mechanism = case("k2_n9").mechanism
    model = condyle.derive(mechanism, backend="numpy", distribution="minimum_norm")
    solution = model.solve(trial_motion(mechanism, rate=200))
    slack = {n.owner for n in solution.condyle.notices if n.kind == "effort_limit"}
    pushing = solution["effort"].values.min(axis=0) < 0
    assert slack == {name for name, p in zip(mechanism.chain_names, pushing, strict=True) if p}
    assert slack and all(
        "below its minimum of 0" in n.text for n in solution.condyle.notices if n.owner in slack
    )


def test_cables_beside_motors_within_limits() -> None:
    """N and N m, each weighed by its limit: balanced, within limits, and of least weighed norm."""
    drawn = case("k2_two_units")
    tables = [t | {"actuator": LIMITED[t["kind"]]} for t in drawn.raw["chain"]]
    raw = drawn.raw | {"chain": tables}
    c = replace(drawn, raw=raw, mechanism=parse(toml_text(raw)))
    model, found = c.model(distribution="weighted"), c.evaluate(distribution="weighted")
    assert model.parts[-1] == "internal"
    close(found.share.sum(axis=1), found.effort, 1e-12)
    assert (found.status == 0).all()
    bounds = [limits(chain) for chain in model.mechanism.chains]
    low, high = np.array([(b.low, b.high) for b in bounds]).T
    jacobians = model.jacobians(c.states["q"])
    for i, effort in enumerate(found.effort):
        theirs = newton_euler.inverse_dynamics(raw, *c.sample(i))["tau"]
        A = jacobians.J_theta[i] @ jacobians.M_J[i]
        close(A.T @ effort, A.T @ theirs, 1e-9)
        slack = 1e-9 * high
        assert (effort >= low - slack).all() and (effort <= high + slack).all()
        scaled = effort / high
        # Least: nothing along the null space but what limits hold back, where it would go out.
        free = (effort > low + slack) & (effort < high - slack)
        multipliers = np.linalg.lstsq((A * high[:, None])[free], scaled[free], rcond=None)[0]
        rest = scaled - high * (A @ multipliers)
        assert np.abs(rest[free]).max() < 1e-8 * np.abs(scaled).max()
        at_low = ~free & (effort <= low + slack)
        assert (rest[at_low] >= -1e-8).all()
