"""A first simulation waits for two kernels; where these cannot vouch, slower ways are taken."""

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.backends import choose
from condyle.model.model import WORTH_A_KERNEL, model_for
from condyle.simulation.control import Controller
from condyle.simulation.first_scenario import default_scenario


def test_a_closed_loop_builds_two_kernels(
    compiler_command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    built = []

    class Counted(choose.CompiledKernel):
        def __init__(self, key: str, *given: Any) -> None:
            built.append(key.split("'")[1])
            super().__init__(key, *given)

    monkeypatch.setattr(choose, "CompiledKernel", Counted)
    model = condyle.derive("masticatory", backend="compiled")
    found = condyle.simulate(model, default_scenario().model_copy(update={"duration": 0.02}))
    assert built == ["rate", "tick"]
    assert np.isfinite(found.effort).all()
    assert model_for(model, WORTH_A_KERNEL).backend.name == "numpy"
    assert model_for(model, WORTH_A_KERNEL + 1) is model


def test_a_law_without_inverse_dynamics_goes_on_where_no_kernel_vouches(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The same efforts: the slower way has the same equations."""
    gains = {"stiffness": 5.0, "damping": 0.1, "gravity": False}
    scenario = {"duration": 0.02, "controller": {"kind": "joint_pd", **gains}}
    model = condyle.derive("masticatory", backend="numpy")
    plain = condyle.simulate(model, scenario)
    quick = Controller._solve

    def doubtful(self: Controller, *at: Any) -> np.ndarray:
        run = self.columns.run
        with monkeypatch.context() as patch:
            patch.setattr(self.columns, "run", lambda: run() or 1)
            return quick(self, *at)

    monkeypatch.setattr(Controller, "_solve", doubtful)
    again = condyle.simulate(model, scenario)
    np.testing.assert_array_equal(again.effort, plain.effort)
