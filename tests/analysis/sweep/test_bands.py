"""Bands: quantiles over variants, against a case in which they are known in closed form."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.analysis.sweep import read_study, with_bands
from condyle.analysis.sweep.bands import QUANTILES, _quantiles


def study(**first: Any) -> Any:
    vary = {"what": "platform.mass", "range": [0.2, 0.4], "count": 21, **first}
    return read_study({"vary": [vary], "load": "none"})


def test_efforts_are_linear_in_the_mass(machine: condyle.Mechanism) -> None:
    """effort(m) = effort(0.2) + (m - 0.2) slope: so are the quantiles, from the other end below."""
    motion = condyle.trial_motion(machine, rate=4.0)
    light, heavy = (
        condyle.derive(machine.set("platform.mass", mass)).solve(motion) for mass in (0.2, 0.4)
    )
    found = with_bands(light, study(), motion, condyle.Load.zero(), mechanism=machine, workers=1)
    assert found["effort_quantile"].dims == ("quantile", "time", "chain")
    assert found["quantile"].values.tolist() == list(QUANTILES)
    for name in ("effort", "contact_force"):
        a, b = light[name].values, heavy[name].values
        low, high = np.minimum(a, b), np.maximum(a, b)
        for i, q in enumerate(QUANTILES):
            wanted = low + q * (high - low)
            scale = np.abs(wanted).max()
            np.testing.assert_allclose(
                found[f"{name}_quantile"].values[i], wanted, rtol=0, atol=1e-9 * scale
            )
    assert json.loads(found.attrs["bands"])["variants"] == 21
    assert found.condyle.warnings == light.condyle.warnings


def test_variants_without_a_result_are_left_out_and_told(machine: condyle.Mechanism) -> None:
    motion = condyle.trial_motion(machine, rate=2.0)
    solution = condyle.derive(machine).solve(motion)
    base = machine.get("chain.masseter_left.base[2]")
    vary = {"what": "chain.masseter_left.base[2]", "values": [base, base, base + 0.3]}
    some = read_study({"vary": [vary], "load": "none"})
    found = with_bands(solution, some, motion, condyle.Load.zero(), workers=1)
    middle = found["effort_quantile"].sel(quantile=0.5).values
    np.testing.assert_allclose(middle, solution["effort"].values, rtol=1e-9, atol=1e-12)
    assert (
        found.condyle.notices[-1].kind == "failed_variants" and found.condyle.notices[-1].count == 1
    )
    assert "1 of 3 variants" in found.condyle.warnings[-1]


def test_quantiles_are_numpys_and_leave_nan_out() -> None:
    random = np.random.default_rng(5)
    values = random.normal(size=(37, 4, 3))
    np.testing.assert_allclose(_quantiles(values), np.quantile(values, QUANTILES, axis=0))
    values[random.random(values.shape) < 0.3] = np.nan
    values[:, 0, 0] = np.nan
    found = _quantiles(values)
    assert np.isnan(found[:, 0, 0]).all()
    np.testing.assert_allclose(
        found[:, 1:], np.nanquantile(values[:, 1:], QUANTILES, axis=0), rtol=1e-12
    )


def test_a_band_saves_and_opens(machine: condyle.Mechanism, tmp_path: Any) -> None:
    motion = condyle.trial_motion(machine, rate=2.0)
    solution = condyle.derive(machine).solve(motion)
    found = with_bands(solution, study(count=2), motion, condyle.Load.zero(), workers=1)
    found.condyle.save(tmp_path / "bands.nc")
    again = condyle.open_solution(tmp_path / "bands.nc")
    np.testing.assert_array_equal(again["effort_quantile"], found["effort_quantile"])
    assert json.loads(again.attrs["bands"])["variants"] == 2


def test_too_many_for_memory_are_refused(
    machine: condyle.Mechanism, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = condyle.trial_motion(machine, rate=2.0)
    solution = condyle.derive(machine).solve(motion)
    monkeypatch.setattr("condyle.analysis.sweep.bands.memory_at_hand", lambda: 1000)
    with pytest.raises(condyle.InputError, match="fewer variants"):
        with_bands(solution, study(), motion, condyle.Load.zero(), workers=1)
