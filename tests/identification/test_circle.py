"""The whole circle without hardware: excite, simulate another machine, identify it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.errors import InputError, ScenarioError

from .recorded import rubbing

pytestmark = pytest.mark.slow

NUMBERS = ["platform.mass", "platform.com", "chain.*.actuator.viscous", "chain.*.actuator.coulomb"]


@pytest.mark.ci
@pytest.mark.usefixtures("compiler_command")
def test_the_circle(tmp_path: Path) -> None:
    """A file that is off by 30 % predicts the efforts of another motion to the noise."""
    before = rubbing(condyle.load_mechanism("masticatory"))
    rng = np.random.default_rng(7)
    changes: dict[str, Any] = {"platform.mass": 1.3 * before.get("platform.mass")}
    changes["platform.com"] = (3e-3, -2e-3, 2e-3)
    for name in before.chain_names:
        for key in ("viscous", "coulomb"):
            path = f"chain.{name}.actuator.{key}"
            changes[path] = before.get(path) * (1 + 0.3 * rng.choice([-1, 1]))
    truth = before.set(changes)
    condyle.dump(before, tmp_path / "ours.toml")

    noise = {"effort": 2e-4, "encoder": 1e-4}
    asked = {"numbers": NUMBERS, "noise": noise, "harmonics": 3, "period": 4.0, "starts": 1}
    condyle.excite(before, asked).save(tmp_path / "path.csv")

    # The machine is another than the controller's model; ticks come late, and some not at all.
    scenario = {
        "duration": 4.0,
        "rate": 500.0,
        "method": "rk4",
        "step": 1e-3,
        "controller": {
            "kind": "computed_torque",
            "rate": 1000.0,
            "stiffness": 2500.0,
            "damping": 100.0,
            "model": str(tmp_path / "ours.toml"),
            "motion": str(tmp_path / "path.csv"),
        },
        "sensors": {"encoder_resolution": 1e-5},
        "timing": {"jitter": 3e-4, "missed": 0.02},
        "start": {"on_motion": True},
    }
    run = condyle.simulate(truth, scenario)
    log = tmp_path / "log.csv"
    condyle.write_log(run, log, encoder_noise=noise["encoder"], effort_noise=noise["effort"])
    fit = {"numbers": NUMBERS, "noise": noise, "options": {"smooth": 8.0}}
    found = condyle.identify(tmp_path / "ours.toml", log, fit)
    motion, model = condyle.reference_motion(), condyle.derive(truth, distribution="minimum_norm")
    states = model.poses.of_motion(motion)[0]
    right = model.inverse_dynamics(*states).effort
    errors = [
        float(np.sqrt(np.mean((condyle.derive(one, distribution="minimum_norm")
                               .inverse_dynamics(*states).effort - right) ** 2)))
        for one in (found.mechanism, before)
    ]  # fmt: skip
    assert errors[0] < noise["effort"] < errors[1]


@pytest.mark.usefixtures("compiler_command")
def test_ticks_that_are_missed() -> None:
    """Every other tick left out tracks worse; a little jitter hardly matters; seeds repeat."""

    def off(**timing: Any) -> float:
        table = {"duration": 0.5, "method": "rk4", "step": 1e-3}
        control = {"kind": "joint_pd", "rate": 200.0, "stiffness": 8.0, "damping": 0.05}
        more = {"timing": timing} if timing else {}
        scenario = {**table, "controller": control, "start": {"on_motion": True}, **more}
        found = condyle.simulate("masticatory", scenario)
        assert not found["status"].values.any()
        return float(np.abs(found["command"].diff("time")).sum())

    still, again = off(missed=0.5, seed=3), off(missed=0.5, seed=3)
    assert still == again
    assert off(jitter=0.0) == pytest.approx(off(), rel=1e-12)
    assert off(missed=0.5, seed=4) != still
    assert still != pytest.approx(off(), rel=1e-6)


def test_timing_it_refuses() -> None:
    control = {"kind": "joint_pd", "rate": 200.0, "stiffness": 8.0, "damping": 0.05}
    for name, value, said in (
        ("jitter", 0.1, "less than a period"),
        ("missed", 1.0, "missed"),
        ("late", 1.0, "late"),
    ):
        with pytest.raises(ScenarioError, match=said):
            condyle.simulate("masticatory", {"controller": control, "timing": {name: value}})


def test_a_log_from_the_command(tmp_path: Path, condyle_command: Any) -> None:
    (tmp_path / "a.toml").write_text("duration = 0.01")
    words = ["simulate", "--scenario", "a.toml", "--out", "run", "--log", "log.csv"]
    said = condyle_command(*words, "--log-noise", "effort=1e-3")
    assert said.status == 0, said.err
    head = (tmp_path / "log.csv").read_text().split("\n")[0].split(",")
    assert head[0] == "t" and "joint_masseter_left" in head and "contact_left_condyle" in head
    wrong = condyle_command(*words, "--log-noise", "torque=1")
    assert wrong.status == 2 and 'unknown name "torque"' in wrong.err


def test_logs_are_of_solutions(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="solution"):
        condyle.write_log(3, tmp_path / "a.csv")  # type: ignore[arg-type]
    solution = condyle.derive("masticatory").solve(condyle.reference_motion())
    with pytest.raises(InputError, match="encoder_noise"):
        condyle.write_log(solution, tmp_path / "a.csv", encoder_noise=-1.0)
    assert not (tmp_path / "a.csv").exists()
