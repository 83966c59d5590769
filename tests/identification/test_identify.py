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
from condyle.identification.identify import Identified
from condyle.identification.log import make_log
from condyle.identification.unknowns import Unknowns
from condyle.mechanism import Mechanism

from .recorded import ENCODER, Recorded, recorded, rubbing

pytestmark = pytest.mark.slow

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
    return {"numbers": NUMBERS, "noise": {"effort": of.noise, "encoder": ENCODER}, **more}


def same(found: Identified, truth: Mechanism, **more: float) -> None:
    """Every number is identified, and within four of its standard deviations.

    Args: more: of numbers that are not in the file.
    """
    for one in found.numbers:
        right = more[one.name] if one.name in more else truth.get(one.name)
        assert one.identified and abs(one.value - right) < 4 * one.deviation, one
    assert found.fitted.spread == pytest.approx(1.0, abs=0.2)


def test_planted_numbers(before: Mechanism, truth: Mechanism, tmp_path: Path) -> None:
    """Also how late efforts are, and what is added to them; one chain's."""
    machine = recorded(truth, 8.0)
    log = machine.save(tmp_path / "log.csv", 1, late=4e-3, bias=2e-3)
    asked = study(machine, options={"bias": True, "delay": True})
    found = condyle.identify(before, [log], asked)
    biases = dict.fromkeys((f"bias.{name}" for name in before.chain_names), 0.0)
    biases[f"bias.{before.chain_names[0]}"] = 2e-3
    same(found, truth, delay=4e-3, **biases)
    numbers = {one.name: one for one in found.numbers}
    assert all(
        numbers[name].deviation < abs(numbers[name].value) for name in {*numbers} - {*biases}
    )
    assert numbers["delay"].deviation < 2e-4
    assert found.validated is not None
    assert found.validated.spread == pytest.approx(1.0, abs=0.3)
    assert np.allclose(np.diag(found.correlation), 1.0)
    # It predicts the efforts of another motion far better than the file did.
    motion = condyle.reference_motion()
    models = [condyle.derive(one) for one in (truth, found.mechanism, before)]
    right, *efforts = (m.inverse_dynamics(*m.poses.of_motion(motion)[0]).effort for m in models)
    errors = [np.abs(effort - right).max() for effort in efforts]
    assert errors[0] < 0.1 * errors[1] and errors[0] < machine.noise


def rough(of: Mechanism, left: float, right: float) -> Mechanism:
    """With friction at its contacts."""
    friction = zip(of.contact_names, (left, right), strict=True)
    return of.set(
        {f"contact.{name}.friction": {"coefficient": mu, "smoothing_speed": 0.005}
         for name, mu in friction}
    )  # fmt: skip


@pytest.mark.ci
def test_friction_at_contacts_that_is_known(before: Mechanism, truth: Mechanism) -> None:
    machine = recorded(rough(truth, 0.4, 0.4), 2.0)
    assert chi_square(rough(before, 0.4, 0.4), machine, 3)[0] < chi2.ppf(0.999, 17)


COEFFICIENTS = "contact.*.friction.coefficient"


@pytest.mark.parametrize(
    ("start", "measured"), [(0.0, False), pytest.param(0.4, True, marks=pytest.mark.ci)]
)
def test_coefficients_of_contacts(
    before: Mechanism, truth: Mechanism, tmp_path: Path, start: float, measured: bool
) -> None:
    """Friction at contacts beside that of actuators, with and without measured contact forces."""
    file, truth = rough(before, start, start), rough(truth, 0.15, 0.25)
    machine = recorded(truth, 8.0)
    log = machine.save(tmp_path / "log.csv", 5, contacts=measured)
    found = condyle.identify(file, log, study(machine, numbers=[*NUMBERS, COEFFICIENTS]))
    same(found, truth)
    found.save(tmp_path / "fitted.toml")
    again = condyle.load_mechanism(tmp_path / "fitted.toml")
    numbers = {one.name: one for one in found.numbers}
    for contact in truth.contacts:
        name = f"contact.{contact.name}.friction.coefficient"
        assert numbers[name].before == start
        assert numbers[name].deviation < 0.1 * contact.friction.coefficient
        assert found.mechanism.get(name) == again.get(name) == numbers[name].value
        assert again.get(f"contact.{contact.name}.friction.smoothing_speed") == 0.005


