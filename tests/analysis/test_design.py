"""Designs: slopes against differences, ends against other searches, limits by evaluation."""

from __future__ import annotations

import csv
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import differential_evolution

import condyle
from condyle.analysis.design.design_problem import NONE, Point, Problem, Term
from condyle.analysis.design.design_study import DesignStudy
from condyle.analysis.sweep.job import prepared
from condyle.analysis.sweep.study import read_study
from condyle.errors import InputError

EACH = {"of": "effort", "take": "max", "over": ["time"]}
OFFSET = "contact.left_condyle.surface.offset"
PAIR = "chain.{}_{}.platform[2]"


def study(**changes: Any) -> dict[str, Any]:
    """Where two pairs of rods meet the platform, over the reference path at 20 Hz."""
    vary = [
        {"what": PAIR.format(name, "left"), "mirror": PAIR.format(name, "right"), "range": ends}
        for name, ends in (("masseter", [-0.0105, -0.0025]), ("temporalis", [0.0325, 0.0405]))
    ]
    measure = {
        "peak": {"of": "effort", "take": "max_abs"},
        "size": {"of": "effort", "take": "rms", "chain": "masseter_left"},
        "margin": {"of": "singularity_ratio", "take": "min", "better": "more"},
    }
    return {
        "backend": "numpy",
        "motion": {"file": "reference", "rate": 20.0},
        "vary": vary,
        "measure": measure,
        "minimise": "peak",
        "sampling": {"kind": "sobol", "count": 1},
        **changes,
    }


def problem(**changes: Any) -> Problem:
    return Problem(prepared(read_study(study(**changes), DesignStudy)))


def test_slopes_are_those_of_differences() -> None:
    p = problem()
    x, step = p.base + np.array([1e-3, -2e-3]), 1e-6
    terms = [Term(0, 1.0), Term(1, 1.0), Term(2, -1.0)]
    [here] = p.at(x)
    pieces = p.pieces(here, terms, [NONE] * 3)
    for term, one in zip(terms, pieces, strict=True):
        top = int(np.argmax(one.value))
        assert one.value[top] == pytest.approx(term.sign * here.measures[term.column], rel=1e-12)
        for i in range(2):
            up, down = (p.at(x + sign * step * np.eye(2)[i])[0] for sign in (1, -1))
            slope = (up.measures - down.measures)[term.column] / (2 * step)
            assert one.slope[top, i] == pytest.approx(term.sign * slope, rel=1e-5, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "asked",
    [
        {"minimise": "peak"},
        {"minimise": "size"},
        {"minimise": None, "maximise": "margin"},
        {"minimise": "peak", "limits": {"margin": {"least": 0.285}}},
    ],
    ids=["peak", "rms", "more", "limited"],
)
def test_no_variant_of_a_fine_grid_is_better(asked: dict[str, Any]) -> None:
    found = condyle.design(study(**asked))
    p = found.problem
    column, sign = p.cost
    ends = [np.linspace(a, b, 13) for a, b in zip(p.low, p.high, strict=True)]
    grid = p.at(np.array(list(product(*ends))))
    least = asked.get("limits", {}).get("margin", {}).get("least", -np.inf)
    values = [sign * one.measures[column] for one in grid if one.measures[2] >= least]
    best = sign * found.best.point.measures[column]
    assert best <= min(values) + 1e-6 * abs(best)
    assert found.best.kept and found.best.point.measures[2] >= least - 1e-6


def test_nothing_but_the_file_says_what_it_costs(tmp_path: Path) -> None:
    """The file that is written, loaded and solved by itself, has the cost that was said."""
    found = condyle.design(study(mechanism="masticatory"))
    files = found.save(tmp_path / "better")
    made = condyle.load_mechanism(files[0])
    solution = condyle.derive(made, backend="numpy").solve(
        condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], landmark="incisor", rate=20),
        condyle.reference_load(),
    )
    assert abs(solution["effort"]).max() == pytest.approx(found.best.point.measures[0], rel=1e-9)
    assert "[P] published" in files[0].read_text(encoding="utf-8")  # comments are kept
    with open(files[1], newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["peak"]) == pytest.approx(found.first.measures[0], rel=1e-12)
    assert len(rows) == 3


@pytest.mark.slow
def test_errors_of_a_size_cost_no_more_than_was_said() -> None:
    found = condyle.design(study(tolerance={"chain.*.platform": 1e-4}))
    line, real = found.tolerance["chain.*.platform"]
    best = found.best.point
    assert best.measures[0] < real and real == pytest.approx(line, rel=1e-3)
    rng, machine = np.random.default_rng(1), found.mechanism
    names = [f"chain.{name}.platform" for name in machine.chain_names]
    errors = 1e-4 * rng.choice([-1.0, 1.0], size=(40, len(names), 3))
    table = {n: np.array(machine.get(n)) + errors[:, i] for i, n in enumerate(names)}
    p = found.problem
    moved = p._points(p._model(best).variants(table), np.tile(best.x, (40, 1)))
    assert max(one.measures[0] for one in moved) < real * (1 + 1e-3)


