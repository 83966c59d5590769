"""Designs: slopes against differences, ends against other searches, limits by evaluation."""

import csv
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.analysis.design.design_problem import NONE, DesignProblem, Term
from condyle.analysis.design.design_study import DesignStudy
from condyle.analysis.sweep.job import prepared
from condyle.errors import InputError

ROBOT = condyle.load_mechanism("masticatory")
EACH = {"of": "effort", "take": "max", "over": ["time"]}
OFFSET = "contact.left_condyle.surface.offset"
PAIR = "chain.{}_{}.platform[2]"
RATE = 10.0


def study(**changes: Any) -> dict[str, Any]:
    """Where two pairs of rods meet the platform, over the reference path at 10 Hz."""
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
        "motion": {"file": "reference", "rate": RATE},
        "vary": vary,
        "measure": measure,
        "minimise": "peak",
        "sampling": {"kind": "sobol", "count": 1},
        **changes,
    }


def problem(machine: condyle.Mechanism | None = None, **changes: Any) -> DesignProblem:
    return DesignProblem(prepared(DesignStudy.read(study(**changes)), machine))


@pytest.mark.slow
def test_slopes_are_those_of_differences() -> None:
    p = problem()
    x, step = p.base + np.array([1e-3, -2e-3]), 1e-6
    terms = [Term(0, 1.0), Term(1, 1.0), Term(2, -1.0)]
    [here] = p.at(x)
    for term, one in zip(terms, p.pieces(here, terms, [NONE] * 3), strict=True):
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
        {"minimise": "peak", "limits": {"margin": {"least": 0.285}}},
        {"minimise": None, "maximise": "margin"},
        pytest.param({"minimise": "size"}, marks=pytest.mark.ci),
    ],
    ids=["peak, limited", "more", "rms"],
)
def test_no_variant_of_a_fine_grid_is_better(asked: dict[str, Any]) -> None:
    found = condyle.design(study(**asked))
    p = found.problem
    column, sign = p.cost
    ends = [np.linspace(a, b, 9) for a, b in zip(p.low, p.high, strict=True)]
    grid = p.at(np.array(list(product(*ends))))
    least = asked.get("limits", {}).get("margin", {}).get("least", -np.inf)
    values = [sign * one.measures[column] for one in grid if one.measures[2] >= least]
    best = sign * found.best.point.measures[column]
    assert best <= min(values) + 1e-6 * abs(best)
    assert found.best.feasible and found.best.point.measures[2] >= least - 1e-6


@pytest.mark.slow
def test_no_search_by_chance_ends_lower() -> None:
    """Four legs of a hexapod, against boxes of random points that shrink round the best one."""
    machine, least = condyle.load_mechanism("gough-stewart"), 0.5063  # which binds
    names = [f"chain.{chain}.platform[0]" for chain in machine.chain_names[:4]]
    vary = [{"what": n, "range": [machine.get(n) - 0.03, machine.get(n) + 0.03]} for n in names]
    measure = {name: study()["measure"][name] for name in ("peak", "margin")}
    given = {"motion": {"file": "trial", "rate": 5.0}, "load": "none", "measure": measure}
    asked = study(**given, vary=vary, limits={"margin": {"least": least}})
    found = condyle.design(asked, mechanism=machine)
    p, (peak, margin) = found.problem, found.best.point.measures
    assert found.best.feasible and abs(margin - least) < 1e-6

    def costs(X: np.ndarray) -> np.ndarray:
        fits = lambda one: one.good and one.measures[1] >= least  # noqa: E731
        return np.array([one.measures[0] if fits(one) else np.inf for one in p.at(X)])

    rng, low, high = np.random.default_rng(4), np.array(p.low), np.array(p.high)
    middle, size = np.array(p.base), (high - low) / 2
    for _ in range(8):
        tried = middle + size * rng.uniform(-1, 1, (24, 4))
        X = np.vstack([middle, np.clip(tried, low, high)])
        value = costs(X)
        middle, size = X[value.argmin()], 0.6 * size
    assert peak * (1 - 1e-6) <= value.min() < 0.999 * found.first.measures[0]


@pytest.mark.slow
def test_the_file_alone_has_the_cost_and_errors_cost_no_more_than_was_said(tmp_path: Path) -> None:
    """The file that is written, loaded and solved by itself; and variants of it by a tolerance."""
    found = condyle.design(study(mechanism="masticatory", tolerance={"chain.*.platform": 1e-4}))
    files, best = found.save(tmp_path / "better"), found.best.point
    made = condyle.load_mechanism(files[0])
    path = condyle.motion.bundled_reference()[0]
    motion = condyle.Motion.from_csv(path, landmark="incisor", rate=RATE)
    solution = condyle.derive(made).solve(motion, condyle.reference_load())
    assert abs(solution["effort"]).max() == pytest.approx(best.measures[0], rel=1e-9)
    assert "[P] published" in files[0].read_text(encoding="utf-8")  # comments are kept
    rows = [*csv.DictReader(files[1].read_text().splitlines())]
    assert float(rows[0]["peak"]) == pytest.approx(found.first.measures[0], rel=1e-12)
    assert len(rows) == 3

    line, real = found.tolerance["chain.*.platform"]
    assert best.measures[0] < real and real == pytest.approx(line, rel=1e-3)
    rng, machine, p = np.random.default_rng(1), found.mechanism, found.problem
    names = [f"chain.{name}.platform" for name in machine.chain_names]
    errors = 1e-4 * rng.choice([-1.0, 1.0], size=(40, len(names), 3))
    table = {n: np.array(machine.get(n)) + errors[:, i] for i, n in enumerate(names)}
    moved = p._points(p._model(best).variants(table), np.tile(best.x, (40, 1)))
    assert max(one.measures[0] for one in moved) < real * (1 + 1e-3)


