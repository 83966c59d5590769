"""`identify` finds planted numbers, says how well, and names what a log cannot tell."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

import condyle
from condyle.errors import InputError
from condyle.identification.equations import Extras, LogEquations
from condyle.identification.fit_study import FitStudy
from condyle.identification.fitting import fit, pseudo_inertia
from condyle.identification.log import make_log
from condyle.identification.unknowns import Unknowns
from condyle.mechanism import Mechanism

from .recorded import ENCODER, Recorded, recorded, rubbing

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("compiler_command")]

NUMBERS = [
    "platform.mass",
    "platform.com",
    "platform.inertia.yy",
    "chain.*.actuator.viscous",
    "chain.*.actuator.coulomb",
]


@pytest.fixture(scope="module")
def before() -> Mechanism:
    return rubbing(condyle.load_mechanism("masticatory"))


@pytest.fixture(scope="module")
def truth(before: Mechanism) -> Mechanism:
    changes: dict[str, Any] = {
        "platform.mass": 0.23,
        "platform.com": (4e-3, -2e-3, 3e-3),
        "platform.inertia.yy": 1.6e-4,
    }
    for name in before.chain_names:
        for key in ("viscous", "coulomb"):
            path = f"chain.{name}.actuator.{key}"
            changes[path] = 1.3 * before.get(path)
    return before.set(changes)


def study(of: Recorded, **more: Any) -> dict[str, Any]:
    return {
        "numbers": NUMBERS,
        "noise": {"effort": of.noise, "encoder": ENCODER},
        **more,
    }


def test_planted_numbers(before: Mechanism, truth: Mechanism, tmp_path: Path) -> None:
    machine = recorded(truth, 12.0)
    log = machine.save(tmp_path / "log.csv", 1)
    found = condyle.identify(before, log, study(machine))
    for one in found.numbers:
        assert one.told
        assert abs(one.value - truth.get(one.name)) < 4 * one.deviation, one
        assert one.deviation < abs(one.value), one
    assert found.fitted.spread == pytest.approx(1.0, abs=0.2)
    assert found.validated is not None
    assert found.validated.spread == pytest.approx(1.0, abs=0.3)
    assert np.allclose(np.diag(found.correlation), 1.0)
    # It predicts the efforts of another motion far better than the file did.
    q, v, a = condyle.derive(truth).poses.of_motion(condyle.reference_motion())[0]
    right = condyle.derive(truth).inverse_dynamics(q, v, a).effort
    errors = [
        np.abs(condyle.derive(one).inverse_dynamics(q, v, a).effort - right).max()
        for one in (found.mechanism, before)
    ]
    assert errors[0] < 0.1 * errors[1]
    assert errors[0] < machine.noise


def test_bias_delay_and_contact_forces(before: Mechanism, truth: Mechanism, tmp_path: Path) -> None:
    machine = recorded(truth, 12.0)
    log = machine.save(tmp_path / "log.csv", 2, late=4e-3, bias=2e-3)
    options = {"bias": True, "delay": True}
    found = condyle.identify(before, [log], study(machine, options=options))
    numbers = {one.name: one for one in found.numbers}
    delay, bias = numbers["delay"], numbers[f"bias.{before.chain_names[0]}"]
    assert abs(delay.value - 4e-3) < 4 * delay.deviation < 4e-4
    assert abs(bias.value - 2e-3) < 4 * bias.deviation


@pytest.mark.parametrize("mu", [0.1, 0.4])
def test_friction_at_contacts(before: Mechanism, truth: Mechanism, mu: float) -> None:
    rough = {
        f"contact.{name}.friction": {"coefficient": mu, "smoothing_speed": 0.005}
        for name in truth.contact_names
    }
    machine = recorded(truth.set(rough), 8.0)
    assert _chi_square(before.set(rough), machine, 3)[0] < chi2.ppf(0.999, 17)


def _rough(before: Mechanism, truth: Mechanism, start: float) -> tuple[Mechanism, Mechanism]:
    """A file whose contacts have one coefficient, and the machine, whose have others."""
    left, right = (f"contact.{name}.friction.coefficient" for name in truth.contact_names)
    speeds = {f"contact.{n}.friction.smoothing_speed": 0.005 for n in truth.contact_names}
    return (
        before.set({left: start, right: start} | speeds),
        truth.set({left: 0.15, right: 0.25} | speeds),
    )


def _without_contacts(log: Path) -> Path:
    rows = [line.split(",") for line in log.read_text().splitlines()]
    kept = [i for i, name in enumerate(rows[0]) if not name.startswith("contact_")]
    log.write_text("\n".join(",".join(row[i] for i in kept) for row in rows))
    return log


COEFFICIENTS = "contact.*.friction.coefficient"


@pytest.mark.parametrize(("start", "measured"), [(0.0, False), (0.0, True), (0.4, True)])
def test_coefficients_of_contacts(
    before: Mechanism, truth: Mechanism, tmp_path: Path, start: float, measured: bool
) -> None:
    """Friction at contacts beside that of actuators, with and without measured contact forces."""
    file, rough = _rough(before, truth, start)
    machine = recorded(rough, 12.0)
    log = machine.save(tmp_path / "log.csv", 5)
    asked = study(machine, numbers=[*NUMBERS, COEFFICIENTS])
    found = condyle.identify(file, log if measured else _without_contacts(log), asked)
    numbers = {one.name: one for one in found.numbers}
    for one in found.numbers:
        assert one.told and abs(one.value - rough.get(one.name)) < 4 * one.deviation
    for contact in rough.contacts:
        name = f"contact.{contact.name}.friction.coefficient"
        assert numbers[name].before == start
        assert numbers[name].deviation < 0.05 * contact.friction.coefficient
        assert found.mechanism.get(name) == numbers[name].value
    assert found.fitted.spread == pytest.approx(1.0, abs=0.2)
    found.save(tmp_path / "fitted.toml")
    again = condyle.load_mechanism(tmp_path / "fitted.toml")
    assert again.get(name) == numbers[name].value
    assert again.get("contact.left_condyle.friction.smoothing_speed") == 0.005


def test_one_coefficient_of_all_contacts(
    before: Mechanism, truth: Mechanism, tmp_path: Path
) -> None:
    """Shared: of two unlike contacts it is between them."""
    file, rough = _rough(before, truth, 0.1)
    machine = recorded(rough, 12.0)
    asked = study(machine, numbers=[*NUMBERS, COEFFICIENTS], shared=[COEFFICIENTS])
    found = condyle.identify(file, machine.save(tmp_path / "log.csv", 5), asked)
    (one,) = (one for one in found.numbers if one.name == COEFFICIENTS)
    assert 0.15 < one.value < 0.25 and found.fitted.spread > 1.5
    for name in truth.contact_names:
        assert found.mechanism.get(f"contact.{name}.friction.coefficient") == one.value


@pytest.mark.ci
def test_deviations_are_true_of_contacts(
    before: Mechanism, truth: Mechanism, tmp_path: Path
) -> None:
    """Where contact forces are measured too, and friction there is unknown."""
    file, rough = _rough(before, truth, 0.1)
    machine, errors = recorded(rough, 6.0), []
    asked = study(machine, numbers=[*NUMBERS, COEFFICIENTS])
    for seed in range(16):
        found = condyle.identify(file, machine.save(tmp_path / "log.csv", seed), asked)
        errors += [(one.value - rough.get(one.name)) / one.deviation for one in found.numbers]
    assert (np.abs(errors) < 3).mean() > 0.98
    assert 0.85 < np.sqrt(np.mean(np.square(errors))) < 1.15


def test_a_log_that_cannot_tell(
    before: Mechanism, truth: Mechanism, tmp_path: Path, condyle_command: Any
) -> None:
    machine = recorded(truth, 6.0, still=True)
    log = machine.save(tmp_path / "log.csv", 1)
    file, asked = tmp_path / "robot.toml", tmp_path / "fit.toml"
    condyle.dump(before, file)
    file.write_text("# Ours since 2019.\n" + file.read_text())
    asked.write_text(f"numbers = {json.dumps(NUMBERS)}\n[noise]\neffort = {machine.noise}\n")
    out = tmp_path / "fitted.toml"
    words = ["identify", str(file), "--log", str(log), "--study", str(asked), "--out", str(out)]
    said = condyle_command(*words, "--json")
    assert said.status == 0, said.err
    assert "cannot tell" in said.err and "platform.inertia.yy" in said.err
    numbers = json.loads(said.out)["numbers"]
    held = numbers["platform.inertia.yy"]
    assert not held["identified"] and held["deviation"] is None and held["why"]
    assert held["value"] == before.get("platform.inertia.yy")
    assert numbers["platform.com[0]"]["identified"] or numbers["platform.mass"]["identified"]
    assert "# Ours since 2019." in out.read_text()
    assert condyle.load_mechanism(out).get("platform.inertia.yy") == held["value"]
    assert condyle_command(*words, "--strict").status == 2


def test_bodies_are_possible(before: Mechanism, truth: Mechanism, tmp_path: Path) -> None:
    """All ten numbers from little data: the fit stays among bodies that can be."""
    machine = recorded(truth, 4.0)
    log = machine.save(tmp_path / "log.csv", 4)
    asked = study(machine)
    asked["numbers"] = ["platform.mass", "platform.com", "platform.inertia", *NUMBERS[3:]]
    asked["prior"] = {"platform.inertia": [[2e-6, 1e-4, 1e-4, 8e-5, 0, 0], [1e-6] * 6]}
    found = condyle.identify(before, log, asked)
    assert found.held
    standard = condyle.derive(found.mechanism).regressor(*np.zeros((3, 4))).numbers
    assert np.linalg.eigvalsh(pseudo_inertia(standard[:10]))[0] > 0
    condyle.dump(found.mechanism, tmp_path / "fitted.toml")
    condyle.load_mechanism(tmp_path / "fitted.toml")


def _chi_square(before: Mechanism, machine: Recorded, seed: int) -> tuple[float, np.ndarray]:
    """Of the error by its covariance, and errors over their standard deviations."""
    model = condyle.derive(before, distribution="minimum_norm")
    asked = FitStudy.checked(study(machine), "study")
    unknowns = Unknowns(model.regression.standard, asked)
    joint, effort = machine.noisy(seed)
    log = make_log(model, machine.t, joint, effort, np.zeros((len(joint), 6)), None, True, 10.0)
    noise = machine.noise, ENCODER
    equations = LogEquations(model, log, unknowns, Extras(False, False), noise, None)
    found = fit([equations], unknowns, [one.name for one in unknowns.all])
    assert found.told.all()
    error = found.x - np.array([machine.mechanism.get(one.name) for one in unknowns.all])
    square = float(error @ np.linalg.solve(found.covariance, error))
    return square, error / np.sqrt(np.diag(found.covariance))


@pytest.mark.ci
def test_deviations_are_true(before: Mechanism, truth: Mechanism) -> None:
    """Over 100 recordings: chi-square in its band, errors as large as they are said to be."""
    machine = recorded(truth, 6.0)
    found = [_chi_square(before, machine, seed) for seed in range(100)]
    squares, errors = np.array([one[0] for one in found]), np.array([one[1] for one in found])
    low, high = chi2.ppf([0.025, 0.975], errors.shape[1])
    assert 90 <= ((squares > low) & (squares < high)).sum() <= 99
    assert (np.abs(errors) < 3).mean() > 0.99
    assert np.sqrt((errors**2).mean(axis=0)).max() < 1.4


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"numbers": ["platform.masss"]}, "masss"),
        ({"numbers": ["chain.*.base"]}, "calibrate"),
        ({"numbers": ["contact.*.point"]}, "friction.coefficient of contacts"),
        ({"numbers": []}, "numbers"),
        ({"number": ["platform.mass"]}, "number"),
        ({"numbers": ["platform.mass"], "prior": {"platform.mass": [0.2, 0]}}, "above 0"),
        ({"numbers": ["platform.mass"], "prior": {"platform.com": [0, 1]}}, "not among"),
        ({"numbers": ["platform.com"], "prior": {"platform.com": [[0, 1], 1]}}, "3 numbers"),
        ({"numbers": ["platform.mass"], "shared": ["platform.mass"]}, "no star"),
        ({"numbers": ["platform.mass"], "options": {"validate": "none.csv"}}, "none.csv"),
        ({"numbers": ["platform.mass"], "options": {"smooth": 400.0}}, "cut-off"),
        ({"numbers": ["platform.mass"], "options": {"load_point": "chin"}}, "chin"),
    ],
)
def test_what_it_refuses(
    before: Mechanism, tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    log = recorded(before, 2.0).save(tmp_path / "log.csv", 1)
    with pytest.raises(InputError, match=said):
        condyle.identify(before, log, change)


@pytest.mark.parametrize(
    ("drop", "said"), [("tau_", "tau_temporalis_left"), ("joint_", "joint_<chain>"), ("t", '"t"')]
)
def test_logs_it_refuses(before: Mechanism, tmp_path: Path, drop: str, said: str) -> None:
    log = recorded(before, 2.0).save(tmp_path / "log.csv", 1)
    head, rest = log.read_text().split("\n", 1)
    names = [("x" + n if n == drop or n.startswith(drop + "") else n) for n in head.split(",")]
    log.write_text(",".join(names) + "\n" + rest)
    with pytest.raises(InputError, match=said):
        condyle.identify(before, log, {"numbers": ["platform.mass"]})
