"""What a sweep tells, against closed forms and brute force; designs, and any rows of them."""

import json
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scipy.stats import kstest, norm

import condyle
from condyle.analysis.sweep.effects import best, front, main_effects, pareto, sensitivities
from condyle.analysis.sweep.sampling import Design
from condyle.analysis.sweep.study import Study

A, B = 7.0, 0.1  # of Ishigami's function
KINDS = ("grid", "sobol", "latin", "random", "saltelli")


def design(kind: str, count: int = 64, seed: int = 7, **first: Any) -> Design:
    vary: list[dict[str, Any]] = [
        {"what": "a", **(first or {"range": [1.0, 3.0]})},
        {"what": "b", "normal": [5.0, 2.0]},
        {"what": "c", "scale": [0.5, 1.5]},
    ]
    sampling: dict[str, Any] = {"kind": kind, "seed": seed}
    if kind == "grid":
        vary = [{**one, "count": 4} if "values" not in one else one for one in vary]
    else:
        sampling["count"] = count
    study = Study.checked({"vary": vary, "sampling": sampling}, "study")
    return Design(study.vary, study.sampling, (0.0, 0.0, -10.0))


@pytest.mark.parametrize("kind", KINDS)
def test_designs(kind: str) -> None:
    """Rows are the same in pieces, values come as they are; distributions against the closed forms,
    by Kolmogorov and Smirnov at 1e-4 (seeds are fixed)."""
    one = design(kind)
    whole = one.rows(0, one.count)
    assert whole.shape == ({"grid": 64, "saltelli": 64 * 5}.get(kind, 64), 3)
    pieces = [one.rows(a, b) for a, b in pairwise([0, 1, 7, 8, 33, one.count])]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    assert len(np.unique(whole[:, 0])) > 3
    given = design(kind, values=[1.0, 4.0, 9.0])
    assert {*given.rows(0, given.count)[:, 0]} == {1.0, 4.0, 9.0}
    if kind != "grid":
        one = design(kind, 512)
        a, b, c = one.rows(0, one.count).T
        assert kstest(a, "uniform", (1.0, 2.0)).pvalue > 1e-4
        assert kstest(b, norm(5.0, 2.0).cdf).pvalue > 1e-4
        assert kstest(c, "uniform", (-15.0, 10.0)).pvalue > 1e-4
    if kind == "random":
        assert (design(kind, seed=8).rows(0, 64) != whole).all()


def test_a_grid_has_its_ends_and_parts_of_equal_chance() -> None:
    a, b, c = (np.unique(column) for column in design("grid").rows(0, 64).T)
    np.testing.assert_allclose(a, [1.0, 5 / 3, 7 / 3, 3.0])
    np.testing.assert_allclose(c, [-15.0, -35 / 3, -25 / 3, -5.0])
    np.testing.assert_allclose(b, norm(5.0, 2.0).ppf([0.125, 0.375, 0.625, 0.875]))


def test_saltelli_exchanges_one_column_after_the_other() -> None:
    blocks = design("saltelli").rows(0, 320).reshape(64, 5, 3)
    first, last = blocks[:, 0], blocks[:, -1]
    assert (first != last).all()
    for i in range(3):
        expected = np.where(np.arange(3) == i, last, first)
        np.testing.assert_array_equal(blocks[:, i + 1], expected)


def table(vary: Any, measures: dict[str, Any], better: Any = (), **sampling: Any) -> xr.Dataset:
    """A sweep as `condyle.sweep` returns it, of functions of the parameters."""
    tables = {"vary": vary, **({"sampling": sampling} if sampling else {})}
    study = Study.checked(tables, "study")
    design = Design(study.vary, study.sampling, (0.0,) * len(study.vary))
    rows = design.rows(0, design.count)
    names = [one.what for one in study.vary]
    data = {"variant": np.arange(len(rows)), **dict(zip(names, rows.T, strict=True))}
    data |= {name: function(rows) for name, function in measures.items()}
    data["status"] = np.full(len(rows), "ok", dtype=object)
    data["reason"] = np.full(len(rows), "", dtype=object)
    attributes = {
        "study": json.dumps(study.data()),
        "rows": len(rows),
        "parameters": names,
        "measures": list(measures),
        "units": json.dumps(dict.fromkeys(measures, "1")),
        "better": json.dumps(dict(better)),
    }
    return xr.Dataset({n: ("row", a) for n, a in data.items()}, attrs=attributes)


