"""The table of variables: what it says is what a solution has."""

from __future__ import annotations

import numpy as np
import pytest
from support import machines

import condyle
from condyle.motion import Motion
from condyle.results.variables import BASE_PARTS, DIMENSIONS, VARIABLES


@pytest.fixture(scope="module")
def model() -> condyle.Model:
    return machines.model("masticatory")


def along_x(model: condyle.Model, reach: float, count: int = 41) -> Motion:
    t = np.linspace(0, 1, count)
    value = np.column_stack([reach * t, *[0 * t] * 3])
    return Motion.from_arrays(t, value, names=model.independent)


def test_a_solution_is_the_table(model: condyle.Model) -> None:
    solution = model.solve(along_x(model, 0.002))
    absent = {"sliding_speed", "friction_force", "friction_power", "shortfall"}
    absent |= {"gravity", *BASE_PARTS, "fibre_length", "fibre_speed", "passive_force"}
    absent |= {"ligament_force", "ligament_length", "wall_force", "wall_gap", "residual"}
    present = [v for v in VARIABLES if v.name not in absent and not v.simulated]
    assert [*solution.data_vars] == [variable.name for variable in present]
    for variable in present:
        found = solution[variable.name]
        assert found.dims == variable.dims and {*found.dims} <= {*DIMENSIONS}
        assert found.attrs == variable.attributes(model.mechanism)
    assert solution["joint_rate"].attrs["units"] == "rad/s"
    slides = {v.name: v.attributes(condyle.load_mechanism("hexaglide"))["units"] for v in VARIABLES}
    assert slides["effort"] == "N" and slides["joint_acceleration"] == "m/s^2"
    assert slides["J_A"] == "m^2/m"
    simulated = {"source", "account", "estimated", "beside"}
    assert {*solution.sizes} == {*DIMENSIONS} - simulated - {"ligament", "wall"}


def test_only_failed_samples_are_empty(model: condyle.Model) -> None:
    """Numbers of the others are those of a motion on which nothing fails."""
    whole = model.solve(along_x(model, 0.02), flag=True)
    ok = whole["status"].values == 0
    assert 0 < ok.sum() < ok.size
    for variable in (one for one in VARIABLES if one.name in whole):
        values = np.moveaxis(whole[variable.name].values, variable.dims.index("time"), 0)
        if values.dtype.kind == "f":
            assert np.isnan(values[~ok]).all() and not np.isnan(values[ok]).any(), variable.name
    assert (whole["rank"].values == np.where(ok, 4, 0)).all(), "as many singular values"


def test_the_load_has_a_share_where_there_is_one(model: condyle.Model) -> None:
    motion = along_x(model, 0.002)
    without = model.solve(motion)
    load = condyle.Load(np.array([0.0, 1.0]), np.tile([0, 0, -5.0, 0, 0, 0], (2, 1)))
    loaded = model.solve(motion, load)
    assert {*loaded["part"].values} - {*without["part"].values} == {model.parts[-1]}
    for solution in (without, loaded):
        total = solution["share"].sum("part")
        np.testing.assert_allclose(total, solution["effort"], atol=1e-13)
