"""Results of efforts that are chosen: friction, power, activation, and samples without efforts."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.errors import (
    InfeasibleError,
    InputError,
    JammedError,
    NumberRangeError,
    SampleError,
    UncertifiedError,
)
from condyle.kinematics.causes import require_ok
from condyle.mechanism import Mechanism, bundled_text, parse
from condyle.model.distributing import Distribution
from condyle.results.derived import Derived
from condyle.results.summary import summarize, work
from condyle.results.warnings import Watch
from condyle.status import Status

pytestmark = pytest.mark.slow

MU, SMOOTHING = 0.12, 2e-3
FRICTION = f"friction = {{ coefficient = {MU}, smoothing_speed = {SMOOTHING} }}\n"
ONE_SIDED = 'one_sided = true\nside = "below"\n'
FRICTION_VARIABLES = {"sliding_speed", "friction_force", "friction_power"}
LIMIT = "torque_limit = 3.0, "


def machine(contact: str = "", limit: float = 3.0, chains: int = 6) -> Mechanism:
    """The chewing robot with other contacts, torque limits [N m] and fewer chains."""
    text = re.sub(r"(\[\[contact\]\]\n)", rf"\g<1>{contact}", bundled_text("masticatory"))
    whole = parse(text.replace("torque_limit = 3.0", f"torque_limit = {float(limit)!r}"))
    return whole.replace(chains=whole.chains[:chains])


def without_limits(count: int) -> Mechanism:
    """Of the first actuators; -1 for all of them."""
    return parse(bundled_text("masticatory").replace(LIMIT, "", count))


def solve(mechanism: Mechanism, flag: bool = False, **policy: Any) -> xr.Dataset:
    solver = condyle.derive(mechanism, backend="numpy", **policy)
    return solver.solve(condyle.trial_motion(mechanism, rate=10), flag=flag)


@cache
def smooth() -> xr.Dataset:
    return solve(machine())


@pytest.fixture(scope="module")
def rubbing() -> xr.Dataset:
    return solve(machine(FRICTION))


@pytest.fixture(scope="module")
def least_peak() -> np.ndarray:
    """The largest effort of each sample, where that is least: what limits have to be."""
    return np.abs(solve(machine(), distribution="minimax")["effort"].values).max(axis=1)


@pytest.fixture(scope="module")
def weak(least_peak: np.ndarray) -> xr.Dataset:
    """Limits that the motion needs more than at some of its samples."""
    limit = float(np.median(least_peak))
    return solve(machine(limit=limit), flag=True, distribution="bounded")


def test_friction_is_the_contracts(rubbing: xr.Dataset) -> None:
    """-mu |lambda| v / sqrt(v^2 + s^2), in the tangent plane; its power is against the motion, and
    the actuators give what it takes. Its columns are there where it is.
    """
    speed = rubbing["sliding_speed"].values
    size = MU * np.abs(rubbing["contact_force"].values) * speed / np.hypot(speed, SMOOTHING)
    force = rubbing["friction_force"].values
    assert size.max() > 1e-3
    np.testing.assert_allclose(np.linalg.norm(force, axis=2), size, rtol=1e-10, atol=1e-14)
    normal = (force * rubbing["contact_normal"].values).sum(axis=2)
    assert np.abs(normal).max() < 1e-10 * size.max()
    np.testing.assert_allclose(rubbing["friction_power"], -size * speed, rtol=1e-9, atol=1e-15)
    more = (rubbing["actuator_power"] - smooth()["actuator_power"]).sum("chain")
    taken = -rubbing["friction_power"].sum("contact")
    assert float(taken.max()) > 1e-5
    scale = float(abs(smooth()["actuator_power"]).max())
    np.testing.assert_allclose(more, taken, atol=1e-10 * scale)
    assert not FRICTION_VARIABLES & {*smooth().data_vars}
    columns = rubbing.condyle.columns()
    for k, name in enumerate(rubbing.condyle.mechanism.contact_names):
        np.testing.assert_allclose(columns[f"friction_{name}"], size[:, k], rtol=1e-9, atol=1e-14)
        np.testing.assert_allclose(columns[f"sliding_{name}"], speed[:, k])
    new = {name for name in columns if name.startswith(("friction_", "sliding_"))}
    assert {*columns} - new == {*smooth().condyle.columns()}


def test_summary_of_power_and_friction(rubbing: xr.Dataset) -> None:
    """Work is the integral of power; nothing is said of power at rest."""
    summary = summarize(rubbing)
    for name, one in summary.data["power"].items():
        own = rubbing["actuator_power"].sel(chain=name)
        assert one["peak"] == float(abs(own).max())
        assert one["work"] == pytest.approx(float(own.integrate("time")), rel=1e-12)
    for name, done in summary.data["friction_work"].items():
        own = rubbing["friction_power"].sel(contact=name)
        assert done == pytest.approx(float(own.integrate("time")), rel=1e-12) and done < 0
    text = str(summary)
    assert "peak power and work" in text and "work of friction: left_condyle" in text
    assert summary.data["shortfall"] is None and "times as large" not in text
    names = model("masticatory").independent
    still = condyle.Motion.from_arrays(np.linspace(0, 1, 9), np.zeros((9, 4)), names=names)
    summary = summarize(model("masticatory").solve(still))
    assert not summary.data["power"] and not summary.data["friction_work"]
    assert "peak effort\n" in str(summary)
    time = np.linspace(0, 2, 4001)
    power = np.column_stack([np.sin(np.pi * time) ** 2, np.full_like(time, -3.0)])
    np.testing.assert_allclose(work(power, time), [1.0, -6.0], rtol=1e-6)
    power[2000] = np.nan  # the two steps beside it are missing
    np.testing.assert_allclose(work(power, time), [1.0, -6.0 + 3 * 1e-3], rtol=1e-4)


def test_activation_is_of_the_greater_limit() -> None:
    text = bundled_text("masticatory").replace("torque_limit = 3.0", "torque_limit = [-1, 2]", 1)
    found = solve(parse(text.replace(LIMIT, "", 1)))
    use, effort = found["activation"].values, found["effort"].values
    np.testing.assert_allclose(use[:, 0], effort[:, 0] / 2, rtol=1e-15)
    assert np.isnan(use[:, 1]).all()
    np.testing.assert_allclose(use[:, 2:], effort[:, 2:] / 3, rtol=1e-15)
    assert "activation" not in solve(without_limits(-1)) and "shortfall" not in found


def test_options_say_how_efforts_were_chosen() -> None:
    mechanism = machine(ONE_SIDED)
    distribution = Distribution("weighted", preload=0.25, contact_weight=0.5)
    found = solve(mechanism, distribution=distribution)
    options = found.condyle.options
    assert (options["distribution"], options["preload"]) == ("weighted", 0.25)
    assert options["contact_weight"] == 0.5
    # 3 N m at the characteristic length.
    length = condyle.derive(mechanism, backend="numpy").characteristic_length
    assert options["reference_force"] == pytest.approx(3 / length)
    push = -found["contact_force"].values
    assert 0.25 - 1e-7 < push.min() < 0.26
    assert not found["contact_loss"].any()
    assert not {notice.kind for notice in found.condyle.notices} & {"contact_loss", "effort_limit"}
    assert smooth().condyle.options["distribution"] == "minimum_norm"
    jaw = model("human-jaw")
    greatest = max(chain.actuator.force_limit[1] for chain in jaw.mechanism.chains)
    assert jaw.reference_force == greatest
    assert condyle.derive(without_limits(-1), backend="numpy").reference_force == 1.0


# -- samples without efforts ---------------------------------------------------------------


def test_shortfall_is_the_least_factor(weak: xr.Dataset, least_peak: np.ndarray) -> None:
    """With all limits so much larger the worst sample is served; with a little less it is not."""
    failed = weak["status"].values != 0
    assert 0 < failed.sum() < failed.size
    assert {*weak["status"].values[failed]} == {Status.infeasible}
    factor, limit = weak["shortfall"].values, weak.condyle.mechanism.chains[0].actuator.torque_limit
    assert (factor[~failed] == 1).all() and (factor[failed] > 1).all()
    np.testing.assert_allclose(factor[failed], least_peak[failed] / limit, rtol=1e-8)
    largest = limit * factor.max()
    more = solve(machine(limit=largest * 1.0001), distribution="bounded")
    assert not more["status"].any() and (more["shortfall"] == 1).all()
    assert more["effort"].attrs["long_name"] == "actuator effort of least norm within limits"
    less = solve(machine(limit=largest * 0.9999), flag=True, distribution="bounded")
    assert less["status"].values[factor.argmax()] == Status.infeasible


def test_infeasible_samples_are_told_of(weak: xr.Dataset, tmp_path: Path) -> None:
    worst = float(weak["shortfall"].max())
    failed, failures = weak["status"].values != 0, weak.condyle.failures
    assert np.isnan(weak["effort"].values[failed]).all()
    assert max(f.shortfall for f in failures) == worst
    assert all(f.status == "infeasible" and f.shortfall > 1 for f in failures)
    assert "times as large" in str(failures[0])
    told = {notice.kind: notice for notice in weak.condyle.notices}
    assert "effort_limit" not in told
    assert (told["failed_samples"].value, told["failed_samples"].bound) == (worst, 1.0)
    summary = summarize(weak)
    assert summary.data["shortfall"] == worst
    assert f"all limits would have to be {worst:.4g} times as large" in str(summary)
    weak.condyle.save(tmp_path / "a.nc", tmp_path / "a.csv")
    again = condyle.open_solution(tmp_path / "a.nc").condyle
    assert (again.failures, again.notices) == (failures, weak.condyle.notices)
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    assert header.endswith(",status,cause,shortfall")
    assert float(rows[int(weak["shortfall"].values.argmax())].rpartition(",")[2]) == worst
    with pytest.raises(InfeasibleError) as caught:
        solve(machine(limit=1e-3), distribution="bounded")
    error = caught.value
    assert isinstance(error, SampleError) and error.kind == "infeasible"
    assert error.value > 1 and error.bound == 1.0 and error.time == 0.0 and error.to_dict()
    assert "t = 0 s" in error.message and "--flag" in error.hint
    assert f"would have to be {error.value:.4g} times as large" in error.message


def test_where_no_limits_would_do() -> None:
    """As many efforts as freedoms leave no choice: a contact that must pull, must."""
    mechanism = machine(ONE_SIDED, chains=4)
    with pytest.raises(InfeasibleError, match="no limits would suffice") as caught:
        solve(mechanism, distribution="bounded")
    assert caught.value.value == np.inf and "preload" in caught.value.hint
    found = solve(mechanism, flag=True, distribution="bounded")
    bare = solve(machine(chains=4))
    pulls = (bare["contact_force"].values > 1e-9).any(axis=1)
    assert (np.isinf(found["shortfall"].values) == pulls).all() and pulls.any()
    assert "no limits would suffice" in str(found.condyle.failures[0])
    assert json.loads(json.dumps([n.to_dict() for n in found.condyle.notices], allow_nan=False))


def test_each_status_is_an_error_of_its_own() -> None:
    q = np.zeros((3, 4))
    for status, kind, words in (
        (Status.overflow, NumberRangeError, "not finite"),
        (Status.infeasible, InfeasibleError, "limits"),
        (Status.jammed, JammedError, "jams at row 2.*no consistent solution"),
        (Status.uncertified, UncertifiedError, "row 2"),
    ):
        found = model("masticatory").inverse_dynamics(q, q, q, outputs="all")
        found.status[1] = status
        with pytest.raises(kind, match=words) as caught:
            require_ok(model("masticatory").mechanism, found)
        assert caught.value.samples == [1] and "row 2" in str(caught.value)


def test_rounding_at_a_limit_is_no_alarm() -> None:
    """Efforts within limits keep them to the accuracy of the certificate, and contacts push."""
    mechanism, q = machine(ONE_SIDED), np.zeros((3, 4))
    found = condyle.derive(mechanism, backend="numpy").inverse_dynamics(q, q, q, outputs="all")
    found.effort[:] = 3.0 * (1 + 1e-12)
    found.contact_force[:] = 1e-11
    kinds = {"effort_limit", "contact_loss"}
    for limited, expected in ((True, set()), (False, kinds)):
        watch = Watch(mechanism)
        watch.see(Derived(mechanism, found, limited=limited), np.arange(3.0))
        assert {notice.kind for notice in watch.notices()} & kinds == expected


def test_distributions_that_have_no_meaning() -> None:
    for given, said in (
        (("bounde",), 'Did you mean "bounded"'),
        (("bounded", -1.0), "preload: expected a number of at least 0"),
        (("bounded", float("nan")), "preload: expected"),
        ((None, 1.0), "minimum_norm knows none: take one of bounded"),
        (("bounded", 0.0, 1.0), "does not weigh contact forces"),
        (("weighted", 0.0, -1.0), "contact_weight: expected"),
        (("cubic",), "cubic is for efforts that only pull"),
    ):
        with pytest.raises(InputError, match=said):
            condyle.derive(machine(), distribution=Distribution(*given), backend="numpy")
    for name in ("weighted", "cubic", "minimax"):
        with pytest.raises(InputError, match="temporalis_left has none: give torque_limit"):
            condyle.derive(without_limits(1), backend="numpy", distribution=name)