def test_one_coefficient_of_all_contacts(
    before: Mechanism, truth: Mechanism, tmp_path: Path
) -> None:
    """Shared: of two unlike contacts it is between them."""
    machine = recorded(rough(truth, 0.15, 0.25), 4.0)
    asked = study(machine, numbers=[*NUMBERS, COEFFICIENTS], shared=[COEFFICIENTS])
    log = machine.save(tmp_path / "log.csv", 5)
    found = condyle.identify(rough(before, 0.1, 0.1), log, asked)
    (one,) = (one for one in found.numbers if one.name == COEFFICIENTS)
    assert 0.15 < one.value < 0.25 and found.fitted.spread > 1.5
    for name in truth.contact_names:
        assert found.mechanism.get(f"contact.{name}.friction.coefficient") == one.value


def test_a_log_that_cannot_tell(
    before: Mechanism, truth: Mechanism, tmp_path: Path, condyle_command: Any
) -> None:
    machine = recorded(truth, 3.0, still=True)
    log = machine.save(tmp_path / "log.csv", 1)
    file, asked = tmp_path / "robot.toml", tmp_path / "fit.toml"
    condyle.dump(before, file)
    file.write_text("# Ours since 2019.\n" + file.read_text())
    asked.write_text(f"numbers = {json.dumps(NUMBERS)}\n[noise]\neffort = {machine.noise}\n")
    out = tmp_path / "fitted.toml"
    words = ["identify", str(file), "--log", str(log), "--study", str(asked), "--out", str(out)]
    said = condyle_command(*words, "--json")
    assert said.status == 0, said.err
    assert "do not identify" in said.err and "platform.inertia.yy" in said.err
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
    machine = recorded(truth, 3.0)
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


def chi_square(before: Mechanism, machine: Recorded, seed: int) -> tuple[float, np.ndarray]:
    """Of the error by its covariance, and errors over their standard deviations."""
    model = condyle.derive(before, distribution="minimum_norm")
    asked = FitStudy.checked(study(machine), "study")
    unknowns = Unknowns(model.regression.standard, asked)
    joint, effort = machine.noisy(seed)
    log = make_log(model, machine.t, joint, effort, np.zeros((len(joint), 6)), None, True, 10.0)
    noise = machine.noise, ENCODER
    equations = LogEquations(model, log, unknowns, Extras(False, False), noise, None)
    found = fit([equations], unknowns, [one.name for one in unknowns.all])
    assert found.identified.all()
    error = found.x - np.array([machine.mechanism.get(one.name) for one in unknowns.all])
    square = float(error @ np.linalg.solve(found.covariance, error))
    return square, error / np.sqrt(np.diag(found.covariance))


@pytest.mark.ci
def test_deviations_are_true(before: Mechanism, truth: Mechanism) -> None:
    """Errors of six recordings by their covariances: chi-square within 99.8 % of its values."""
    machine = recorded(truth, 4.0)
    found = [chi_square(before, machine, seed) for seed in range(6)]
    errors = np.array([error for _, error in found])
    low, high = chi2.ppf([0.001, 0.999], errors.size)
    assert low < sum(square for square, _ in found) < high
    assert (np.abs(errors) < 3).mean() > 0.98


def test_what_it_refuses(before: Mechanism, tmp_path: Path) -> None:
    log = recorded(before, 1.0).save(tmp_path / "log.csv", 1)
    mass: dict[str, Any] = {"numbers": ["platform.mass"]}
    for change, said in (
        ({"numbers": ["platform.masss"]}, "masss"),
        ({"numbers": ["chain.*.base"]}, "calibrate"),
        ({"numbers": ["contact.*.point"]}, "friction.coefficient of contacts"),
        ({"numbers": [], "options": {}}, "numbers"),
        ({"number": ["platform.mass"]}, "number"),
        (mass | {"prior": {"platform.mass": [0.2, 0]}}, "above 0"),
        (mass | {"prior": {"platform.com": [0, 1]}}, "not among"),
        ({"numbers": ["platform.com"], "prior": {"platform.com": [[0, 1], 1]}}, "3 numbers"),
        (mass | {"shared": ["platform.mass"]}, "no star"),
        (mass | {"options": {"validate": "none.csv"}}, "none.csv"),
        (mass | {"options": {"smooth": 400.0}}, "cut-off"),
        (mass | {"options": {"load_point": "chin"}}, "chin"),
    ):
        with pytest.raises(InputError, match=said):
            condyle.identify(before, log, change)
    text = log.read_text()
    for drop, said in (("tau_", "tau_temporalis_left"), ("joint_", "joint_<chain>"), ("t", '"t"')):
        names, rest = text.split("\n", 1)
        head = ["x" + n if n == drop or n.startswith(drop) else n for n in names.split(",")]
        log.write_text(",".join(head) + "\n" + rest)
        with pytest.raises(InputError, match=said):
            condyle.identify(before, log, mass)
