"""Events, loads that change their mode, and runs that end early."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from simulation.scenarios import BITE, FOOD, SPRING
from support.machines import model

import condyle
from condyle.model.model import Model
from condyle.questions.load.food import APART, BROKEN, TOUCHING
from condyle.simulation.bind import bind
from condyle.simulation.control import Controller, PoseLostError
from condyle.simulation.events import EventLog
from condyle.simulation.running import Batch, run
from condyle.simulation.scenario import Scenario
from condyle.status import Status

FALL = {"duration": 0.08, "rate": 500}
SHORT = {"duration": 0.004}


def test_a_bound_is_told_of_or_ends_the_run(plain: Model) -> None:
    """Its time is where the margin is zero, and what was computed before is kept."""
    going = {**FALL, "start": {"dX": -0.2}}
    found = condyle.simulate(plain, going)
    ended = condyle.simulate(plain, going, stop_at_bounds=True)
    first = ended.condyle.events[-1]
    assert "least x" in first["text"]
    assert first["kind"] == "bound" and first["ends"] and not found.condyle.events[0]["ends"]
    margin = found["bound_margin"].sel(contact=first["owner"])
    i = int(np.argmax(margin.values < 0))
    t0, t1 = found["time"].values[i - 1 : i + 1]
    assert t0 < first["time"] <= t1
    assert ended["time"].values[-1] == t0 and ended.sizes["time"] == i
    assert np.abs(ended["pose"] - found["pose"][:i]).max() < 1e-12
    assert f'"{first["owner"]}"' in ended.condyle.warnings[-1]
    q = np.array([[first["state"][n] for n in plain.independent]])
    pose = plain.inverse_kinematics(q).pose
    point = plain.poses.configuration(pose).contact_point[0]
    assert abs(point[:, 0] + 0.02765).min() < 1e-9


def test_a_ball_that_would_have_to_be_pulled_ends_the_run() -> None:
    """The human jaw with slack muscles falls off its skull at once."""
    jaw = model("human-jaw")
    plan = bind(jaw, Scenario.read(FALL))
    trace = run(plan)
    assert trace.ended is not None and trace.ended.kind == "contact_loss"
    assert trace.ended.owner in jaw.mechanism.contact_names


def closing_on(jaw: Model, food: dict[str, Any], rate: float) -> xr.Dataset:
    """A pull of about 30 N through the molar closes the teeth on food."""
    tough = FOOD | {"thickness": 1e-3, "stiffness": 2e4} | food
    pull = SPRING | {"point": "right_molar", "stiffness": 1e3, "rest": 0.03, "damping": 0.0}
    tables = {"duration": 0.02, "rate": rate, "start": {"beta": 0.05, "X": 0.001}}
    return condyle.simulate(jaw, tables | {"load": [tough, pull]})


def test_a_limit_that_chatters_is_one_event() -> None:
    """As long as it is met again within 20 ms; of others, and of other owners, each is one."""
    log = EventLog(["X"])
    for t in (0.0, 0.015, 0.03, 0.3):
        log.note(t, np.zeros(2), "saturated", "cut", "left")
        log.note(t, np.zeros(2), "bound", "least x", "left")
    log.note(0.02, np.zeros(2), "saturated", "cut", "right")
    told = [(e.time, e.count, e.duration) for e in log.events if e.kind == "saturated"]
    assert told == [(0.0, 3, 0.03), (0.3, 1, 0.0), (0.02, 1, 0.0)]
    assert len([e for e in log.events if e.kind == "bound"]) == 4
    assert str(log.events[0]) == 't = 0 s: saturated "left": cut, 3 times in 0.03 s'


def test_food_breaks_where_its_force_is_reached(jaw: Model) -> None:
    found = closing_on(jaw, {"damping": 5.0, "break_force": 20.0}, 2000)
    events = [e for e in found.condyle.events if e["owner"] == "food"]
    assert [e["kind"] for e in events][:2] == ["food_touched", "food_broken"]
    force = -found["load_force"].sel(source="food", axis="z").values
    t, broken = found["time"].values, events[1]["time"]
    assert (force[t > broken] == 0).all() and force[t < events[0]["time"]].max() == 0
    assert 10 < force.max() <= 20
    assert events[1]["text"].endswith("at 20 N") and abs(events[1]["force"] - 20.0) < 1e-6
    mode = found["load_mode"].sel(source="food").values
    assert (mode[0], mode[-1]) == (APART, BROKEN) and TOUCHING in mode
    # Its peak lies between results where it is bitten through: 1 ms of them see less.
    found = closing_on(jaw, {"damping": 0.0, "break_thickness": 4e-4}, 1000)
    broken = next(e for e in found.condyle.events if e["kind"] == "food_broken")
    assert broken["text"] == "the food is bitten to 0.4 mm, at 12 N"
    assert abs(broken["force"] - 2e4 * 6e-4) < 1e-6
    assert found["load_force"].sel(source="food", axis="z").values.min() > -broken["force"]


def test_a_run_goes_to_files_and_comes_back(plain: Model, tmp_path: Path) -> None:
    """With events as data; and a full disk leaves nothing."""
    tables = {"duration": 4e-3, "method": "rk4", "step": 1e-3, "start": {"dX": -2.0}}
    found = condyle.simulate(plain, tables | {"controller": BITE, "load": [FOOD]})
    events = found.condyle.events
    found.condyle.save(tmp_path / "bite.nc", tmp_path / "bite.csv")
    again = condyle.open_solution(tmp_path / "bite.nc")
    assert again.condyle.events == events and {"X", "dbeta"} <= events[0]["state"].keys()
    assert np.array_equal(again["tracking_error"], found["tracking_error"])
    header = (tmp_path / "bite.csv").read_text().partition("\n")[0].split(",")
    assert {"command_masseter_left", "error_beta", "bite_force", "load_food"} <= {*header}
    if Path("/dev/full").exists():
        folder = tmp_path / "full"
        folder.mkdir()
        (full := folder / "full.csv").symlink_to("/dev/full")
        with pytest.raises(condyle.InputError, match="cannot be written"):
            found.condyle.save(folder / "a.csv", full)
        assert list(folder.iterdir()) == [full]


def test_a_table_of_loads_is_the_load_of_the_inverse(plain: Model, tmp_path: Path) -> None:
    """Inverse dynamics of what happened, under the same load, gives back the efforts."""
    path = tmp_path / "push.csv"
    path.write_text("t,Fx,Fz,My\n0,0,0,0\n0.015,1,-2,0.01\n0.03,0,3,0\n")
    load = {"kind": "csv", "file": str(path), "point": "left_molar"}
    efforts = tmp_path / "efforts.csv"
    names = ",".join(f"tau_{n}" for n in plain.mechanism.chain_names)
    efforts.write_text(f"t,{names}\n0,0,0,0,0,0,0\n0.03,0.01,0.02,0.01,0.02,0.01,0.0\n")
    tables = {"duration": 0.03, "load": [load], "efforts": {"file": str(efforts)}}
    found = condyle.simulate(plain, tables)
    assert found["effort"].values[-1] == pytest.approx([0.01, 0.02, 0.01, 0.02, 0.01, 0.0])
    assert found["load"].values[-1, 2] == pytest.approx(3.0)
    q, q1, q2 = (
        found[n].sel(coordinate=list(plain.independent)).values
        for n in ("pose", "pose_rate", "pose_acceleration")
    )
    again = plain.inverse_dynamics(q, q1, q2, found["load"].values).effort
    # Least norm leaves out what balances itself.
    internal = found["share"].sel(part="internal").values
    assert np.abs(again + internal - found["effort"].values).max() < 1e-9


def test_functions_as_loads_and_controllers(plain: Model) -> None:
    def push(t: float, s: Any, v: Any) -> list[float]:
        return [0.0, 0.0, -2.0]

    one = condyle.simulate(plain, SHORT, loads=[(push, "incisor")])
    constant = {"kind": "constant", "point": "incisor", "force": [0.0, 0.0, -2.0]}
    other = condyle.simulate(plain, {**SHORT, "load": [constant]})
    assert np.abs(one["pose"] - other["pose"]).max() < 1e-14
    with pytest.raises(condyle.InputError, match=r"expected a force \(3,\)"):
        condyle.simulate(plain, SHORT, loads=[lambda t, s, v: 3.0])
    with pytest.raises(condyle.InputError, match=r"efforts of shape \(6,\)"):
        condyle.simulate(plain, SHORT, controller=lambda now, aim: [1.0])


def test_command(condyle_command: Any, tmp_path: Path) -> None:
    scenario = Path("fall.toml")
    scenario.write_text("duration = 0.02\n[start]\ndX = -0.2\n")
    words = "simulate", "masticatory", "--scenario", scenario, "--out"
    ran = condyle_command(*words, "o", "--json", "--stop-at-bounds")
    data = json.loads(ran.out)
    assert ran.status == 0 and data["events"][-1]["kind"] == "bound"
    assert {Path(f).name for f in data["files"]} == {"masticatory.nc", "masticatory.csv"}
    scenario.write_text("duration = 0.02\n[start]\nZ = 1.0\nbeat = 1\n")
    failed = condyle_command(*words, "p")
    assert failed.status == 2 and "Did you mean" in failed.err and not Path("p").exists()
    assert condyle_command("simulate", "--new", "new.toml").status == 0
    assert Path("new.toml").is_file()


def test_an_interrupted_run_leaves_nothing(
    condyle_command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(self: Batch) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Batch, "traces", interrupt)
    Path("fall.toml").write_text("duration = 0.02")
    ran = condyle_command("simulate", "--scenario", "fall.toml", "--out", "o")
    assert ran.status == 130 and not Path("o").exists()


@pytest.mark.filterwarnings("ignore:friction")
def test_several_motions_end_the_run(rubbing: Model) -> None:
    """With mu = 3 a condyle that slides comes to a state that several patterns explain."""
    rough = {"coefficient": 3.0, "smoothing_speed": 1e-3}
    changes = {f"contact.{name}.friction": rough for name in rubbing.mechanism.contact_names}
    rubbing = condyle.derive(rubbing.mechanism.set(changes))
    trace = run(bind(rubbing, Scenario.read({**FALL, "start": {"dX": -0.1}})))
    assert trace.ended is not None and trace.ended.kind == "ambiguous"
    assert 0 < trace.t[-1] <= trace.ended.time < FALL["duration"]
    names = rubbing.independent
    q, q1 = (np.array([[trace.ended.state[p + n] for n in names]]) for p in ("", "d"))
    still = np.zeros((1, 6))
    q2 = rubbing.forward_dynamics(q, q1, still).acceleration
    ahead = [(q + h * q1, q1 + h * q2) for h in np.geomspace(1e-7, 1e-2, 6)]
    assert Status.ambiguous in [rubbing.forward_dynamics(*x, still).status[0] for x in ahead]


def test_encoders_that_give_no_pose_end_the_run(
    plain: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What they last gave, and all that was computed, is kept."""
    law = {"kind": "computed_torque", "stiffness": 400.0, "rate": 500.0}
    found = {**FALL, "controller": law, "sensors": {"encoder_resolution": 1e-5}}
    found |= {"duration": 0.012, "method": "rk4", "step": 1e-3}
    whole = run(bind(plain, Scenario.read(found)))
    sample, samples = Controller.sample, []

    def blind(self: Controller, *given: Any) -> Any:
        samples.append(given)
        if len(samples) > 4:
            raise PoseLostError
        return sample(self, *given)

    monkeypatch.setattr(Controller, "sample", blind)
    trace = run(bind(plain, Scenario.read(found)))
    assert trace.ended is not None and trace.ended.kind == "lost"
    assert trace.ended.time == pytest.approx(4 / 500) and len(trace.command) == 4
    kept = len(trace.t)
    np.testing.assert_array_equal(trace.state, whole.state[:kept])
