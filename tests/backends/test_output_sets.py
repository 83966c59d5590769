"""A question has a few kernels, whatever is asked for; what is not asked for does not come."""

from itertools import combinations

import numpy as np
import pytest
from support.machines import model

from condyle.questions.configuration import SETS as SURVEYS
from condyle.questions.forward import SETS as FORWARD
from condyle.questions.inverse import SETS as INVERSE
from condyle.questions.output_sets import OutputSets


@pytest.mark.parametrize("sets", [INVERSE, FORWARD, SURVEYS])
def test_two_or_three_kernels_serve_every_choice(sets: OutputSets) -> None:
    outputs = sets.covering(frozenset(sets._results))[0]
    choices = [frozenset(c) for n in range(len(outputs) + 1) for c in combinations(outputs, n)]
    found = {sets.covering(asked) for asked in choices}
    assert 2 <= len({own for own, _ in found}) <= 3
    assert all(asked <= {*sets.covering(asked)[0]} for asked in choices)
    assert sets.covering(frozenset(outputs)) == (outputs, frozenset())


@pytest.mark.parametrize("backend", ["numpy", pytest.param("compiled", marks=pytest.mark.slow)])
def test_what_is_not_asked_for_does_not_come_and_the_rest_is_the_same(
    backend: str, request: pytest.FixtureRequest
) -> None:
    """Bit by bit, of few samples and of many, which have ways of their own."""
    if backend == "compiled":
        request.getfixturevalue("compiler_command")
    machine = model("masticatory", backend)
    for count in (3, 1000):
        q, v, a = np.random.default_rng(1).uniform(-1e-3, 1e-3, (3, count, 4))
        whole = machine.inverse_dynamics(q, v, a, outputs="all")
        lean = machine.inverse_dynamics(q, v, a, outputs=("joint_rate",))
        assert {*vars(lean)} == {"effort", "contact_force", "bound", "status", "joint_rate"}
        some = machine.inverse_dynamics(q, v, a, outputs=("configuration", "share"))
        for name in ("effort", "contact_force", "share", "bound"):
            assert np.array_equal(getattr(some, name), getattr(whole, name)), name
        kernel = machine.kernel("inverse", INVERSE.covering(frozenset({"gravity"}))[0])
        given = {"q": q, "q1": v, "q2": a}
        given |= {"force": np.zeros((1, 3)), "moment": np.zeros((1, 3)), "point": np.zeros((1, 3))}
        every, few = kernel.run(given), kernel.run(given, None, frozenset({"share", "pose"}))
        assert {*every.values} - {*few.values} == {"share", "pose"}
        assert all(np.array_equal(a, every.values[name]) for name, a in few.values.items())
