"""The bundled jaw for tests of laws, sensors and loads: its states, and what is known of them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from support.machines import model
from support.points import moved

from condyle.backends.kernel import Kernel
from condyle.model.model import Model

N, M = 12, 4  # samples, independent coordinates
Arrays = dict[str, np.ndarray]


def jaw() -> Model:
    return model("masticatory")


def point(name: str = "right_molar") -> np.ndarray:
    return np.array(jaw().mechanism.platform.points[name])


def run(kernel: Kernel, ports: dict[str, Any]) -> Arrays:
    """Results, samples first; ports of one value are that of all samples."""
    count = max(len(one) for one in ports.values() if np.ndim(one) == 2)
    full = {
        name: one if np.ndim(one) == 2 else np.broadcast_to(one, (count, np.size(one)))
        for name, one in ports.items()
    }
    answer = kernel.run(full)
    assert not answer.status.any()
    return {name: np.moveaxis(a, -1, 0) for name, a in answer.values.items()}


def times(J: np.ndarray, v: np.ndarray) -> np.ndarray:
    """J v, sample by sample."""
    return (J @ v[..., None])[..., 0]


def pose_of(q: np.ndarray) -> np.ndarray:
    return jaw().poses.survey(q, ("pose",)).values["pose"].T


def place(q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (N, 3) of a point, and its Jacobian (N, 3, m) by differences of fourth order."""
    h, columns = 1e-3, []
    for unit in h * np.eye(M):
        far = {k: np.array([moved(x, p) for x in pose_of(q + k * unit)]) for k in (-2, -1, 1, 2)}
        columns.append((far[-2] - far[2] + 8 * (far[1] - far[-1])) / (12 * h))
    return np.array([moved(x, p) for x in pose_of(q)]), np.stack(columns, axis=2)


def twist(q: np.ndarray, q1: np.ndarray) -> np.ndarray:
    """Velocity of O_M and angular velocity, (N, 6): half the sum of r x v over three axes."""
    ends = [place(q, p) for p in (np.zeros(3), *np.eye(3))]
    O, *v = (times(J, q1) for _, J in ends)
    levers = [d + p - ends[0][0] for (d, _), p in zip(ends[1:], np.eye(3), strict=True)]
    turning = sum(np.cross(r, one - O) for r, one in zip(levers, v, strict=True)) / 2
    return np.hstack([O, np.asarray(turning)])


@cache
def sampled() -> Arrays:
    """States and references at random, and what encoders read of them."""
    rng = np.random.default_rng(3)
    found = {}
    for end in ("", "_d"):
        q = rng.uniform(-1, 1, (N, M)) * [0.002, 0.002, 0.02, 0.03]
        q1, q2 = 0.3 * rng.normal(size=(N, M)), 2 * rng.normal(size=(N, M))
        at = run(jaw().kernel("instant"), {"q": q, "q1": q1})
        found |= {"q" + end: q, "q1" + end: q1, "q2" + end: q2}
        found |= {name + end: at[name] for name in ("joint", "joint_rate")}
    del found["q2"]
    force = rng.normal(size=(N, 3)) + np.array([0, 0, -4.0])
    return found | {"force": force, "force_d": rng.uniform(0, 40, (N, 1))}
