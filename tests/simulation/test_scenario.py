"""Scenario files: what they hold, and ways to get one wrong."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.errors import InputError, ScenarioError
from condyle.mechanism.files import from_data
from condyle.model.model import Model
from condyle.simulation import FOODS, load_scenario
from condyle.simulation.bind import bind
from condyle.simulation.first_scenario import STARTER, default_scenario
from condyle.simulation.scenario import Scenario
from condyle.simulation.slips import odd_things

LAW: dict[str, Any] = {"kind": "computed_torque", "stiffness": 900.0}
PD: dict[str, Any] = {"kind": "joint_pd", "stiffness": 1.0, "damping": 0.1}
FOOD = {"kind": "food", "food": "carrot", "point": "right_molar"}
BARE = {"kind": "computed_torque"}


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ({"duratoin": 1.0}, 'duratoin: is not a key of the file format.*Did you mean "duration"'),
        ({"duration": -1.0}, "duration: expected a value above 0"),
        ({"method": "euler"}, 'method: got "euler"; available: DOP853, Radau, rk4'),
        ({"method": "rk4"}, "step is missing: rk4 has fixed steps"),
        ({"controller": {"kind": "pid"}}, "controller: the kind 'pid' is unknown"),
        ({"controller": PD | {"stifness": 3.0}}, 'stifness.*Did you mean "stiffness"'),
        ({"controller": BARE}, "controller.stiffness: is missing"),
        ({"load": [FOOD | {"food": ["bolus"]}]}, "food: expected a name such as"),
        ({"controller": PD | {"rate": 5e-324}}, "controller.rate: expected"),
        ({"load": [FOOD | {"damping": 1e13}]}, "damping: expected at most 1e.12, got 1e.13"),
        ({"load": [FOOD | {"food": "peanutt"}]}, "food: expected a preset, got 'peanutt'. Did you"),
        ({"controller": PD, "efforts": {"file": __file__}}, "efforts come from one of them"),
        ({"controller": PD | {"motion": "nowhere.csv"}}, "there is no file"),
        ({"controller": {"kind": "bite_force", "stiffness": 1.0}}, "expected force .N. or force_f"),
        ({"start": {"on_motion": True}}, "no controller with a motion"),
        ({"load": [FOOD | {"break_thickness": 1.0}]}, "expected less than thickness"),
        ({"controller": PD | {"ideal": True, "delay": 1}}, "no delay without periods"),
    ],
)
def test_wrong_scenarios(tables: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError, match=said) as error:
        Scenario.read(tables)
    assert len(error.value.problems) == 1 and "\n" not in error.value.problems[0]


def test_scenarios_that_do_not_fit(plain: Model) -> None:
    minimax = {"distribution": "minimax", "keep_bounds": True}
    for tables, said in (
        ({"start": {"Z": 0.001}}, "Z is not free: the independent coordinates are X, Y, alpha"),
        ({"start": {"beta": 1.0}}, "start: the pose cannot be reached"),
        ({"load": [FOOD | {"point": "chin"}]}, 'no load point "chin"'),
        ({"controller": PD | {"stiffness": [1.0, 2.0]}}, "expected one number, or 6"),
        ({"controller": PD | {"stiffness": -1.0}}, r"1 problem\n.*stiffness: expected a value of"),
        ({"controller": PD | {"stiffness": [1.0, -2.0]}}, r"1 problem\n.*ess\[1\]: expected a"),
        ({"controller": LAW | minimax}, "outside the tick; take minimum_norm"),
        ({"controller": LAW | {"effort_rate": 1.0, "ideal": True}}, "has no ticks"),
        ({"controller": PD | {"keep_bounds": True}}, "asks for no acceleration"),
        ({"controller": LAW | {"contact_force": 3.0}}, "contact_force: requires contact_weight"),
    ):
        with pytest.raises(ScenarioError, match=said):
            condyle.simulate(plain, tables)
    with pytest.raises(InputError, match=r"model: expected a model, .* got int"):
        condyle.simulate(3)  # type: ignore[call-overload]
    with pytest.raises(InputError, match=r"scenario: expected .* got 3"):
        condyle.simulate(plain, [3])


LOCKED = {"alpha": 0.1, "gamma": 0.2, "dX": 0.01}


@pytest.mark.parametrize(
    ("name", "start", "said"),
    [
        ("gough-stewart", LOCKED | {"beta": np.pi / 2}, "gimbal_lock: beta is"),
        ("gough-stewart", LOCKED | {"beta": np.pi / 2 - 1e-9}, "gimbal_lock: beta is"),
        ("gough-stewart", LOCKED | {"beta": np.pi / 2 - 1e-6}, "stiff: the integrator"),
        ("masticatory", {"X": "the end"}, "singular|unreachable"),
    ],
)
def test_a_start_without_a_way_on_is_an_error(name: str, start: dict[str, Any], said: str) -> None:
    """Not a run of one sample. The end is where a chain is stretched, to the last bit."""
    machine = model(name)
    if start.get("X") == "the end":
        low, high = 0.0, 0.05
        while low < (middle := (low + high) / 2) < high:
            reached = machine.inverse_kinematics([middle, 0.0, 0.0, 0.0]).status == 0
            low, high = (middle, high) if reached else (low, middle)
        start = {"X": low}
    with pytest.raises(ScenarioError, match=rf"start: nothing moves from .*({said})"):
        condyle.simulate(machine, {"duration": 0.01, "start": start})


def test_starts_that_only_the_robust_path_closes() -> None:
    """It is not said to be out of reach; nor is a direct singularity, in which forward dynamics is
    regular, nor a place near a gimbal lock."""
    curved = model("masticatory-curved")
    q = {"X": 0.0109, "Y": 0.0012, "alpha": -0.1001, "beta": -0.0387}
    assert curved.inverse_kinematics(list(q.values())).status == 0
    with pytest.raises(ScenarioError, match="begin nearer home"):
        condyle.simulate(curved, {"start": q})
    for gamma in (np.pi / 2, np.pi / 2 - 1e-13):
        scenario = {"duration": 0.002, "start": {"gamma": gamma}}
        found = condyle.simulate(model("gough-stewart"), scenario)
        assert len(found.time) == 3 and not found.condyle.events


def test_a_ball_at_the_origin_of_the_platform() -> None:
    """O_M slides on a sphere, by kernels that close it."""
    table = {"kind": "sphere", "centre": [0.0, 0.0, -0.8], "radius": 0.8}
    data = tomllib.loads(condyle.dumps(condyle.load_mechanism("gough-stewart")))
    ball = from_data(data | {"contact": [{"name": "ball", "point": [0, 0, 0], "surface": table}]})
    scenario = {"duration": 0.02, "start": {"X": 0.05, "dX": 0.3, "dalpha": 1.0}}
    found = condyle.simulate(condyle.derive(ball, backend="numpy"), scenario)
    away = found["pose"].values[:, :3] - table["centre"]
    assert len(away) == 21 and abs(np.linalg.norm(away, axis=1) - 0.8).max() < 1e-12
    assert away[-1, 0] > 0.055


def test_what_looks_like_a_slip(plain: Model) -> None:
    odd = {
        "duration": 6.0,
        "start": {"beta": 0.05},
        "controller": PD | {"delay": 1},
        "sensors": {"encoder_resolution": 0.1},
        "load": [FOOD | {"thickness": 8.0}],
    }
    said = " ".join(odd_things(bind(plain, Scenario.read(odd))))
    for words in ("8000 mm of food", "mostly in beta", "ends at 5 s of 6 s", "is it in degrees"):
        assert words in said
    assert not list(odd_things(bind(plain, default_scenario())))


def test_a_file_and_what_it_names(tmp_path: Path, plain: Model) -> None:
    (tmp_path / "path.csv").write_text("t,X\n")
    path = tmp_path / "chew.toml"
    text = 'length_unit = "mm"\n[start]\nX = 2.0\n[controller]\nkind = "joint_pd"\n'
    path.write_text(text + 'stiffness = 1.0\ndamping = 0.1\nmotion = "path.csv"\n')
    scenario = load_scenario(path)
    assert scenario.start.given == {"X": 0.002}
    assert scenario.controller.motion == str(tmp_path / "path.csv")
    path.write_text("[start")
    with pytest.raises(InputError, match="is not TOML"):
        condyle.simulate(plain, path)
    path.write_text(STARTER)
    assert load_scenario(path).controller.kind == "computed_torque"
    assert default_scenario().closed_loop
    assert {"controller", "load", "length_unit"} <= condyle.schema("scenario")["properties"].keys()


def test_foods_have_sources_and_units_do_not_change_them() -> None:
    assert all(food.source for food in FOODS.values())
    for unit in ("m", "mm"):
        (load,) = Scenario.read({"length_unit": unit, "load": [FOOD]}).loads
        assert load.thickness == FOODS["carrot"].thickness
    assert Scenario.read({"load": [FOOD | {"break_force": 5.0}]}).loads[0].break_force == 5.0


def test_a_bound_is_relative_to_the_motion(reference: condyle.Mechanism) -> None:
    """At rest accelerations are errors alone: gravity is their scale."""
    law = {"kind": "computed_torque", "rate": 1000, "stiffness": 2500.0}
    run = condyle.simulate(reference, {"duration": 0.05, "controller": law})
    assert np.abs(run["pose_acceleration"]).max() < 1e-3 and run["bound"].max() < 1e-9
    assert not run.condyle.warnings


def test_a_load_at_several_points() -> None:
    """Springs that share a bolus have its resultant where they come together; by coordinates."""
    machine = model("masticatory")
    place = np.array(machine.mechanism.platform.points["right_molar"])

    def run(point: str) -> Any:
        bolus = {"kind": "spring", "stiffness": 3e3, "damping": 2.0, "rest": 2e-3, "point": point}
        return condyle.simulate(machine, {"duration": 0.04, "controller": LAW, "load": [bolus]})

    def apart(size: float) -> str:
        spread = size * np.array([[0, -1, 0], [0, 0, 0], [0, 1, 0]])
        return ";".join(",".join(map(repr, row)) for row in (place + spread).tolist())

    one = run("right_molar")
    assert np.abs(one["load"].values[:, 2]).max() > 4.0
    off = [np.abs(run(apart(size))["effort"] - one["effort"]).max().item() for size in (5e-2, 5e-3)]
    assert off[1] < 2e-4 and off[0] > 50 * off[1]  # the square of their distance
    several = run(apart(5e-3))
    assert several["load_force"].sizes["source"] == 3
    np.testing.assert_allclose(several["load"][:, :3], one["load"][:, :3], atol=1e-2)
    with pytest.raises(ScenarioError, match="no load point"):
        run("right_molar; left_mola")
    with pytest.raises(ScenarioError, match="three numbers"):
        run("1,2")
