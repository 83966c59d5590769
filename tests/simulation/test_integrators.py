"""Orders, agreement, and what results must not depend on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.model.model import Model
from condyle.simulation.integrators import RK4, Adaptive, NoRateError, Settings, hermite

START = {"X": 0.001, "beta": 0.04, "dbeta": -0.3, "dalpha": 0.2}


def free(model: Model, **scenario: Any) -> xr.Dataset:
    """A fall of 10 ms from START."""
    return condyle.simulate(model, {"duration": 0.01, "start": START, **scenario})


def last(solution: xr.Dataset) -> np.ndarray:
    """Pose and its rate at the end, (12,)."""
    return np.concatenate([solution[name].values[-1] for name in ("pose", "pose_rate")])


def test_rk4_is_of_fourth_order(jaw: Model) -> None:
    exact = last(free(jaw, rtol=1e-13))
    errors = [
        np.abs(last(free(jaw, method="rk4", step=step)) - exact).max()
        for step in (1e-3, 5e-4, 2.5e-4)
    ]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (np.abs(orders - 4) < 0.25).all()


def test_methods_agree(jaw: Model) -> None:
    one, other = (last(free(jaw, method=m, rtol=1e-10)) for m in ("DOP853", "Radau"))
    assert np.abs(one - other).max() < 1e-8


@pytest.mark.parametrize("method", [{}, {"method": "rk4", "step": 5e-4}])
def test_results_do_not_depend_on_their_grid(plain: Model, method: dict[str, Any]) -> None:
    """Nor does it matter that there is a grid between the steps: interpolation keeps the order."""
    coarse, fine = (free(plain, rate=rate, rtol=1e-11, **method) for rate in (200, 3700))
    assert np.abs(last(coarse) - last(fine)).max() < 1e-15
    if not method:
        at = fine.interp(time=coarse["time"].values[1], method="cubic")
        assert np.abs(at["pose"] - coarse["pose"][1]).max() < 1e-7


def test_a_step_is_a_cubic_between_its_ends() -> None:
    """Values and rates of a cubic come back exactly."""
    cubic, rate = (lambda t: np.array([t**3 - t])), (lambda t: np.array([3 * t**2 - 1]))
    found = hermite(0.3, 0.5, cubic(1.0), rate(1.0), cubic(1.5), rate(1.5))
    assert np.isclose(found[0], cubic(1.15)[0], rtol=1e-14)
    stepper = RK4(lambda t, y: 3 * np.array([t**2]), Settings(1e-9, np.zeros(1), 0.4))
    stepper.restart(0.0, np.zeros(1), 1.0)
    steps = [stepper.step() for _ in range(3)]
    assert [s.t1 for s in steps][-1] == 1.0 and np.isclose(steps[-1].y1[0], 1.0, rtol=1e-14)


def test_contacts_are_kept(plain: Model) -> None:
    """Every pose is on the surfaces, however long: the state is the independent coordinates."""
    solution = free(plain)
    assert plain.poses.contact_residual(solution["pose"].values) < 1e-13
    assert (solution["status"].values == 0).all()


def test_breakpoints_that_are_close_are_no_sign_of_stiffness() -> None:
    stepper = Adaptive("DOP853", lambda t, y: np.ones(1), Settings(1e-9, np.full(1, 1e-12)))
    y = np.zeros(1)
    for start, until in ((0.0, 1.0), (1.0, 1.0 + 2e-9), (1.0 + 2e-9, 2.0)):
        stepper.restart(start, y, until)
        while (step := stepper.step()).t1 < until:
            pass
        y = step.y1
    assert np.isclose(y[0], 2.0, rtol=1e-12)


def test_steps_have_a_floor() -> None:
    """Towards a rate without bound, beyond which there is none, a run ends soon and says why."""
    calls = []

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        calls.append(t)
        if t >= 1.0:
            raise NoRateError(3)
        return np.array([1 / np.sqrt(1 - t)])

    stepper = Adaptive("DOP853", rate, Settings(1e-9, np.full(1, 1e-12)))
    stepper.restart(0.0, np.zeros(1), 2.0)
    with pytest.raises(NoRateError) as error:
        for _ in range(1000):
            step = stepper.step()
    assert error.value.status == 3 and len(calls) < 6000
    assert 1.0 - step.t1 < 1e-5
