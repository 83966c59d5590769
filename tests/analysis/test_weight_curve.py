"""The curve between least effort and least load on the contacts."""

import numpy as np
import pytest
from support.machines import model
from support.speeds import first

import condyle
from condyle.analysis.comparison import compare
from condyle.analysis.weight_curve import Tradeoff, tradeoff
from condyle.model.distributing import Distribution
from condyle.report.figures.tradeoff_figure import apart, tradeoff_figure
from condyle.report.tables.comparison_tables import tradeoff_table

WEIGHTS = (0.0, 0.1, 1.0, 10.0, 1e3)
ROBOT = condyle.load_mechanism("masticatory")
MOTION = condyle.trial_motion(ROBOT, rate=5)


@pytest.fixture(scope="module")
def curve() -> Tradeoff:
    return tradeoff(ROBOT, MOTION, weights=WEIGHTS, backend="numpy")


def test_more_effort_buys_less_load(curve: Tradeoff) -> None:
    assert (np.diff(curve.effort) > 0).all() and (np.diff(curve.load) < 0).all()
    assert curve.samples == curve.solution.sizes["time"] and curve.solution["status"].sum() == 0
    assert curve.mean.shape == curve.peak.shape == (5, 2) and (curve.peak >= curve.mean).all()
    assert curve.load[-1] < 0.1 * curve.load[0]


def test_every_point_is_the_least_of_all_efforts(curve: Tradeoff) -> None:
    """Efforts that balance form a plane here, which three of them span; its least is algebra."""
    unit, limit = model("masticatory").reference_force ** 2, 3.0
    weighted = (Distribution("weighted", 0, w) for w in (0.0, 1.0, 30.0))
    found = [model("masticatory").with_distribution(one).solve(MOTION) for one in weighted]
    rows = found[0].sizes["time"]
    for w, weight in enumerate(curve.weights):
        squares, by = 0.0, np.sqrt(weight / unit)
        for i in range(rows):
            pairs = [(one["effort"].values[i], one["contact_force"].values[i]) for one in found]
            scaled = [np.concatenate([effort / limit, by * force]) for effort, force in pairs]
            G = np.column_stack([scaled[1] - scaled[0], scaled[2] - scaled[0]])
            z = np.linalg.lstsq(G, -scaled[0], rcond=None)[0]
            squares += float(((scaled[0] + G @ z)[:6] ** 2).sum())
        assert curve.effort[w] == pytest.approx(np.sqrt(squares / rows), rel=1e-7)
    efforts = found[0]["effort"].values  # the first is weighted without a weight
    assert curve.activation[0] == pytest.approx(np.abs(efforts).max() / limit)
    np.testing.assert_allclose(curve.solution["effort"], efforts)


def test_table_and_figure(curve: Tradeoff) -> None:
    table = tradeoff_table(curve)
    assert [record["weight"] for record in table.records] == list(WEIGHTS)
    assert all(len(row) == len(table.columns) == 6 for row in table.rows)
    assert table.records[2]["mean_left_condyle"] == curve.mean[2, 0]
    line = tradeoff_figure(curve).axes[0].get_lines()[0]
    np.testing.assert_array_equal(line.get_xydata(), np.column_stack([curve.effort, curve.load]))
    assert apart(curve)[0] == 0 and apart(curve, least=2.0) == [0]


def test_what_has_no_curve() -> None:
    jaw = condyle.load_mechanism("human-jaw")
    name = jaw.chain_names[0]
    free = jaw.set(f"chain.{name}.actuator.force_limit", None)
    for machine, weights, said in (
        (condyle.load_mechanism("gough-stewart"), WEIGHTS, "has no contacts"),
        (ROBOT, (1.0, 0.5), "strictly increasing"),
        (free, WEIGHTS, f"{name} has none"),
    ):
        with pytest.raises(condyle.InputError, match=said):
            tradeoff(machine, condyle.trial_motion(machine, rate=2), weights=weights)


@pytest.mark.slow
@pytest.mark.parametrize("name", first(["bounded", "weighted"]))
def test_models_agree_under_every_distribution(name: str) -> None:
    found = compare(ROBOT, MOTION, formulations=["momentum"], distribution=name)
    assert max(pair.effort for pair in found.differences()) < 1e-9
    assert found.solution.condyle.options["distribution"] == name