@pytest.mark.slow
def test_a_front_is_one() -> None:
    found = condyle.design(study(pareto={"measure": "margin", "count": 4}))
    peak, margin = (np.array(found.front_table[name]) for name in ("peak", "margin"))
    assert (np.diff(peak) >= -1e-6).all() and (np.diff(margin) > 0).all()
    assert all(one.kept for one in found.front)


def short_cranks() -> condyle.Mechanism:
    """The masseters' cranks, half as long: they cannot follow."""
    machine = condyle.load_mechanism("masticatory")
    changes = {}
    for side in ("left", "right"):
        base, tip = (
            np.array(machine.get(f"chain.masseter_{side}.{k}")) for k in ("base", "crank_tip")
        )
        changes[f"chain.masseter_{side}.crank_tip"] = tuple(base + 0.25 * (tip - base))
    return machine.set(changes)


@pytest.mark.slow
def test_what_cannot_be_reached_has_a_measure_and_a_way_out() -> None:
    machine, whole = short_cranks(), condyle.load_mechanism("masticatory")
    names = [f"chain.masseter_{side}.{{}}[{k}]" for side, k in product(("left", "right"), range(3))]
    base, tip = (
        np.array([whole.get(n.format(key)) for n in names]) for key in ("base", "crank_tip")
    )
    own = machine.get(names[0].format("crank_tip"))
    times = (tip - base) / (tip - base)[0]  # all tips move with the first entry
    mirror = [
        {"what": name.format("crank_tip"), "times": a, "plus": b - a * base[0]}
        for name, a, b in list(zip(names, times, base, strict=True))[1:]
    ]
    vary = [
        {"what": names[0].format("crank_tip"), "range": sorted([own, tip[0]]), "mirror": mirror}
    ]
    asked = study(vary=vary)
    p = Problem(prepared(read_study(asked, DesignStudy), machine))
    [first] = p.at(p.base)
    assert not first.good and 0 < first.violation < 10 and "unreachable" in first.reason
    found = condyle.design(asked, mechanism=machine)
    assert found.best.point.good and np.isfinite(found.best.point.measures).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"minimise": None}, "one of minimise and maximise"),
        ({"minimise": "power"}, '"power" is no measure; here are peak'),
        ({"measure": {"peak": {"of": "power", "take": "max"}}}, "power has no derivatives"),
        ({"measure": {"peak": {"of": "effort", "take": "span"}}}, "expected take of min"),
        ({"measure": {"peak": EACH}}, "several numbers"),
        ({"vary": [{"what": "platform.mass", "values": [0.1, 0.2]}]}, "range or scale"),
        ({"vary": [{"what": "platform.mass", "range": [0.3, 0.4]}]}, "outside its range"),
        ({"vary": [{"what": OFFSET, "scale": [0.9, 1.1]}]}, "landmark"),
        ({"limits": {"margin": {}}}, "least, most or both"),
        ({"limit": {}}, "limit"),
        ({"pareto": {"measure": "peak"}}, "another measure than the cost"),
        ({"tolerance": {"chain.*.colour": 1e-3}}, "colour"),
    ],
)  # fmt: skip
def test_a_study_that_does_not_fit_is_refused(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        condyle.design(study(**changes))


@pytest.mark.ci
def test_no_worse_than_differential_evolution_and_sooner() -> None:
    base = condyle.load_mechanism("masticatory")
    vary = []
    for name, (k, sign) in product(("masseter", "temporalis"), enumerate((1.0, -1.0, 1.0))):
        path = f"chain.{name}_{{}}.platform[{k}]"
        x = base.get(path.format("left"))
        mirror = {"what": path.format("right"), "times": sign}
        vary.append(
            {"what": path.format("left"), "mirror": mirror, "range": [x - 0.004, x + 0.004]}
        )
    asked = study(vary=vary, backend="auto", limits={"margin": {"least": 0.28}})
    found = condyle.design(asked)
    mine = found.problem
    p = Problem(prepared(read_study(asked, DesignStudy)))

    def cost(X: np.ndarray) -> np.ndarray:
        over = lambda one: max(0.0, 0.28 - one.measures[2])  # noqa: E731

        def each(one: Point) -> float:
            return float(one.measures[0] + 100 * over(one)) if one.good else 10 + one.violation

        return np.array([each(one) for one in p.at(X.T)])

    other = differential_evolution(
        cost, list(zip(p.low, p.high, strict=True)), popsize=15, rng=1, vectorized=True,
        updating="deferred", polish=False,
    )  # fmt: skip
    assert found.best.point.measures[0] <= other.fun * (1 + 1e-6)
    assert mine.evaluations + 5 * mine.gradients < p.evaluations / 10  # each some 2.5
