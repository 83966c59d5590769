"""What a sweep tells, against closed forms and brute force."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
import xarray as xr

import condyle
from condyle.analysis.sweep.effects import best, front, main_effects, pareto, sensitivities
from condyle.analysis.sweep.sampling import Design
from condyle.analysis.sweep.study import Study

A, B = 7.0, 0.1  # of Ishigami's function


def table(tables: dict[str, Any], measures: dict[str, Any], better: dict[str, str]) -> xr.Dataset:
    """A sweep as `condyle.sweep` returns it, of functions of the parameters."""
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
        "better": json.dumps(better),
    }
    return xr.Dataset({n: ("row", a) for n, a in data.items()}, attrs=attributes)


def ishigami(x: np.ndarray) -> np.ndarray:
    return np.sin(x[:, 0]) + A * np.sin(x[:, 1]) ** 2 + B * x[:, 2] ** 4 * np.sin(x[:, 0])


def saltelli(count: int) -> dict[str, Any]:
    vary = [{"what": name, "range": [-np.pi, np.pi]} for name in "xyz"]
    return {"vary": vary, "sampling": {"kind": "saltelli", "count": count}}


def test_sobol_indices_of_ishigami() -> None:
    first = 0.5 * (1 + B * np.pi**4 / 5) ** 2
    second = A**2 / 8
    third = B**2 * np.pi**8 * (1 / 18 - 1 / 50)  # with the first
    whole = first + second + third
    found = sensitivities(table(saltelli(2048), {"f": ishigami}, {}))[0]
    # Sobol's sequence of 2048 base rows: 1 %.
    np.testing.assert_allclose(found.first[:, 0], [first / whole, second / whole, 0.0], atol=0.01)
    total = [(first + third) / whole, second / whole, third / whole]
    np.testing.assert_allclose(found.total[:, 0], total, atol=0.01)
    assert found.blocks == 2048 and found.left_out == 0


def test_base_rows_with_a_failure_are_left_out() -> None:
    rows = table(saltelli(256), {"f": ishigami}, {})
    whole = sensitivities(rows)[0]
    rows["status"].values[7] = "unreachable"  # of the second base row
    rows["f"].values[7] = np.nan
    found = sensitivities(rows)[0]
    assert (found.blocks, found.left_out) == (255, 1)
    np.testing.assert_allclose(found.first[:, 0], whole.first[:, 0], atol=0.05)


def test_indices_need_their_sampling() -> None:
    tables = saltelli(8) | {"sampling": {"kind": "sobol", "count": 8}}
    with pytest.raises(condyle.InputError, match="saltelli"):
        sensitivities(table(tables, {"f": ishigami}, {}))


def test_main_effects_of_a_sum() -> None:
    """On a grid f = 3 x + y^2: means are exact, and shares those of the two variances."""
    vary = [{"what": n, "range": [0.0, 1.0], "count": 5} for n in "xy"]
    rows = table({"vary": vary}, {"f": lambda r: 3 * r[:, 0] + r[:, 1] ** 2}, {})
    x, y = main_effects(rows)
    level = np.linspace(0, 1, 5)
    np.testing.assert_allclose(x.place, level)
    np.testing.assert_allclose(x.mean, 3 * level + (level**2).mean())
    np.testing.assert_allclose(y.mean, 1.5 + level**2)
    variances = np.var(3 * level), np.var(level**2)
    assert x.share == pytest.approx(variances[0] / sum(variances))
    assert x.share + y.share == pytest.approx(1.0)
    assert y.swing == pytest.approx(1.0)


def test_front_against_brute_force() -> None:
    random = np.random.default_rng(3)
    for m in (2, 3):
        cost = np.round(random.normal(size=(300, m)), 1)  # with ties
        dominated = [
            any((other <= one).all() and (other < one).any() for other in cost) for one in cost
        ]
        wanted = {tuple(one) for one, bad in zip(cost, dominated, strict=True) if not bad}
        found = front(cost)
        assert {tuple(cost[i]) for i in found} == wanted and len(found) == len(wanted)


def test_best_and_front_know_what_is_better() -> None:
    tables = {"vary": [{"what": "x", "range": [0.0, 1.0], "count": 11}]}
    measures = {"cost": lambda r: r[:, 0] ** 2, "gain": lambda r: np.minimum(r[:, 0], 0.5)}
    rows = table(tables, measures, {"cost": "less", "gain": "more"})
    assert best(rows, "cost", 1)["x"].item() == 0.0
    assert best(rows, "gain", 1)["gain"].item() == 0.5
    np.testing.assert_allclose(sorted(pareto(rows)["x"].values), np.linspace(0, 0.5, 6))
    with pytest.raises(condyle.InputError, match="two or three measures"):
        pareto(table(tables, measures, {"cost": "less"}))
