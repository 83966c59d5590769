"""Bryant angles against SciPy and central differences."""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from condyle.kinematics.rotation import Bryant, rotation

ANGLES = np.random.default_rng(1).uniform(-1.4, 1.4, (20, 3))
a = ca.SX.sym("a", 3)
R = ca.Function("R", [a], [rotation(a)])
R_omega = ca.Function("R_omega", [a], [Bryant.of(a).angular_velocity()])


def test_rotation_is_x_then_y_then_z() -> None:
    for angles in ANGLES:
        wanted = Rotation.from_euler("XYZ", angles).as_matrix()
        np.testing.assert_allclose(R(angles).full(), wanted, atol=1e-15)


def test_angular_velocity_is_that_of_the_rotation() -> None:
    """omega~ = R' R^T in {S}; the scan's sign of the last entry of eq. (8) would fail here."""
    h = 1e-5
    for angles, rates in zip(ANGLES, ANGLES[::-1], strict=True):
        R_rate = (R(angles + h * rates) - R(angles - h * rates)).full() / (2 * h)
        spin = R_rate @ R(angles).full().T
        omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        np.testing.assert_allclose(R_omega(angles).full() @ rates, omega, atol=1e-9)
