"""A short log of the bundled robot, as its encoders and drives would have written it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import condyle

STUDY = 'numbers = ["platform.mass", "platform.com[0]"]\n[noise]\neffort = 1e-3\nencoder = 1e-5\n'


def write_log(path: Path) -> Path:
    """Two seconds at 100 Hz."""
    t = np.arange(0.0, 2.0, 0.01)
    w = 2 * np.pi
    model = condyle.derive("masticatory", backend="numpy")
    size = np.array([1e-3, 1e-3, 0.02, 0.02])
    phase = w * t[:, None] + np.arange(4)
    states = size * np.sin(phase), w * size * np.cos(phase), -w * w * size * np.sin(phase)
    joint = model.inverse_kinematics(states[0]).joint
    effort = model.inverse_dynamics(*states).effort
    chains = model.mechanism.chain_names
    names = ["t", *(f"joint_{c}" for c in chains), *(f"tau_{c}" for c in chains)]
    rows = np.column_stack([t, joint, effort])
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    return path
