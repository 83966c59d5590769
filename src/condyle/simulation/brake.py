"""The brake of a safe stop: a damper at every joint, which is all that an exported controller keeps
of its law once the law cannot be trusted. `check_gains` judges it where the loop stands."""

from __future__ import annotations

import numpy as np

from ..questions.observer import KALMAN
from .plan import ClosedLoop, Plan

# How much of a radian the brake's fastest mode turns in the loop's lag, so that its phase is far
# from 60 degrees, and how many of its time constants a stop lasts at most, so that it is no blow.
LAG, CONSTANTS = 0.35, 50.0


def brake(plan: Plan, drive: ClosedLoop) -> np.ndarray:
    """Damping B of a safe stop, (n,) [N m s/rad or N s/m].

        B = g diag(1 / (J M^-1 J^T)),    the largest eigenvalue of M^-1 J^T B J is d,

    with M of the independent coordinates and J the joints' Jacobian in them, both of the pose on
    the path where the eigenvalue is largest. d times the lag of measured rates (hold, difference,
    delay and low-pass) is at most `LAG`, and d at most `CONSTANTS` over the duration of a stop.
    """
    sensing = drive.sensing
    assert sensing is not None and drive.period is not None
    cutoff = plan.scenario.sensors.velocity_cutoff if plan.scenario.sensors else None
    lag = drive.period * (drive.delay + (3.0 if sensing.observer == KALMAN else 1.5))
    lag += 1 / (2 * np.pi * cutoff) if cutoff else 0.0
    stopping = max(plan.scenario.safety.stopping, drive.period)
    target = min(LAG / lag, CONSTANTS / stopping)
    model, m = drive.model, len(plan.q)
    ticks = plan.ticks()
    rows = drive.path.at(ticks[np.linspace(0, len(ticks) - 1, 11).astype(int)])
    least, reached = np.full(len(plan.low), np.inf), []
    for q in (plan.q, *rows[:, :m]):
        found = model.jacobians(q)
        J = np.asarray(found.J) @ np.asarray(found.twist_basis)
        by = np.linalg.solve(model.mass_matrix(q), J.T)
        inertia = 1 / np.maximum(np.sum(J.T * by, axis=0), np.finfo(float).tiny)
        least = np.minimum(least, inertia)
        reached.append((J, by))
    largest = max(np.abs(np.linalg.eigvals(by * least @ J)).max() for J, by in reached)
    return target / largest * least
