"""Energy of motions without friction stays, and so do the contacts on their surfaces."""

from __future__ import annotations

import numpy as np
from oracles.closure import residuals
from oracles.description import read
from oracles.energy import energy
from oracles.random_mechanism import random_mechanism, toml_text
from oracles.rotations import platform_motion
from scipy.integrate import solve_ivp
from support.loads import parts

from condyle.mechanism import parse
from condyle.model.model import Model

DRIFT = 1e-9


def test_a_swing_of_ten_seconds(compiler_command: object) -> None:
    """Five contacts leave one freedom; gravity is turned so that home is the bottom of a well."""
    raw = random_mechanism(np.random.default_rng(4), contacts=5, condition=100.0)
    name = Model(parse(toml_text(raw)), backend="numpy").independent[0]
    h = 1e-3 if name in "XYZ" else 1e-2
    q = h * np.array([[-1.0], [0.0], [1.0]])
    forces = []
    for axis in np.eye(3):
        raw["gravity"] = [float(x) for x in 9.81 * axis]
        forces.append(Model(parse(toml_text(raw)), backend="numpy").gravity(q)[:, 0])
    slope, stiffness = np.array(forces)[:, 1], np.ptp(np.array(forces)[:, ::2], axis=1)
    stiffness = (np.array(forces)[:, 2] - np.array(forces)[:, 0]) / (2 * h)
    across = stiffness - slope * (slope @ stiffness) / (slope @ slope)
    raw["gravity"] = [float(x) for x in 9.81 * across / np.linalg.norm(across)]
    drift, gap, reversals = followed(raw, 10.0, np.array([0.0]), 0.3 * h * np.array([60.0]))
    assert drift < DRIFT
    assert gap < 1e-13
    assert reversals > 20


def test_a_fall_of_four_freedoms(compiler_command: object) -> None:
    raw = random_mechanism(np.random.default_rng(6), surface="quadratic", condition=100.0)
    drift, gap, _ = followed(raw, 0.03, np.zeros(4), np.array([0.02, -0.03, 0.5, -0.4]))
    assert drift < DRIFT
    assert gap < 1e-13


def followed(raw: dict, duration: float, q: np.ndarray, q1: np.ndarray) -> tuple[float, float, int]:
    """Drift of the energy over its kinetic part, largest gap [m], and how often it turns back."""
    d, model = read(raw), Model(parse(toml_text(raw)))
    m, effort, load = len(q), np.zeros(len(d.chains)), np.zeros(9)

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        return np.r_[x[m:], model.unchecked().forward_dynamics(x[:m], x[m:], effort, *parts(load))]

    t = np.linspace(0, duration, 200)
    found = solve_ivp(slope, (0, duration), np.r_[q, q1], "DOP853", t, rtol=1e-11, atol=1e-13).y.T
    assert np.isfinite(found).all()
    given = found[:, :m], found[:, m:], np.zeros((len(t), len(effort)))
    states = model.forward_dynamics(*given, outputs="all")
    motions = map(platform_motion, states.pose, states.pose_rate)
    kinetic, potential = np.array([energy(d, motion) for motion in motions]).T
    both = kinetic + potential
    gap = max(np.abs(residuals(d, pose)).max() for pose in states.pose)
    turns = int((np.diff(np.sign(found[:, m])) != 0).sum())
    return float(np.ptp(both) / kinetic.max()), float(gap), turns
