"""Bands: quantiles over variants, against a case in which they are known in closed form."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.analysis.sweep import Study, with_bands
from condyle.analysis.sweep.bands import QUANTILES, quantiles

from .conftest import MACHINE

MOTION = condyle.trial_motion(MACHINE, rate=2.0)


def bands(solution: Any = None, **vary: Any) -> Any:
    """Of variants of the mass, unless others are asked for."""
    vary = (
        {"what": "platform.mass", "range": [0.2, 0.4], "count": 21} if "what" not in vary else vary
    )
    solution = model("masticatory").solve(MOTION) if solution is None else solution
    study = Study.read({"vary": [vary], "load": "none"})
    zero = condyle.Load.zero()
    return with_bands(solution, study, MOTION, zero, mechanism=MACHINE, workers=1)


def test_efforts_are_linear_in_the_mass(tmp_path: Path) -> None:
    """effort(m) = effort(0.2) + (m - 0.2) slope: so are the quantiles, from the other end below."""
    light, heavy = (
        condyle.derive(MACHINE.set("platform.mass", m)).solve(MOTION) for m in (0.2, 0.4)
    )
    found = bands(light)
    assert found["effort_quantile"].dims == ("quantile", "time", "chain")
    assert found["quantile"].values.tolist() == list(QUANTILES)
    for name in ("effort", "contact_force"):
        a, b = light[name].values, heavy[name].values
        low, high = np.minimum(a, b), np.maximum(a, b)
        for got, q in zip(found[f"{name}_quantile"].values, QUANTILES, strict=True):
            wanted = low + q * (high - low)
            np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
    assert found.condyle.warnings == light.condyle.warnings
    found.condyle.save(tmp_path / "bands.nc")
    again = condyle.open_solution(tmp_path / "bands.nc")
    np.testing.assert_array_equal(again["effort_quantile"], found["effort_quantile"])
    for one in (found, again):
        assert json.loads(one.attrs["bands"])["variants"] == 21


def test_variants_without_a_result_are_left_out_and_told() -> None:
    what = "chain.masseter_left.base[2]"
    base = MACHINE.get(what)
    found = bands(what=what, values=[base, base, base + 0.3])
    middle = found["effort_quantile"].sel(quantile=0.5).values
    np.testing.assert_allclose(middle, found["effort"].values, rtol=1e-9, atol=1e-12)
    last = found.condyle.notices[-1]
    assert (last.kind, last.count) == ("failed_variants", 1)
    assert "1 of 3 variants" in found.condyle.warnings[-1]


def testquantiles_are_numpys_and_leave_nan_out() -> None:
    random = np.random.default_rng(5)
    values = random.normal(size=(37, 4, 3))
    np.testing.assert_allclose(quantiles(values), np.quantile(values, QUANTILES, axis=0))
    values[random.random(values.shape) < 0.3] = np.nan
    values[:, 0, 0] = np.nan
    found, wanted = quantiles(values), np.nanquantile(values[:, 1:], QUANTILES, axis=0)
    assert np.isnan(found[:, 0, 0]).all()
    np.testing.assert_allclose(found[:, 1:], wanted, rtol=1e-12)


def test_too_many_for_memory_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("condyle.files.memory.available_memory", lambda: 1000)
    with pytest.raises(condyle.InputError, match="fewer variants"):
        bands()
