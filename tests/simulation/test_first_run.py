"""A first simulation waits for two kernels; what few samples are asked is answered by numpy."""

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.backends import choose
from condyle.model.model import WORTH_A_KERNEL
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
    assert model.for_samples(WORTH_A_KERNEL).backend.name == "numpy"
    assert model.for_samples(WORTH_A_KERNEL + 1) is model
