"""What a solution has, and where a sample fails: when, and which chain or contact is the cause."""

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
from condyle.kinematics.causes import owners, require_ok
from condyle.motion import Motion
from condyle.quantities import variables
from condyle.quantities.entries import OF_RESULTS
from condyle.results.solving import base_parts
from condyle.status import STATUS_NAMES, Status, judge

COUNT = 201
# Of what this robot and this motion do not have.
ABSENT = {"sliding_speed", "friction_force", "friction_power", "shortfall", "gravity"}
ABSENT |= {"fibre_length", "fibre_speed", "passive_force", "ligament_force", "ligament_length"}
ABSENT |= {"wall_force", "wall_gap", "residual", "contact_active", *base_parts()}
ABSENT |= {n for n, v in variables().items() if v.where in ("compliance", "modes")}
ABSENT |= {n for n, v in variables().items() if v.where in ("simulation", "measured")}


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return machines.model("masticatory")


def along_x(model: condyle.Model, x: np.ndarray) -> Motion:
    """In a second."""
    value = np.column_stack([x, *[0 * x] * 3])
    return Motion.from_arrays(np.linspace(0, 1, len(x)), value, names=model.independent)


@pytest.fixture(scope="module")
def solution(model: condyle.Model) -> xr.Dataset:
    """There and back along X, twice beyond what the chains can span."""
    x = 0.02 * np.sin(np.linspace(0, 2 * np.pi, COUNT))
    return model.solve(along_x(model, x), flag=True)


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


def test_a_solution_is_the_table_of_variables(model: condyle.Model) -> None:
    """A load is a part of its own, and the parts add up to the efforts."""
    motion = along_x(model, np.linspace(0, 0.002, 41))
    solution = model.solve(motion)
    present = {n: v for n, v in variables().items() if n not in ABSENT}
    assert [*solution.data_vars] == [*present]
    solution["effort"].attrs["long_name"] = "actuator effort"  # and how it was chosen
    for name, variable in present.items():
        found = solution[name]
        assert found.dims == variable.dims and {*found.dims} <= {*OF_RESULTS}
        assert found.attrs == variable.attributes(model.mechanism)
    assert solution["joint_rate"].attrs["units"] == "rad/s"
    hexaglide = condyle.load_mechanism("hexaglide")
    slides = {name: v.attributes(hexaglide)["units"] for name, v in variables().items()}
    assert slides["effort"] == "N" and slides["joint_acceleration"] == "m/s^2"
    assert slides["J_A"] == "m^2/m"
    simulated = {"source", "account", "estimated", "beside"}
    assert {*solution.sizes} == {*OF_RESULTS} - simulated - {"ligament", "wall", "marker"}
    loaded = model.solve(motion, condyle.Load.constant([0, 0, -5.0], point="right_molar"))
    assert {*loaded["part"].values} - {*solution["part"].values} == {model.parts[-1]}
    for one in (solution, loaded):
        np.testing.assert_allclose(one["share"].sum("part"), one["effort"], atol=1e-13)


def test_only_failed_samples_are_empty_and_their_chains_too_short(
    model: condyle.Model, solution: xr.Dataset
) -> None:
    """Intervals cover them, and each names a chain that really cannot reach."""
    t, ok = solution["time"].values, solution["status"].values == 0
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
    assert (covered != ok).all() and covered.any() and not covered.all()
    for name, variable in ((n, v) for n, v in variables().items() if n in solution):
        values = np.moveaxis(solution[name].values, variable.dims.index("time"), 0)
        if values.dtype.kind == "f":
            assert np.isnan(values[~ok]).all() and not np.isnan(values[ok]).any(), name
    assert (solution["rank"].values == np.where(ok, 4, 0)).all(), "as many singular values"


def test_failures_go_through_files(solution: xr.Dataset, tmp_path: Path) -> None:
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
    assert "contacts left_condyle & right_condyle" in map(str, owners(model.mechanism))
    assert 'the contacts "left_condyle", "right_condyle"' in failed[-1].cause


def test_errors_carry_what_they_say(
    model: condyle.Model, condyle_command: Callable[..., Any]
) -> None:
    """As attributes, pickled, and as JSON of a command."""
    motion = along_x(model, np.linspace(0, 0.02, 41))
    with pytest.raises(UnreachableError) as caught:
        model.solve(motion)
    error = caught.value
    assert error.chain in out_of_span(model, 0.02 * error.time)
    assert error.time == motion.t[error.sample] and error.unit == "m" and error.contact is None
    assert f"{error.value * 1e3:.1f}" in error.message and f"{error.bound * 1e3:.1f}" in str(error)
    assert error.count == len(error.samples) == int(41 - error.sample)
    assert "--flag" in error.hint and "--flag" not in error.message
    facts = json.loads(json.dumps(error.to_dict()))
    assert facts["kind"] == "unreachable" and facts["chain"] == error.chain
    for one in (error, MechanismError("a.toml", ["x: bad"]), WarningError(["out"])):
        again = pickle.loads(pickle.dumps(one))
        assert (type(again), str(again), vars(again)) == (type(one), str(one), vars(one))
    Path("bad.toml").write_text("x = 1\n")
    for words, kind in (
        ("check masticatry", "input"),
        ("check bad.toml", "mechanism"),
        ("run --montion a.csv", "usage"),
    ):
        outcome = condyle_command(*words.split(), "--json")
        assert (outcome.status, json.loads(outcome.out)["error"]["kind"]) == (2, kind)
    said = json.loads(condyle_command("check", "bad.toml", "--json").out)["error"]
    assert len(said["problems"]) > 1


def test_overflow_is_no_singularity(model: condyle.Model) -> None:
    """The first reason counts."""
    q = np.zeros((3, 4))
    rates = np.array([[0.0], [1e300], [0.0]]) * np.ones(4)
    found = model.inverse_dynamics(q, rates, 0 * q, outputs="all")
    assert [STATUS_NAMES[i] for i in found.status] == ["ok", "overflow", "ok"]
    with pytest.raises(NumberRangeError, match="not finite") as caught:
        require_ok(model.mechanism, found)
    assert caught.value.kind == "overflow" and caught.value.row == 2
    yes, no = np.array([True]), np.array([False])
    assert judge(yes, yes, yes) == Status.ok and judge(no, no, no) == Status.unreachable
    assert judge(yes, no, no) == Status.singular and judge(yes, yes, no) == Status.overflow
    assert [s.value for s in Status] == list(range(len(Status)))
