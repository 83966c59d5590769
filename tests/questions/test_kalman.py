"""The filter of state and load against a textbook Kalman filter, written anew with numpy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from questions.test_laws import M, jaw, place, point
from scipy.linalg import expm

T, ENCODER, ACCELERATION, WALK = 1e-3, 1e-4, np.array([0.02, 0.03, 0.4, 0.5]), 15.0
SIZE, N = 2 * M + 3, 6
LOWER = np.tril_indices(SIZE)


@cache
def slope() -> tuple[np.ndarray, np.ndarray]:
    """d theta / dq and d q'' / df at home."""
    A = jaw().kernel("instant").run({"q": np.zeros((1, M)), "q1": np.zeros((1, M))}).values["A"]
    J = place(np.zeros((1, M)), point())[1][0]
    return A[..., 0].T, np.linalg.solve(jaw().mass_matrix(np.zeros(M)), J.T)


@cache
def discrete() -> tuple[np.ndarray, np.ndarray]:
    """F and Q over T, by Van Loan's exponential."""
    rates, G = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    rates[:M, M : 2 * M], rates[M : 2 * M, 2 * M :] = np.eye(M), slope()[1]
    G[range(M, SIZE), range(M, SIZE)] = np.concatenate([ACCELERATION**2, 3 * [WALK**2]])
    block = expm(T * np.block([[-rates, G], [np.zeros_like(G), rates.T]]))
    F = block[SIZE:, SIZE:].T
    return F, F @ block[:SIZE, SIZE:]


def called(
    reading: np.ndarray, acted: np.ndarray, x: np.ndarray, P: np.ndarray, begun: float = 1.0
) -> dict[str, np.ndarray]:
    ports = {
        "joint": reading, "acted": acted, "period": T, "encoder_std": np.full(N, ENCODER),
        "resolution": np.zeros(N), "acceleration_std": ACCELERATION, "force_std": WALK,
        "load_point": point(), "estimate_before": x, "covariance_before": P[LOWER],
        "begun_before": begun,
    }  # fmt: skip
    answer = jaw().kernel("kalman").run({n: np.atleast_2d(v) for n, v in ports.items()})
    assert not answer.status.any()
    return {name: np.moveaxis(a, -1, 0)[0] for name, a in answer.values.items()}


def test_it_is_a_kalman_filter() -> None:
    """Small motions about home, from nothing known of the load: the linear filter, n by n."""
    rng, (A, _), (F, Q) = np.random.default_rng(5), slope(), discrete()
    H, R = np.hstack([A, np.zeros((N, M + 3))]), ENCODER**2 * np.eye(N)
    x, P = np.zeros(SIZE), np.diag(np.repeat([1e-4, 1e-2, 5.0], [M, M, 3]) ** 2)
    effort = jaw().inverse_dynamics(*np.zeros((3, M))).effort
    y, C = x.copy(), P.copy()
    for tick in range(30):
        reading = 1e-7 * rng.normal(size=N)
        acted = effort + 1e-6 * rng.normal(size=N)
        found = called(reading, acted, x, P, float(tick > 0))
        x, P[LOWER] = found["estimate"], found["covariance"]
        if tick:
            q2 = jaw().forward_dynamics(y[:M], y[M : 2 * M], acted, [*y[2 * M :], 0, 0, 0], point())
            step = F @ [*y[: 2 * M], 0, 0, 0] + [
                *(T**2 / 2 * q2.acceleration), *(T * q2.acceleration), *y[2 * M :]
            ]  # fmt: skip
            y, C = step, F @ C @ F.T + Q
        nu = reading - H @ y
        S = H @ C @ H.T + R
        gain = C @ H.T @ np.linalg.inv(S)
        y, C = y + gain @ nu, C - gain @ H @ C
        innovation = nu @ np.linalg.solve(S, nu) - (
            nu @ (nu - A @ np.linalg.lstsq(A, nu, rcond=None)[0]) / ENCODER**2
        )
        std = np.sqrt(np.diag(C))
        assert np.abs(found["covariance"] - C[LOWER]).max() < 1e-6 * C.max()
        assert np.abs((P - C)[LOWER] / np.outer(std, std)[LOWER]).max() < 1e-5
        assert np.abs((x - y) / std).max() < 1e-5
        assert found["innovation"] == pytest.approx(innovation, rel=1e-4, abs=1e-12)
        np.testing.assert_array_equal(found["q"], x[:M])
        np.testing.assert_array_equal(found["q1"], x[M : 2 * M])
        np.testing.assert_array_equal(found["force"], x[2 * M :])
