"""Bryant angles against SciPy and central differences; functions of vectors at many samples."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from condyle.kinematics.batch import evaluate
from condyle.kinematics.rotation import Bryant, rotation

ANGLES = np.random.default_rng(1).uniform(-1.4, 1.4, (20, 3))
a = ca.SX.sym("a", 3)
R = ca.Function("R", [a], [rotation(a)])
R_omega = ca.Function("R_omega", [a], [Bryant.of(a).angular_velocity()])


def test_rotation_is_x_then_y_then_z_and_turns_with_its_rates() -> None:
    """omega~ = R' R^T in {S}; the scan's sign of the last entry of eq. (8) would fail here."""
    h = 1e-5
    for angles, rates in zip(ANGLES, ANGLES[::-1], strict=True):
        wanted = Rotation.from_euler("XYZ", angles).as_matrix()
        np.testing.assert_allclose(R(angles).full(), wanted, atol=1e-15)
        R_rate = (R(angles + h * rates) - R(angles - h * rates)).full() / (2 * h)
        spin = R_rate @ wanted.T
        omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        np.testing.assert_allclose(R_omega(angles).full() @ rates, omega, atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 300])
def test_every_sample_by_itself(count: int) -> None:
    """Matrices column by column, zeros that no entry stores, inputs that are the same for all."""
    x, y, none = ca.SX.sym("x", 3), ca.SX.sym("y", 2), ca.SX.sym("none", 0)
    sparse = ca.SX(2, 3)
    sparse[0, 1], sparse[1, 2] = x[0], x[1] * y[0]
    f = ca.Function("f", [x, y, none], [sparse, ca.dot(x, x), none])
    given = np.random.default_rng(0).normal(size=(count, 3))
    matrix, square, empty = evaluate(f, given[:, ::-1], np.array([2, 5]), np.zeros((count, 0)))
    wanted = np.zeros((count, 6))
    wanted[:, 2], wanted[:, 5] = given[:, 2], 2 * given[:, 1]
    np.testing.assert_array_equal(matrix, wanted)
    np.testing.assert_allclose(square[:, 0], (given**2).sum(axis=1), rtol=1e-15)
    assert empty.shape == (count, 0)
