"""All models side by side, their indices, and the paper's Table 2; references of a result."""

import gc
import inspect
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.analysis import paper
from condyle.analysis.comparison import Comparison, compare, relative_difference
from condyle.analysis.runs import TimedModel, without_collection
from condyle.analysis.torque_indices import indices
from condyle.dynamics import ROUTES
from condyle.mechanism.home import independent_coordinates
from condyle.mechanism.mechanism import Contact
from condyle.motion import Motion, bundled_reference
from condyle.progress import Step, watched_by

JAW = condyle.load_mechanism("masticatory")
FORMULATIONS = ["momentum", "lagrange"]  # in the place of all: they agree by the tests of dynamics
STEPS: dict[str, Step] = {}


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    """The reference motion at 50 Hz by every model of two formulations; its steps are noted."""

    class Noted(list[Step]):
        def append(self, step: Step) -> None:
            super().append(step)
            STEPS[step.what] = step

    with watched_by(Noted()), pytest.MonkeyPatch.context() as patch:
        patch.setattr("condyle.analysis.comparison.FORMULATIONS", FORMULATIONS)
        motion = Motion.from_csv(bundled_reference()[0], rate=50)
        return compare(JAW, motion, condyle.reference_load())


@pytest.fixture(scope="module")
def reference() -> Comparison:
    """All 5001 samples of the reference case, by one formulation."""
    motion, load = condyle.reference_motion(), condyle.reference_load()
    return compare(JAW, motion, load, formulations=["momentum"])


def small_motion(mechanism: condyle.Mechanism) -> Motion:
    """A little of every independent coordinate."""
    t = np.linspace(0, 1, 30)
    size = {n: 1e-3 if n in "XYZ" else 0.02 for n in independent_coordinates(mechanism)}
    return Motion.from_arrays(t, {name: a * np.sin(6 * t) for name, a in size.items()})


@pytest.mark.slow
def test_every_model_is_there(comparison: Comparison) -> None:
    models = [(run.formulation, run.route) for run in comparison.runs]
    assert models == [(name, route) for name in FORMULATIONS for route in ROUTES]
    assert [run.formulation for run in comparison.free_runs] == list(FORMULATIONS)
    assert not comparison.unavailable and comparison.samples == 251
    for run in (*comparison.runs, *comparison.free_runs):
        assert run.seconds.symbolic > 0 and run.seconds.numeric > 0
        assert run.seconds.total == run.seconds.symbolic + run.seconds.numeric
    count = len(comparison.runs)
    derived, ran = STEPS["deriving every model"], STEPS["running every model"]
    assert derived.done == derived.total == count
    assert ran.done == ran.total == count + len(comparison.free_runs)


@pytest.mark.slow
def test_models_agree(comparison: Comparison) -> None:
    """With each other, with and without contacts, and with what `solve` gives."""
    for contacts, runs in ((True, comparison.runs), (False, comparison.free_runs)):
        found = comparison.differences(contacts)
        assert len(found) == len(runs) * (len(runs) - 1) // 2
        assert max(pair.effort for pair in found) < 1e-10
        assert max(pair.contact_force for pair in found) < 1e-10
    solution = comparison.solution
    for run in comparison.runs:
        np.testing.assert_allclose(run.effort, solution["effort"].values, atol=1e-12)
        np.testing.assert_allclose(run.contact_force, solution["contact_force"].values, atol=1e-9)
        np.testing.assert_allclose(run.share.sum(axis=0), run.effort, atol=1e-12)


@pytest.mark.slow
def test_free_platform_needs_all_six_torques(comparison: Comparison) -> None:
    """Without contacts the platform moves identically, and nothing carries what they carried.

    The contacts' forces do no work, so both efforts give the same power along the motion; with the
    contacts it is the least of all efforts of that power.
    """
    held, free = comparison.runs[0], comparison.free_runs[0]
    assert free.contact_force.shape == (251, 0) and free.effort.shape == held.effort.shape
    rate = comparison.solution["joint_rate"].values
    power = (held.effort * rate).sum(axis=1), (free.effort * rate).sum(axis=1)
    np.testing.assert_allclose(*power, atol=1e-10)
    assert (np.linalg.norm(held.effort, axis=1) < np.linalg.norm(free.effort, axis=1) + 1e-12).all()


