"""A mechanism's numbers as ports of a question: the same results as with its own constants."""

from __future__ import annotations

import numpy as np
import pytest
from support.cases import case, error

from condyle.backends.choose import Backend
from condyle.backends.kernel import AGAIN
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.program import Numbers
from condyle.questions import Question
from condyle.questions.file_numbers import numbers_of
from condyle.questions.structure import structure_of

slow, ci = pytest.mark.slow, pytest.mark.ci


def ports(numbers: Numbers) -> dict[str, np.ndarray]:
    """One row for all samples; lanes in the callers' order, groups with fewer numbers filled up."""
    size, n = max(own.shape[1] for own in numbers.lanes), len(numbers.order)
    lanes = np.full((1, size, n), np.nan)  # what is not there is not read
    columns = [lane for (own,) in numbers.lanes for lane in own.T]
    for at, lane in zip(numbers.order, columns, strict=True):
        lanes[0, : len(lane), at] = lane
    return {"numbers": numbers.parameters, "lane_numbers": lanes}


@pytest.mark.parametrize(
    ("name", "backend"),
    [
        ("mixed_k2_n8", "numpy"),  # two families in turn, in another order than the file's
        pytest.param("masticatory-curved", "numpy", marks=slow),  # contacts on quadrics
        pytest.param("mixed_k2_n8", "compiled", marks=slow),
        pytest.param("masticatory", "numpy", marks=ci),
        pytest.param("mixed_k0_n7", "compiled", marks=ci),
    ],
)
def test_columns_of_numbers(name: str, backend: str) -> None:
    """Of two mechanisms sample after sample in turn, and of each for all samples."""
    machine = case(name).mechanism
    at = f"chain.{machine.chains[0].name}.platform"
    other = machine.set({"platform.mass": 0.31, at: np.add(machine.get(at), (0.001, 0.002, 0.0))})
    structure = structure_of(machine)
    numbers = [numbers_of(structure, one) for one in (machine, other)]
    plain = Question.about(structure, "inverse", ("contact", "share", "configuration"))
    asked = plain.with_ports()
    assert asked.key != plain.key
    kernel = Backend(backend).kernel(asked.key, asked.variants, Numbers.none(numbers[0].order))

    inputs = case(name).repeated(24).inputs
    wanted = [NumpyKernel(plain.variants(), one).run(inputs) for one in numbers]
    first, second = (ports(one) for one in numbers)
    turns = np.arange(24) % 2
    both = {port: np.concatenate([first[port], second[port]])[turns] for port in first}
    known = np.all([one.status != AGAIN for one in wanted], axis=0)
    for which, columns in ((0, first), (1, second), (turns, both)):
        found = kernel.run({**inputs, **columns})
        sure = known & (found.status != AGAIN)
        assert sure.sum() > 12
        for result, value in found.values.items():
            right = np.where(which, wanted[1].values[result], wanted[0].values[result])
            assert error(value[..., sure], right[..., sure]) < 1e-12, result
    assert error(wanted[0].values["effort"], wanted[1].values["effort"]) > 1e-6
