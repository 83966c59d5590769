"""All models side by side."""

from __future__ import annotations

import gc
import inspect
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.analysis.comparison import Comparison, compare, relative_difference
from condyle.analysis.runs import TimedModel, without_collection
from condyle.dynamics import FORMULATIONS, ROUTES
from condyle.mechanism import Mechanism
from condyle.mechanism.home import independent_coordinates
from condyle.mechanism.mechanism import Contact
from condyle.motion import Motion

pytestmark = pytest.mark.slow


def small_motion(mechanism: Mechanism) -> Motion:
    """A little of every independent coordinate."""
    t = np.linspace(0, 1, 30)
    names = independent_coordinates(mechanism)
    size = {name: 1e-3 if name in "XYZ" else 0.02 for name in names}
    return Motion.from_arrays(t, {name: a * np.sin(6 * t) for name, a in size.items()})


def test_every_model_is_there(comparison: Comparison) -> None:
    models = [(run.formulation, run.route) for run in comparison.runs]
    assert models == [(name, route) for name in FORMULATIONS for route in ROUTES]
    assert [run.formulation for run in comparison.free_runs] == list(FORMULATIONS)
    assert not comparison.unavailable
    assert comparison.samples == 251


@pytest.mark.parametrize("contacts", [True, False])
def test_models_agree(comparison: Comparison, contacts: bool) -> None:
    found = comparison.differences(contacts)
    count = len(comparison.runs if contacts else comparison.free_runs)
    assert len(found) == count * (count - 1) // 2
    assert max(pair.effort for pair in found) < 1e-10
    assert max(pair.contact_force for pair in found) < 1e-10


def test_runs_are_what_solve_gives(comparison: Comparison) -> None:
    solution = comparison.solution
    for run in comparison.runs:
        np.testing.assert_allclose(run.effort, solution["effort"].values, atol=1e-12)
        np.testing.assert_allclose(run.contact_force, solution["contact_force"].values, atol=1e-9)
        np.testing.assert_allclose(run.share.sum(axis=0), run.effort, atol=1e-12)


def test_free_platform_needs_all_six_torques(comparison: Comparison) -> None:
    """Without contacts the platform moves identically, and nothing carries what they carried."""
    held, free = comparison.runs[0], comparison.free_runs[0]
    assert free.contact_force.shape == (251, 0)
    assert free.effort.shape == held.effort.shape
    # The contacts' forces do no work, so both efforts give the same power along the motion.
    rate = comparison.solution["joint_rate"].values
    power = (held.effort * rate).sum(axis=1), (free.effort * rate).sum(axis=1)
    np.testing.assert_allclose(*power, atol=1e-10)
    # With the contacts it is the least of all efforts of that power.
    assert (np.linalg.norm(held.effort, axis=1) < np.linalg.norm(free.effort, axis=1) + 1e-12).all()


def test_seconds_are_measured(comparison: Comparison) -> None:
    for run in (*comparison.runs, *comparison.free_runs):
        assert run.seconds.symbolic > 0 and run.seconds.numeric > 0
        assert run.seconds.total == run.seconds.symbolic + run.seconds.numeric


def test_one_formulation_and_the_run_of_a_name(reference: Comparison) -> None:
    assert [run.label for run in reference.runs] == ["momentum core", "momentum direct"]
    assert reference.run("momentum", "direct") is reference.runs[1]
    assert reference.run("momentum", "core", contacts=False) is reference.free_runs[0]
    assert reference.run("lagrange", "core") is None
    assert 10 < reference.free_condition < 20


def test_unknown_formulation() -> None:
    mechanism = condyle.load_mechanism("masticatory")
    with pytest.raises(condyle.InputError, match="Did you mean"):
        compare(mechanism, condyle.reference_motion(), formulations=["momentums"])