@pytest.mark.slow
def test_table_2_of_the_paper(comparison: Comparison, reference: Comparison) -> None:
    """Within a fifth, on the reference case; the same by every model."""
    assert [run.label for run in reference.runs] == ["momentum core", "momentum direct"]
    assert reference.run("momentum", "direct") is reference.runs[1]
    assert reference.run("momentum", "core", contacts=False) is reference.free_runs[0]
    assert reference.run("lagrange", "core") is None and 10 < reference.free_condition < 20
    for published, contacts in ((paper.TABLE_2, True), (paper.TABLE_2_FREE, False)):
        (found,) = reference.indices(contacts)
        assert found.unit == "N m" and found.samples == 5001
        assert published == pytest.approx({p: found.values[p] for p in published}, rel=0.2)
    (first,) = comparison.indices()
    parts = (comparison.solution[name].values for name in ("share", "part", "effort_unit"))
    shares, names, units = parts
    (again,) = indices(shares, list(names), list(units))
    assert first.values == pytest.approx(again.values, rel=1e-12)
    assert first.values["all"] == pytest.approx(0.0209, abs=1e-4)


def test_tables_as_printed_and_what_may_stand_beside_them() -> None:
    printed = {"momentum direct": 35.861, "lagrange direct": 61.265, "momentum core": 8.582}
    totals = {" ".join(key): seconds.total for key, seconds in paper.TABLE_1.items()}
    assert totals == pytest.approx(printed | {"lagrange core": 10.041})
    free = {name: seconds.total for name, seconds in paper.TABLE_1_FREE.items()}
    assert free == pytest.approx({"momentum": 7.258, "lagrange": 10.018})
    saved = {p: 1 - v / paper.TABLE_2_FREE[p] for p, v in paper.TABLE_2.items() if p != "all"}
    assert saved == pytest.approx(
        {"platform": 0.7232, "couplers": 0.5294, "cranks": 0.0909}, abs=5e-5
    )
    assert paper.is_paper_class(JAW) and paper.is_stand_in(JAW)
    other = JAW.replace(gravity=(0, 0, -1.62))
    assert paper.is_paper_class(other) and not paper.is_stand_in(other)
    for contacts in ((), JAW.contacts[:1]):
        assert not paper.is_paper_class(JAW.replace(contacts=contacts, dependent=None))
    for source, synthetic in (
        (condyle.reference_motion().source, True),
        ("/anywhere/condyle/motion/data/bite-force.csv", True),
        ("recordings/bite-force.csv", False),
    ):
        assert paper.is_synthetic(source) == synthetic


@pytest.mark.slow
def test_models_that_there_are_not() -> None:
    """Three contacts: no closed form, so no route `direct`; four chains, or no contacts to free."""
    surface = {"kind": "plane", "slope": (0.1, 0), "offset": -0.005}
    chin = Contact(name="chin", point=(0.05, 0, 0), surface=surface)
    three = JAW.replace(contacts=(*JAW.contacts, chin), dependent=None)
    found = compare(three, small_motion(three), formulations=["virtual_power"])
    assert [run.label for run in found.runs] == ["virtual_power core"]
    assert [one.label for one in found.unavailable] == ["virtual_power direct"]
    assert "route core" in found.unavailable[0].reason and len(found.free_runs) == 1
    four = JAW.replace(chains=JAW.chains[:4])
    none = JAW.replace(contacts=(), dependent=None)
    for machine, reason in ((four, "4 chains cannot drive"), (none, "no contacts to remove")):
        found = compare(machine, small_motion(machine), formulations=["virtual_power"])
        assert len(found.runs) == 2
        assert not found.free_runs and np.isnan(found.free_condition)
        assert reason in found.unavailable[-1].reason
        assert found.indices(contacts=False) == []
    t = np.linspace(0, 1, 10)
    far = Motion.from_arrays(t, np.outer(t, [0.2, 0, 0, 0]), ["X", "Y", "alpha", "beta"])
    with pytest.raises(condyle.UnreachableError):
        compare(JAW, far, formulations=["momentum"])


def test_relative_difference() -> None:
    a, b = np.array([[1.0, 100.0], [2.0, 50.0]]), np.array([[1.0, 101.0], [2.5, 50.0]])
    assert relative_difference(a, b) == pytest.approx(1 / 101)
    assert relative_difference(a, b, ["N m", "N"]) == pytest.approx(0.5 / 2.5)
    hole = np.array([[np.nan, np.nan], [2.0, 50.0]])
    for one, other in ((a, a), (a, hole), *[(np.zeros((2, n)),) * 2 for n in (0, 2)]):
        assert relative_difference(one, other) == 0.0


