"""The filter of state and load against a textbook Kalman filter, written anew with numpy."""

from __future__ import annotations

import numpy as np
import pytest
from questions.jaw import M, jaw, place, point, run
from scipy.linalg import expm

T, ENCODER, ACCELERATION, WALK = 1e-3, 1e-4, np.array([0.02, 0.03, 0.4, 0.5]), 15.0
SIZE, N = 2 * M + 3, 6
LOWER = np.tril_indices(SIZE)


def discrete(B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """F and Q over T, by Van Loan's exponential; B: d q'' / df."""
    rates, G = np.zeros((SIZE, SIZE)), np.zeros((SIZE, SIZE))
    rates[:M, M : 2 * M], rates[M : 2 * M, 2 * M :] = np.eye(M), B
    G[range(M, SIZE), range(M, SIZE)] = np.concatenate([ACCELERATION**2, 3 * [WALK**2]])
    block = expm(T * np.block([[-rates, G], [np.zeros_like(G), rates.T]]))
    F = block[SIZE:, SIZE:].T
    return F, F @ block[:SIZE, SIZE:]


def test_it_is_a_kalman_filter() -> None:
    """Small motions about home, from nothing known of the load: the linear filter, n by n."""
    rng, home = np.random.default_rng(5), np.zeros((1, M))
    A = run(jaw().kernel("instant"), {"q": home, "q1": home})["A"][0].T  # d theta / dq
    F, Q = discrete(np.linalg.solve(jaw().mass_matrix(home[0]), place(home, point())[1][0].T))
    H, R = np.hstack([A, np.zeros((N, M + 3))]), ENCODER**2 * np.eye(N)
    effort = jaw().inverse_dynamics(*np.zeros((3, M))).effort
    numbers = {"period": T, "encoder_std": np.full(N, ENCODER), "resolution": np.zeros(N)}
    numbers |= {"acceleration_std": ACCELERATION, "force_std": WALK, "load_point": point()}
    x, P = np.zeros(SIZE), np.diag(np.repeat([1e-4, 1e-2, 5.0], [M, M, 3]) ** 2)
    y, C = x.copy(), P.copy()
    for tick in range(20):
        reading, acted = 1e-7 * rng.normal(size=N), effort + 1e-6 * rng.normal(size=N)
        ports = {"joint": reading[None], "acted": acted, "begun_before": float(tick > 0)}
        ports |= {"estimate_before": x, "covariance_before": P[LOWER], **numbers}
        found = {name: a[0] for name, a in run(jaw().kernel("kalman"), ports).items()}
        x, P[LOWER] = found["estimate"], found["covariance"]
        if tick:
            q2 = jaw().forward_dynamics(y[:M], y[M : 2 * M], acted, [*y[2 * M :], 0, 0, 0], point())
            y[2 * M :], f = 0, y[2 * M :].copy()
            y = F @ y + [*(T**2 / 2 * q2.acceleration), *(T * q2.acceleration), *f]
            C = F @ C @ F.T + Q
        nu = reading - H @ y
        S = H @ C @ H.T + R
        gain = C @ H.T @ np.linalg.inv(S)
        y, C = y + gain @ nu, C - gain @ H @ C
        # Less what encoders contradict each other: that is no part of a pose.
        contradiction = nu @ (nu - A @ np.linalg.lstsq(A, nu, rcond=None)[0]) / ENCODER**2
        innovation, std = nu @ np.linalg.solve(S, nu) - contradiction, np.sqrt(np.diag(C))
        assert np.abs(found["covariance"] - C[LOWER]).max() < 1e-6 * C.max()
        assert np.abs((P - C)[LOWER] / np.outer(std, std)[LOWER]).max() < 1e-5
        assert np.abs((x - y) / std).max() < 1e-5
        assert found["innovation"] == pytest.approx(innovation, rel=1e-4, abs=1e-12)
        np.testing.assert_array_equal(np.hstack([found[n] for n in ("q", "q1", "force")]), x)
