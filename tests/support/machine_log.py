"""A short log of the bundled robot, as its encoders and drives would have written it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .machines import model

STUDY = 'numbers = ["platform.mass", "platform.com[0]"]\n[noise]\neffort = 1e-3\nencoder = 1e-5\n'
DRIVES = """duration = 0.002
[controller]
kind = "joint_pd"
stiffness = 5
damping = 0.03
[sensors]
"""
LIGHTER = """minimise = "peak_effort"
motion = { file = "reference", rate = 10.0 }
backend = "numpy"
sampling = { kind = "sobol", count = 1 }
vary = [{ what = "platform.mass", scale = [0.9, 1.1] }]
"""
SHORT_PATH = 'numbers = ["platform.mass"]\nharmonics = 1\nstarts = 1\nsteps = 1\nrate = 100.0\n'
HELD = """
mechanism = "masticatory"
period = 1.0
intervals = 8
rate = 20.0
pose = [
    { t = 0.0, X = 0.0, Y = 0.0, alpha = 0.0, beta = 0.0 },
    { t = 0.5, X = 0.001, Y = 0.0003, alpha = 0.005, beta = 0.06 },
]
[bounds]
X = [-0.001, 0.0015]
Y = [-0.0005, 0.0005]
alpha = [-0.006, 0.006]
beta = [-0.005, 0.065]
[cost]
jerk = 1.0
"""
CYCLE = """
kind = "periodic"
period = 1.0
rate = 20.0
pose = [
    { X = 0.0, Y = 0.0, alpha = 0.0, beta = 0.0 },
    { X = 0.0, Y = 0.0, alpha = 0.0, beta = 0.02 },
    { X = 0.0, Y = 0.0, alpha = 0.0, beta = 0.01 },
]
"""


def write_log(path: Path) -> Path:
    """Two seconds at 100 Hz."""
    t = np.arange(0.0, 2.0, 0.01)
    w = 2 * np.pi
    own = model("masticatory")
    size = np.array([1e-3, 1e-3, 0.02, 0.02])
    phase = w * t[:, None] + np.arange(4)
    states = size * np.sin(phase), w * size * np.cos(phase), -w * w * size * np.sin(phase)
    joint = own.inverse_kinematics(states[0]).joint
    effort = own.inverse_dynamics(*states).effort
    chains = own.mechanism.chain_names
    names = ["t", *(f"joint_{c}" for c in chains), *(f"tau_{c}" for c in chains)]
    rows = np.column_stack([t, joint, effort])
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    return path


def write_poses(path: Path) -> Path:
    """Readings at eight poses, and the poses."""
    own = model("masticatory")
    q = np.random.default_rng(1).normal(size=(8, 4)) * [1e-3, 1e-3, 0.02, 0.02]
    found = own.inverse_kinematics(q)
    names = [f"joint_{c}" for c in own.mechanism.chain_names]
    names += ["X", "Y", "Z", "alpha", "beta", "gamma"]
    rows = np.column_stack([found.joint, found.pose])
    np.savetxt(path, rows, delimiter=",", header=",".join(names), comments="", fmt="%.12g")
    return path