@pytest.mark.slow
def test_a_front_is_one() -> None:
    found = condyle.design(study(pareto={"measure": "margin", "count": 3}))
    peak, margin = (np.array(found.front_table[name]) for name in ("peak", "margin"))
    assert (np.diff(peak) >= -1e-6).all() and (np.diff(margin) > 0).all()
    assert all(one.feasible for one in found.front)


@pytest.mark.slow
def test_what_cannot_be_reached_has_a_measure_and_a_way_out() -> None:
    """The masseters' cranks, a quarter as long, cannot follow; all tips move with one number."""
    names = [f"chain.masseter_{side}.{{}}[{k}]" for side, k in product(("left", "right"), range(3))]
    base, tip = (np.array([ROBOT.get(n.format(k)) for n in names]) for k in ("base", "crank_tip"))
    short = base + 0.25 * (tip - base)
    ends = [n.format("crank_tip") for n in names]
    tips = {
        f"chain.masseter_{s}.crank_tip": tuple(short[3 * i :][:3])
        for i, s in enumerate(("left", "right"))
    }
    times = (tip - base) / (tip - base)[0]
    mirror = [
        {"what": name, "times": a, "plus": b - a * base[0]}
        for name, a, b in list(zip(ends, times, base, strict=True))[1:]
    ]
    vary = [{"what": ends[0], "range": sorted([short[0], tip[0]]), "mirror": mirror}]
    machine = ROBOT.set(tips)
    p = problem(machine, vary=vary)
    [first] = p.at(p.base)
    assert not first.good and 0 < first.violation < 10 and "unreachable" in first.reason
    found = condyle.design(study(vary=vary), mechanism=machine)
    assert found.best.point.good and np.isfinite(found.best.point.measures).all()


def test_a_study_that_does_not_fit_is_refused() -> None:
    for changes, words in (
        ({"minimise": None}, "one of minimise and maximise"),
        ({"minimise": "power"}, 'unknown measure "power"; available: peak'),
        ({"measure": {"peak": {"of": "power", "take": "max"}}}, "power has no derivatives"),
        ({"measure": {"peak": {"of": "effort", "take": "span"}}}, "expected take of min"),
        ({"measure": {"peak": EACH}}, "has several values"),
        ({"vary": [{"what": "platform.mass", "values": [0.1, 0.2]}]}, "range or scale"),
        ({"vary": [{"what": "platform.mass", "range": [0.3, 0.4]}]}, "outside its range"),
        ({"vary": [{"what": OFFSET, "scale": [0.9, 1.1]}]}, "landmark"),
        ({"limits": {"margin": {}}}, "least, most or both"),
        ({"limit": {}}, "limit"),
        ({"pareto": {"measure": "peak"}}, "another measure than the cost"),
        (
            {"tolerance": {"chain.*.colour": 1e-3}, "motion": {"file": "trial", "rate": 2.0}},
            "colour",
        ),
    ):
        with pytest.raises(InputError, match=words):
            condyle.design(study(**changes))


@pytest.mark.slow
def test_raises_the_lowest_frequency() -> None:
    """Of drives that give, over a motion; the ends by the modes of the machine that was found."""
    stiff = {f"chain.{name}.actuator.stiffness": 400.0 for name in ROBOT.chain_names}
    machine = ROBOT.set(stiff)
    asked = study(
        motion={"file": "reference", "rate": 2.0},
        measure={"lowest": {"of": "frequency", "take": "min"}},
        options={"steps": 4},
    )
    del asked["minimise"], asked["sampling"]
    found = condyle.design(asked | {"maximise": "lowest"}, mechanism=machine)

    def lowest(one: condyle.Mechanism) -> float:
        model = condyle.Model(one, backend="numpy")
        motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=2.0)
        (q, *_), _ = model.poses.of_motion(motion)
        load = condyle.reference_load()
        modes = model.modes(q, wrench=load.at(motion.t), at="right_molar")
        return float(modes.frequency.min())

    before, after = lowest(machine), lowest(found.mechanism)
    assert after > 1.01 * before
    assert found.first.measures[0] == pytest.approx(before, rel=1e-6)
    assert found.best.point.measures[0] == pytest.approx(after, rel=1e-6)