@pytest.mark.slow
def test_no_garbage_is_collected_while_a_model_is_derived() -> None:
    """A collection would be one model's seconds for what all models have left."""
    runs: list[str] = []
    gc.callbacks.append(lambda phase, info: runs.append(phase))
    before = gc.get_threshold()
    gc.set_threshold(10)
    try:
        five = JAW.replace(chains=JAW.chains[:5])  # whose equations nobody has written
        TimedModel(five, "momentum", "core")
        runs.clear()
        TimedModel(five, "lagrange", "core")
        assert len(runs) <= 4  # between the derivation and this line
    finally:
        gc.set_threshold(*before)
        gc.callbacks.pop()
    with pytest.raises(ValueError, match="wrong"), without_collection():
        assert not gc.isenabled()
        raise ValueError("wrong")
    assert gc.isenabled()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"mechanism": 3}, "mechanism: expected a mechanism"),
        ({"motion": 3}, "motion: expected a Motion"), ({"load": 3}, "load: expected a Load"),
        ({"formulations": 3}, "formulations: expected a name or several, got 3"),
        ({"formulations": ["newton"]}, "newton"), ({"formulations": ["momentums"]}, "Did you mean"),
        ({"formulations": []}, "formulations: expected at least one"),
        ({"weights": ["a"]}, "weights: expected an array of numbers"),
        ({"weights": 3}, "weights must be strictly increasing"),
        ({"load_point": "toe"}, "toe"), ({"distribution": "least"}, "least"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_named(arguments: dict[str, Any], words: str) -> None:
    for function in (condyle.compare, condyle.tradeoff):
        if arguments.keys() <= inspect.signature(function).parameters.keys():
            with pytest.raises(condyle.CondyleError, match=words):
                function(**arguments)


# -- the indices of eq. (67) by hand: of shares of platform and legs; the load must not enter

NAN = [float("nan")] * 2


@pytest.mark.parametrize(
    ("platform", "legs", "values"),
    [
        # The mean of norms; the norm of the sum, not the sum of norms; units are never mixed;
        # samples without a result are left out.
        ([[3, 4], [0, 0]], [[0, 0], [5, 12]], {"N m": (2, 9.0, 2.5, 6.5)}),
        ([[3, 0]], [[-3, 4]], {"N m": (1, 4.0, 3.0, 5.0)}),
        ([[3, 4, 12]], [[0, 0, 0]], {"N m": (1, 153**0.5, 153**0.5, 0), "N": (1, 4, 4, 0)}),
        ([[3, 4], NAN], [[0, 0], [0, 0]], {"N m": (1, 5.0, 5.0, 0.0)}),
        ([NAN], [[0, 0]], {"N m": (0, *[np.nan] * 3)}),
    ],
)
def test_indices_by_hand(platform: Any, legs: Any, values: Any) -> None:
    given = np.array([platform, legs, np.full(np.shape(platform), 1e6)], dtype=float)
    units = ["N m", "N", "N m"] if len(values) == 2 else ["N m"] * 2
    for load in ("load", "bite"):  # bite: in older solutions
        found = indices(given, ["platform", "legs", load], units)
        got = {
            o.unit: (o.samples, *(o.values[n] for n in ("all", "platform", "legs"))) for o in found
        }
        assert got.keys() == values.keys()
        for unit in values:
            assert got[unit] == pytest.approx(values[unit], nan_ok=True)
    (found,) = indices(np.ones((1, 1, 4)), ["platform"], ["N"] * 4)  # no load at all
    assert found.values == {"all": 2.0, "platform": 2.0}


# -- references


def keys(text: str) -> set[str]:
    return set(re.findall(r"^@\w+\{(\w+),$", text, re.MULTILINE))


@pytest.mark.slow
def test_references_are_whole_and_those_of_what_was_used(tmp_path: Path) -> None:
    plain = condyle.cite()
    assert keys(plain) == {"Cheng2023", "condyle", "CasADi", "xarray"}
    assert condyle.__version__ in plain and "VERSION" not in plain
    assert plain.count("{") == plain.count("}")
    motion = Motion.from_csv(bundled_reference()[0], rate=1)
    jaw = condyle.derive("human-jaw-muscles", distribution="cubic").solve(motion)
    jaw.condyle.save(tmp_path / "jaw.nc")
    used = keys(condyle.cite(tmp_path / "jaw.nc"))
    assert {"DAQP", "HiGHS", "DeGroote2016", "Hannam2008"} <= used
    assert keys(condyle.cite(model("masticatory").solve(motion))) == keys(plain)
    with pytest.raises(condyle.InputError, match="expected a solution of condyle"):
        condyle.cite(xr.Dataset())