def ishigami(count: int, kind: str = "saltelli") -> xr.Dataset:
    def f(x: np.ndarray) -> np.ndarray:
        return np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0])

    vary = [{"what": name, "range": [-np.pi, np.pi]} for name in "xyz"]
    return table(vary, {"f": f}, kind=kind, count=count)


def test_sobol_indices_of_ishigami() -> None:
    """To 1 % by Sobol's sequence of 2048 base rows; a base row with a failure is left out."""
    first = 0.5 * (1 + B * np.pi**4 / 5) ** 2
    second = A**2 / 8
    third = B**2 * np.pi**8 * (1 / 18 - 1 / 50)  # with the first
    whole = first + second + third
    rows = ishigami(2048)
    found = sensitivities(rows)[0]
    np.testing.assert_allclose(found.first[:, 0], [first / whole, second / whole, 0.0], atol=0.01)
    total = [(first + third) / whole, second / whole, third / whole]
    np.testing.assert_allclose(found.total[:, 0], total, atol=0.01)
    assert found.blocks == 2048 and found.left_out == 0
    rows["status"].values[7] = "unreachable"  # of the second base row
    rows["f"].values[7] = np.nan
    again = sensitivities(rows)[0]
    assert (again.blocks, again.left_out) == (2047, 1)
    np.testing.assert_allclose(again.first[:, 0], found.first[:, 0], atol=0.01)
    with pytest.raises(condyle.InputError, match="saltelli"):
        sensitivities(ishigami(8, "sobol"))


def test_main_effects_of_a_sum() -> None:
    """On a grid f = 3 x + y^2: means are exact, and shares those of the two variances."""
    vary = [{"what": n, "range": [0.0, 1.0], "count": 5} for n in "xy"]
    x, y = main_effects(table(vary, {"f": lambda r: 3 * r[:, 0] + r[:, 1] ** 2}))
    level = np.linspace(0, 1, 5)
    np.testing.assert_allclose(x.place, level)
    np.testing.assert_allclose(x.mean, 3 * level + (level**2).mean())
    np.testing.assert_allclose(y.mean, 1.5 + level**2)
    variances = np.var(3 * level), np.var(level**2)
    assert x.share == pytest.approx(variances[0] / sum(variances))
    assert x.share + y.share == pytest.approx(1.0) and y.swing == pytest.approx(1.0)


def test_front_against_brute_force() -> None:
    random = np.random.default_rng(3)
    for m in (2, 3):
        cost = np.round(random.normal(size=(150, m)), 1)  # with ties
        dominates = (cost[:, None] <= cost).all(-1) & (cost[:, None] < cost).any(-1)
        wanted = {tuple(one) for one in cost[~dominates.any(axis=0)]}
        found = front(cost)
        assert {tuple(cost[i]) for i in found} == wanted and len(found) == len(wanted)


def test_best_and_front_know_what_is_better() -> None:
    vary = [{"what": "x", "range": [0.0, 1.0], "count": 11}]
    measures = {"cost": lambda r: r[:, 0] ** 2, "gain": lambda r: np.minimum(r[:, 0], 0.5)}
    rows = table(vary, measures, {"cost": "less", "gain": "more"})
    assert best(rows, "cost", 1)["x"].item() == 0.0
    assert best(rows, "gain", 1)["gain"].item() == 0.5
    np.testing.assert_allclose(sorted(pareto(rows)["x"].values), np.linspace(0, 0.5, 6))
    with pytest.raises(condyle.InputError, match="two or three measures"):
        pareto(table(vary, measures, {"cost": "less"}))