def test_models_that_there_are_not() -> None:
    """Three contacts: no closed form, so no route `direct`; the message says which to take."""
    mechanism = condyle.load_mechanism("masticatory")
    chin = Contact(
        name="chin",
        point=(0.05, 0, 0),
        surface={"kind": "plane", "slope": (0.1, 0), "offset": -0.005},
    )
    three = mechanism.replace(contacts=(*mechanism.contacts, chin), dependent=None)
    found = compare(three, small_motion(three), formulations=["lagrange"])
    assert [run.label for run in found.runs] == ["lagrange core"]
    assert [one.label for one in found.unavailable] == ["lagrange direct"]
    assert "route core" in found.unavailable[0].reason
    assert len(found.free_runs) == 1


def test_nothing_to_free() -> None:
    mechanism = condyle.load_mechanism("masticatory")
    four = mechanism.replace(chains=mechanism.chains[:4])
    none = mechanism.replace(contacts=(), dependent=None)
    for machine, reason in ((four, "4 chains cannot drive"), (none, "no contacts to remove")):
        found = compare(machine, small_motion(machine), formulations=["momentum"])
        assert len(found.runs) == 2
        assert not found.free_runs and np.isnan(found.free_condition)
        assert reason in found.unavailable[-1].reason
        assert found.indices(contacts=False) == []


def test_samples_that_cannot_be_computed() -> None:
    mechanism = condyle.load_mechanism("masticatory")
    t = np.linspace(0, 1, 10)
    far = Motion.from_arrays(t, np.outer(t, [0.2, 0, 0, 0]), ["X", "Y", "alpha", "beta"])
    with pytest.raises(condyle.UnreachableError):
        compare(mechanism, far, formulations=["momentum"])


def test_relative_difference() -> None:
    a = np.array([[1.0, 100.0], [2.0, 50.0]])
    b = np.array([[1.0, 101.0], [2.5, 50.0]])
    assert relative_difference(a, b) == pytest.approx(1 / 101)
    assert relative_difference(a, b, ["N m", "N"]) == pytest.approx(0.5 / 2.5)
    assert relative_difference(a, a) == 0.0
    hole = np.array([[np.nan, np.nan], [2.0, 50.0]])
    assert relative_difference(a, hole) == 0.0
    assert relative_difference(np.zeros((2, 0)), np.zeros((2, 0))) == 0.0
    assert relative_difference(np.zeros((2, 2)), np.zeros((2, 2))) == 0.0


def test_no_garbage_is_collected_while_a_model_is_derived() -> None:
    """A collection would be one model's seconds for what all models have left."""
    runs: list[str] = []
    gc.callbacks.append(lambda phase, info: runs.append(phase))
    before = gc.get_threshold()
    gc.set_threshold(10)
    try:
        mechanism = condyle.load_mechanism("masticatory")
        TimedModel(mechanism, "momentum", "core")
        runs.clear()
        TimedModel(mechanism, "lagrange", "core")
        assert len(runs) <= 4  # between the derivation and this line
    finally:
        gc.set_threshold(*before)
        gc.callbacks.pop()


def test_collection_goes_on_after_an_error() -> None:
    with pytest.raises(ValueError, match="wrong"), without_collection():
        assert not gc.isenabled()
        raise ValueError("wrong")
    assert gc.isenabled()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"mechanism": 3}, "mechanism: expected a mechanism"),
        ({"motion": 3}, "motion: expected a Motion"),
        ({"load": 3}, "load: expected a Load"),
        ({"formulations": 3}, "formulations: expected a name or several, got 3"),
        ({"formulations": ["newton"]}, "newton"),
        ({"formulations": []}, "formulations: expected at least one"),
        ({"weights": ["a"]}, "weights must be strictly increasing"),
        ({"weights": 3}, "weights must be strictly increasing"),
        ({"load_point": "toe"}, "toe"),
        ({"distribution": "least"}, "least"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict[str, Any], words: str) -> None:
    for function in (condyle.compare, condyle.tradeoff):
        if arguments.keys() <= inspect.signature(function).parameters.keys():
            with pytest.raises(condyle.CondyleError, match=words):
                function(**arguments)
