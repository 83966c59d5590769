"""Laws and loads of several files: scenarios that are alike but for numbers share kernels."""

from __future__ import annotations

from typing import Any

import numpy as np

import condyle

Table = dict[str, Any]
RK4: Table = {"method": "rk4", "step": 4e-4}
TORQUE: Table = {"kind": "computed_torque", "stiffness": 400.0, "rate": 500.0}
PD: Table = {"kind": "joint_pd", "stiffness": 2.0, "damping": 0.02, "rate": 500.0}
BITE: Table = {"kind": "bite_force", "stiffness": 900.0, "force": 40.0, "rate": 500.0}
FOOD: Table = {"kind": "food", "food": "bolus", "point": "right_molar", "thickness": 4e-3}
SPRING: Table = {"kind": "spring", "point": "incisor", "stiffness": 150.0, "damping": 1.5}
SPRING["rest"] = 1e-3
LOADS = [FOOD, SPRING]
FILTER = {"encoder_resolution": 1e-5, "velocity_cutoff": 100.0}
KALMAN: Table = {"sensors": {"encoder_noise": 1e-4}, "observer": {"kind": "kalman"}}


def eased(s: np.ndarray) -> np.ndarray:
    """From 0 to 1, with three derivatives that vanish at the ends."""
    s = np.clip(s, 0, 1)
    return s**4 * (35 - 84 * s + 70 * s**2 - 20 * s**3)


def jaw_path(t: np.ndarray, **columns: Any) -> condyle.Motion:
    names = ("X", "Y", "alpha", "beta")
    return condyle.Motion.from_arrays(t, dict.fromkeys(names, 0 * t) | columns)
