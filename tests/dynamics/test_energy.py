"""Laws of energy, with kinetic and potential energy written by hand."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from oracles.description import read
from oracles.energy import energy
from oracles.random_mechanism import random_mechanism, random_state, toml_text
from oracles.rotations import platform_motion
from support.speeds import few

import condyle
from condyle.dynamics import FORMULATIONS
from condyle.mechanism import parse
from condyle.model.model import Model

pytestmark = pytest.mark.slow

CASES = {f"k{k}": {"contacts": k} for k in range(4)} | {"n8": {"chains": 8}}


@cache
def drawn(case: str) -> tuple[dict[str, Any], Model]:
    rng = np.random.default_rng(sum(map(ord, case)) + 1)
    raw = random_mechanism(rng, tilted_gravity=True, **CASES[case])
    if case == "k3":  # three contacts nearly fix the roll by Y: turn that round
        raw["dependent"] = ["Z", "gamma", "Y"]
    return raw, condyle.derive(parse(toml_text(raw)), backend="numpy")


@pytest.mark.parametrize("case", CASES)
def test_power_balance_along_a_trajectory(case: str) -> None:
    """Power of torques and bite = rate of the energy; contacts do no work."""
    raw, model = drawn(case)
    d, rng, m = read(raw), np.random.default_rng(2), model.mechanism.degrees_of_freedom
    unit = np.array([3e-4 if name in "XYZ" else 0.01 for name in model.independent])
    phase = rng.uniform(0, 6, m)
    t = np.linspace(0, 0.1, 9)[:, None]

    def q(t: np.ndarray, order: int) -> np.ndarray:
        return unit * 60.0**order * np.sin(60 * t + phase + order * np.pi / 2)

    def energies(t: np.ndarray) -> np.ndarray:
        found = model.inverse_dynamics(q(t, 0), q(t, 1), q(t, 2), outputs="all")
        motions = map(platform_motion, found.pose, found.pose_rate)
        return np.array([sum(energy(d, motion)) for motion in motions])

    wrench = rng.normal(0, 2, (len(t), 6)) * np.repeat([1, 0.05], 3)
    point = d.points["right_molar"]
    result = model.inverse_dynamics(q(t, 0), q(t, 1), q(t, 2), wrench, point, outputs="all")
    assert (result.status == 0).all()
    h = 2e-4
    slope = 8 * (energies(t + h) - energies(t - h)) - (energies(t + 2 * h) - energies(t - 2 * h))
    slope /= 12 * h
    power = result.effort * result.joint_rate
    bite = []
    for pose, rate, load in zip(result.pose, result.pose_rate, wrench, strict=True):
        motion = platform_motion(pose, rate)
        bite.append(load[:3] @ motion.point(point)[1] + load[3:] @ motion.omega)
    balance = power.sum(axis=1) + bite - slope
    size = np.abs(power).sum(axis=1).max()
    assert np.abs(balance).max() < 1e-7 * size
    assert np.abs(slope).max() > 0.01 * size


def generalized(model: Model, q: np.ndarray, q1: np.ndarray, q2: np.ndarray) -> np.ndarray:
    """Forces dual to q', (m,): A^T tau, with A the joint rates of unit velocities."""
    m = len(q)
    units = model.inverse_dynamics(np.tile(q, (m, 1)), np.eye(m), np.zeros((m, m)), outputs="all")
    effort = model.inverse_dynamics(q[None], q1[None], q2[None]).effort[0]
    return units.joint_rate @ effort


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("case", few(CASES, "k2", "n8"))
def test_mass_matrix_is_that_of_the_kinetic_energy(case: str, formulation: str) -> None:
    """Torques are linear in q''; the matrix is symmetric, positive definite, and 2 T = q' M q'."""
    raw, drawn_model = drawn(case)
    model = condyle.derive(drawn_model.mechanism, formulation=formulation, backend="numpy")
    states = random_state(np.random.default_rng(4), raw, 1)
    q, q1, m = states["q"][0], states["qd"][0], model.mechanism.degrees_of_freedom
    zero = np.zeros(m)
    rest = generalized(model, q, q1, zero)
    mass = np.array([generalized(model, q, q1, unit) - rest for unit in np.eye(m)])
    unit = np.array(
        [1 if name in "XYZ" else model.characteristic_length for name in model.independent]
    )
    scaled = mass / unit / unit[:, None]
    size = np.abs(scaled).max()
    np.testing.assert_allclose(scaled, scaled.T, atol=1e-11 * size)
    assert np.linalg.eigvalsh(scaled)[0] > 1e-4 * size
    kinetic, _ = energy(read(raw), platform_motion(states["pose"][0], states["pose_rate"][0]))
    assert q1 @ mass @ q1 / 2 == pytest.approx(kinetic, rel=1e-10)
    both = generalized(model, q, q1, 3 * np.eye(m)[0] - 2 * np.eye(m)[-1]) - rest
    np.testing.assert_allclose(both, 3 * mass[0] - 2 * mass[-1], atol=1e-10 * np.abs(mass).max())


@pytest.mark.parametrize("case", CASES)
def test_at_rest_torques_carry_the_weight(case: str) -> None:
    """q' = q'' = 0: the forces are the slope of the potential energy; without gravity none."""
    raw, model = drawn(case)
    d, states = read(raw), random_state(np.random.default_rng(5), raw, 1)
    q, zero = states["q"][0], np.zeros(model.mechanism.degrees_of_freedom)
    h = 1e-4

    def potential(q: np.ndarray) -> float:
        pose = model.inverse_dynamics(q[None], 0 * q[None], 0 * q[None], outputs="all").pose[0]
        return energy(d, platform_motion(pose))[1]

    unit = np.array([model.characteristic_length if n in "XYZ" else 1 for n in model.independent])
    slope = [
        (
            8 * (potential(q + step) - potential(q - step))
            - potential(q + 2 * step)
            + potential(q - 2 * step)
        )
        / (12 * h)
        for step in h * np.diag(unit)
    ]
    forces = generalized(model, q, zero, zero) * unit
    np.testing.assert_allclose(forces, slope, atol=1e-8 * np.abs(slope).max())
    floating = condyle.derive(model.mechanism.replace(gravity=(0, 0, 0)), backend="numpy")
    at_rest = floating.inverse_dynamics(q[None], zero[None], zero[None], outputs="all")
    assert np.abs(at_rest.effort).max() == 0
    assert np.abs(at_rest.contact_force).max(initial=0) == 0
