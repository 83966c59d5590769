"""Logs of a machine that moves, with noise, by another formulation than the fit's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import condyle
from condyle.mechanism import Mechanism

Array = np.ndarray
RATE = 250.0  # Hz
ENCODER = 1e-4  # rad
SHARE = 0.05  # noise of efforts over their root mean square


def write_table(path: Path, columns: dict[str, Array]) -> Path:
    rows = np.column_stack([*columns.values()])
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    return path


def rubbing(mechanism: Mechanism) -> Mechanism:
    """With viscous and dry friction in every actuator."""
    changes: dict[str, float] = {}
    for i, chain in enumerate(mechanism.chains):
        own = f"chain.{chain.name}.actuator"
        changes |= {f"{own}.viscous": 2e-3 * (1 + 0.1 * i), f"{own}.coulomb": 4e-3 * (1 + 0.1 * i)}
        changes |= {f"{own}.smoothing_speed": 0.1}
    return mechanism.set(changes)


@dataclass(frozen=True)
class Recorded:
    """What a machine did, without noise."""

    mechanism: Mechanism
    t: Array
    joint: Array
    effort: Array
    contact: Array

    @property
    def noise(self) -> float:
        """Of the efforts [N m]."""
        return SHARE * float(np.sqrt((self.effort**2).mean()))

    def noisy(self, seed: int) -> tuple[Array, Array]:
        rng = np.random.default_rng(seed)
        joint = self.joint + ENCODER * rng.normal(size=self.joint.shape)
        return joint, self.effort + self.noise * rng.normal(size=self.effort.shape)

    def save(
        self, path: Path, seed: int, late: float = 0.0, bias: float = 0.0, contacts: bool = True
    ) -> Path:
        """A log. Args: late: of the efforts [s];  bias: of the first effort [N m];  contacts:
        whether their forces are in it."""
        joint, effort = self.noisy(seed)
        effort = np.column_stack([np.interp(self.t - late, self.t, e) for e in effort.T])
        effort[:, 0] += bias
        columns = {"t": self.t}
        for head, names, rows in (
            ("joint", self.mechanism.chain_names, joint),
            ("tau", self.mechanism.chain_names, effort),
            ("contact", self.mechanism.contact_names * contacts, self.contact),
        ):
            columns |= {f"{head}_{name}": rows[:, i] for i, name in enumerate(names)}
        return write_table(path, columns)


@cache
def recorded(
    mechanism: Mechanism, seconds: float, still: bool = False, drag: float = 0.0
) -> Recorded:
    """A machine like the chewing robot on a path of sines.

    Args: drag: on the platform's turning [N m s], of which the file knows nothing.
    """
    rng = np.random.default_rng(5)
    t = np.arange(0, seconds, 1 / RATE)
    size = np.array([1.2e-3, 1e-3, 0.03, 0.04]) * (not still)
    q = np.tile([-1e-3, 0.0, 0.0, 0.03], (len(t), 1))
    v, a = np.zeros_like(q), np.zeros_like(q)
    for j in range(4):
        for k in range(1, 6):
            w, part = 2 * np.pi * 0.7 * k, size[j] * rng.normal() / k**1.2 / 2
            phase = w * t + rng.uniform(0, 2 * np.pi)
            q[:, j] += part * np.sin(phase)
            v[:, j] += part * w * np.cos(phase)
            a[:, j] -= part * w * w * np.sin(phase)
    model = condyle.derive(mechanism, formulation="newton_euler", distribution="minimum_norm")
    wrench = np.zeros((len(t), 6))
    wrench[:, 3:5] = -drag * v[:, 2:]
    found = model.inverse_dynamics(q, v, a, wrench)
    assert not found.status.any()
    joint = model.inverse_kinematics(q).joint
    return Recorded(mechanism, t, joint, found.effort, found.contact_force)
