"""A mechanism's numbers as ports of a question: the same results as with its own constants."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.cases import case, error
from support.speeds import few, slow

from condyle.backends.choose import Backend
from condyle.backends.kernel import AGAIN
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.program import Numbers
from condyle.questions import Question
from condyle.questions.file_numbers import numbers_of
from condyle.questions.structure import Structure, structure_of

# Chains of one family, of two in turn (in another order than the file's), contacts on quadrics.
CASES = ("masticatory", "mixed_k2_n8", "masticatory-curved", "mixed_k0_n7")


def two(name: str) -> tuple[Structure, list[Numbers]]:
    """Numbers of a case's mechanism and of another one like it."""
    machine = case(name).mechanism
    first = machine.chains[0].name
    at = f"chain.{first}.platform"
    other = machine.set({"platform.mass": 0.31, at: np.add(machine.get(at), (0.001, 0.002, 0.0))})
    structure = structure_of(machine)
    return structure, [numbers_of(structure, one) for one in (machine, other)]


def ports(numbers: Numbers) -> dict[str, np.ndarray]:
    """One row for all samples; lanes in the callers' order, groups with fewer numbers filled up."""
    size, n = max(len(own) for own in numbers.lanes), len(numbers.order)
    lanes = np.full((1, size, n), np.nan)  # what is not there is not read
    start = 0
    for own in numbers.lanes:
        for i, lane in enumerate(own.T):
            lanes[0, : len(lane), numbers.order[start + i]] = lane
        start += own.shape[1]
    return {"numbers": numbers.parameters[None], "lane_numbers": lanes}


@pytest.mark.parametrize("backend", few(["numpy", "compiled"], "numpy", rest=slow))
@pytest.mark.parametrize("name", CASES)
def test_columns_of_numbers(name: str, backend: str) -> None:
    """Of two mechanisms sample after sample in turn, and of each for all samples."""
    structure, numbers = two(name)
    details = ("contact", "share", "configuration")
    plain = Question.about(structure, "inverse", details)
    kernels = [NumpyKernel(plain.variants(), one) for one in numbers]
    asked = Question.about(structure, "inverse", details).with_ports()
    assert asked.key != plain.key
    kernel = Backend(backend).kernel(asked.key, asked.variants, Numbers.none(numbers[0].order))

    inputs = case(name).repeated(24).inputs
    wanted = [one.run(inputs) for one in kernels]
    given: list[Any] = [ports(one) for one in numbers]
    turns = np.arange(24) % 2
    both = {port: np.concatenate([one[port] for one in given])[turns] for port in given[0]}
    known = np.all([one.status != AGAIN for one in wanted], axis=0)
    for one, columns in zip((0, 1, turns), (*given, both), strict=True):
        found = kernel.run({**inputs, **columns})
        sure = known & (found.status != AGAIN)
        assert sure.sum() > 12
        for result, value in found.values.items():
            right = np.where(one, wanted[1].values[result], wanted[0].values[result])
            assert error(value[..., sure], right[..., sure]) < 1e-12, result
    assert error(wanted[0].values["effort"], wanted[1].values["effort"]) > 1e-6
