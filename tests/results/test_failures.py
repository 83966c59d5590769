"""Samples that cannot be computed: when, and which chain or contact is the cause."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support import machines

import condyle
from condyle.errors import MechanismError, NumberRangeError, UnreachableError, WarningError
from condyle.model.model_result import require_ok
from condyle.motion import Motion
from condyle.status import STATUS_NAMES, Status, judge

COUNT = 201


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return machines.model("masticatory")


@pytest.fixture(scope="module")
def solution(model: condyle.Model) -> xr.Dataset:
    """There and back along X, twice beyond what the chains can span."""
    t = np.linspace(0, 1, COUNT)
    value = np.column_stack([0.02 * np.sin(2 * np.pi * t), *[0 * t] * 3])
    return model.solve(Motion.from_arrays(t, value, names=model.independent), flag=True)


def out_of_span(model: condyle.Model, x: float) -> set[str]:
    """Chains whose coupler cannot close the triangle with the platform moved along X."""
    q = np.array([[x, 0, 0, 0]])
    pose = model.inverse_dynamics(q, 0 * q, 0 * q, outputs="all").pose[0]
    assert np.abs(pose[3:]).max() < 1e-12
    found = set()
    for chain in model.mechanism.chains:
        base, tip = np.array(chain.base), np.array(chain.crank_tip)
        axis = np.array(chain.axis) / np.linalg.norm(chain.axis)
        arm = tip - base
        arm -= (arm @ axis) * axis
        length = np.linalg.norm(np.array(chain.platform) - tip)
        joint = np.add(chain.platform, pose[:3])
        angles = np.linspace(0, 2 * np.pi, 20001)[:, None]
        turned = base + arm * np.cos(angles) + np.cross(axis, arm) * np.sin(angles)
        distance = np.linalg.norm(joint - turned, axis=1)
        if not distance.min() < length < distance.max():
            found.add(chain.name)
    return found


def test_intervals_and_their_chains(model: condyle.Model, solution: xr.Dataset) -> None:
    """They cover the failed samples, and each names a chain that really is too short."""
    t, status = solution["time"].values, solution["status"].values
    covered = np.zeros(COUNT, dtype=bool)
    for failure in solution.condyle.failures:
        rows = slice(failure.first, failure.first + failure.count)
        assert not covered[rows].any()
        covered[rows] = True
        assert (failure.start, failure.end) == (t[rows][0], t[rows][-1])
        assert failure.status == "unreachable" and failure.owner_kind == "chain"
        x = 0.02 * np.sin(2 * np.pi * t[failure.first])
        assert failure.owner_name in out_of_span(model, x)
        assert f'"{failure.owner_name}" cannot reach' in str(failure)
    assert (covered == (status != 0)).all() and covered.any() and not covered.all()


def test_they_go_through_files(solution: xr.Dataset, tmp_path: Path) -> None:
    """Also through those from before causes."""
    failures = solution.condyle.failures
    solution.condyle.save(tmp_path / "a.nc", tmp_path / "a.csv")
    again = condyle.open_solution(tmp_path / "a.nc").condyle
    assert (again.failures, again.notices) == (failures, solution.condyle.notices)
    header, *rows = (tmp_path / "a.csv").read_text().splitlines()
    assert header.endswith(",status,cause") and rows[0].endswith(",ok,")
    assert rows[failures[0].first].endswith(f",unreachable,chain {failures[0].owner_name}")
    old = solution.drop_vars(["cause", "rank"])
    del old.attrs["notices"]
    old.condyle.save(tmp_path / "old.nc", tmp_path / "old.csv")
    again = condyle.open_solution(tmp_path / "old.nc").condyle
    assert sum(f.count for f in again.failures) == int((solution["status"] != 0).sum())
    assert [n.kind for n in again.notices] == ["other"] * len(again.warnings)
    assert "unreachable" in str(again.failures[0])


def test_contacts_as_the_cause(model: condyle.Model) -> None:
    """A roll that no pose on the two planes has."""
    t = np.linspace(0, 1, 21)
    value = np.column_stack([0 * t, 0 * t, 0 * t, 1.5 * t])
    motion = Motion.from_arrays(t, value, names=("X", "Y", "beta", "gamma"))
    failed = model.solve(motion, flag=True).condyle.failures
    assert failed[-1].owner_kind == "contact" and failed[-1].status == "unreachable"
    assert failed[-1].owner_name == "left_condyle & right_condyle"
    assert 'the contacts "left_condyle", "right_condyle"' in failed[-1].cause


def test_errors_carry_what_they_say(model: condyle.Model) -> None:
    t = np.linspace(0, 1, 41)
    value = np.column_stack([0.02 * t, *[0 * t] * 3])
    with pytest.raises(UnreachableError) as caught:
        model.solve(Motion.from_arrays(t, value, names=model.independent))
    error = caught.value
    assert error.chain in out_of_span(model, 0.02 * error.time)
    assert error.time == t[error.sample] and error.unit == "m" and error.contact is None
    assert f"{error.value * 1e3:.1f}" in error.message and f"{error.bound * 1e3:.1f}" in str(error)
    assert error.count == len(error.samples) == int(41 - error.sample)
    assert "--flag" in error.hint and "--flag" not in error.message
    facts = json.loads(json.dumps(error.to_dict()))
    assert facts["kind"] == "unreachable" and facts["chain"] == error.chain
    for one in (error, MechanismError("a.toml", ["x: bad"]), WarningError(["out"])):
        again = pickle.loads(pickle.dumps(one))
        assert (type(again), str(again), vars(again)) == (type(one), str(one), vars(one))


def test_overflow_is_no_singularity(model: condyle.Model) -> None:
    q = np.zeros((3, 4))
    rates = np.array([[0.0], [1e300], [0.0]]) * np.ones(4)
    found = model.inverse_dynamics(q, rates, 0 * q, outputs="all")
    assert [STATUS_NAMES[i] for i in found.status] == ["ok", "overflow", "ok"]
    with pytest.raises(NumberRangeError, match="not finite") as caught:
        require_ok(model.mechanism, found)
    assert caught.value.kind == "overflow" and caught.value.row == 2
    # The first reason counts.
    yes, no = np.array([True]), np.array([False])
    assert judge(yes, yes, yes) == Status.ok and judge(no, no, no) == Status.unreachable
    assert judge(yes, no, no) == Status.singular and judge(yes, yes, no) == Status.overflow
    assert [s.value for s in Status] == list(range(len(Status)))


def test_a_failure_as_json(condyle_command: Callable[..., Any]) -> None:
    outcome = condyle_command("check", "masticatry", "--json")
    said = json.loads(outcome.out)["error"]
    assert outcome.status == 2 and said["kind"] == "input" and "masticatry" in said["message"]
    Path("bad.toml").write_text("x = 1\n")
    said = json.loads(condyle_command("check", "bad.toml", "--json").out)["error"]
    assert said["kind"] == "mechanism" and len(said["problems"]) > 1
    outcome = condyle_command("run", "--montion", "a.csv", "--json")
    assert outcome.status == 2 and json.loads(outcome.out)["error"]["kind"] == "usage"
