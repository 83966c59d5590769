"""Every question as a kernel, of chains of three families that fill no vector: numpy's numbers
whatever the lanes' inputs are, in batches and one by one; as it is, by directions, in reverse."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.cases import error, ones
from support.families import case

from condyle.backends.c.compiled_kernel import CompiledKernel
from condyle.backends.kernel import columns_of, shapes_of
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.program import Numbers, Programs
from condyle.graph.transform import number_ports
from condyle.questions import QUESTIONS, Question
from condyle.questions.file_numbers import numbers_of
from condyle.questions.law.computed_torque import ComputedTorque
from condyle.questions.structure import structure_of

slow, ci = pytest.mark.slow, pytest.mark.ci
SIZE = 0.03  # of inputs, but of these, which a Kalman filter divides by or takes roots of
POSITIVE = {"period", "encoder_std", "acceleration_std", "force_std", "begun_before"}
DETAILS: dict[str, tuple[Any, ...]] = {
    "lifting": ((("plane", 3, False),),),
    "tick": (ComputedTorque,),
}
# `derivative` is a way to ask the others, `test_variant_numbers` asks `file_numbers`, and `passive`
# is of muscles alone; `impact` is of contacts that lift, without lane inputs.
NAMES = sorted({*QUESTIONS} - {"derivative", "file_numbers", "impact", "passive"})
# Of these a minimum over the lanes is no derivative.
LEAST = {
    "allocation",
    "balance",
    "configuration",
    "elastic",
    "elastic_held",
    "forward_system",
    "levelled",
    "elastic_yielding",
    "limited",
    "system",
}
WAYS = ("itself", "numbers as ports", "directional", "gradient")
ASKED = [(n, way) for n in NAMES for way in (WAYS[:2] if n in LEAST else WAYS)]
QUICK = [("encoders", "gradient"), ("motion", "directional"), ("inverse", "numbers as ports")]
# Rounding where no number is near a switch; iterations (`pose`, `kalman`) leave as much.
ALIKE = 1e-9
NOTHING = 1e-15  # of results that are 0, such as some reactions


@pytest.mark.parametrize(
    ("name", "way", "width"),
    [
        pytest.param(*asked, width, marks=slow if asked in QUICK else ci)
        for asked in ASKED
        for width in ((4, 8) if asked in QUICK else (8,) if asked[1] == "gradient" else (4,))
    ],
)
@pytest.mark.usefixtures("compiler_command")
def test_lane_inputs(name: str, way: str, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CONDYLE_LANES", str(width))
    machine = case("mixed").mechanism
    structure = replace(structure_of(machine), losses=True)
    assert structure.counts == (2, 2, 2)
    numbers = own = numbers_of(structure, machine)
    asked = Question.about(structure, name, *DETAILS.get(name, ()))
    if way == "numbers as ports":
        asked, own = asked.with_ports(), Numbers.none(numbers.order)
    elif way != "itself":
        main = asked.variants().main
        by = *(port.name for port in main.ports), "numbers", "lane_numbers"
        of = tuple(o.name for o in main.outputs)
        details = way, name, asked.details, by, of
        asked = Question.about(structure, "derivative", *details)
    found = asked.variants()
    for program in filter(None, (found.main, found.robust)):
        require_numpys(Programs(program, single=True), own, number_ports(numbers))


def require_numpys(variants: Programs, numbers: Numbers, fixed: dict[str, np.ndarray]) -> None:
    rng, face = np.random.default_rng(1), variants.main.interface
    inputs = {n: rng.uniform(-SIZE, SIZE, (8, *shape)) for n, shape in shapes_of(face).items()}
    for port in POSITIVE & inputs.keys():
        inputs[port] += 1.0
    if "covariance_before" in inputs:
        rows = int(np.sqrt(2 * inputs["covariance_before"].shape[1]))
        inputs["covariance_before"] += np.eye(rows)[np.tril_indices(rows)]
    for port in fixed.keys() & inputs:
        inputs[port] = fixed[port] * (1 + 1e-4 * inputs[port])
    kernel = CompiledKernel(None, lambda: variants, numbers)
    right = NumpyKernel(variants, numbers).run(inputs)
    _, columns = columns_of(face, inputs, numbers.order)
    single, _ = ones(kernel, np.column_stack(columns))
    for got in (kernel.run(inputs).values, single):
        for result, value in right.values.items():
            known = np.isfinite(value)
            size = np.abs(value[known]).max(initial=0.0)
            if result in ("bound", "data_error") or size < NOTHING:  # rounding itself
                continue
            assert error(np.where(known, got[result], 0), np.where(known, value, 0)) < ALIKE
