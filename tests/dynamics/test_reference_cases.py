"""The cases of an independent engine on the reference mechanism, by every model and `solve`."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.loads import load_point_of, parts, with_point
from support.speeds import first, slow

import condyle
from condyle.dynamics import FORMULATIONS, ROUTES

REFERENCE = json.loads((Path(__file__).parents[1] / "oracles" / "reference_cases.json").read_text())
CASES = {key: np.array([case[key] for case in REFERENCE["cases"]]) for key in REFERENCE["cases"][0]}
NAMES = REFERENCE["coordinates"]


def close(got: np.ndarray, key: str) -> None:
    """To 1e-9 of the largest component of each case."""
    size = np.abs(CASES[key]).max(axis=1, keepdims=True)
    assert (np.abs(got - CASES[key]) < 1e-9 * size).all(), key


@pytest.mark.parametrize("route", ROUTES)
@pytest.mark.parametrize("formulation", first(FORMULATIONS, 3, rest=slow))
def test_every_model_meets_the_cases(
    reference: condyle.Mechanism, formulation: str, route: str
) -> None:
    model = condyle.derive(reference, formulation=formulation, route=route)
    assert list(model.independent) == NAMES
    force = np.hstack([CASES["F"], np.zeros_like(CASES["F"])])
    load = with_point(force, load_point_of(model, REFERENCE["load_point"]))
    found = model.inverse_dynamics(
        CASES["q"], CASES["qd"], CASES["qdd"], *parts(load), outputs="all"
    )
    close(found.effort, "tau")
    close(found.contact_force, "contact")
    close(found.pose, "pose")
    close(found.pose_rate, "pose_d")
    close(found.pose_acceleration, "pose_dd")
    close(found.configuration.joint, "theta")
    close(found.joint_rate, "theta_d")
    close(found.joint_acceleration, "theta_dd")
    close(found.configuration.beta, "beta_i")
    close(found.configuration.gamma, "gamma_i")


@pytest.mark.parametrize(
    "backend, options",
    [
        pytest.param("compiled", (), marks=slow),
        ("numpy", ("--formulation", "lagrange", "--route", "direct")),
    ],
)
def test_the_command_meets_the_cases(
    condyle_command: Callable[..., Any],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    backend: str,
    options: tuple[str, ...],
) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", backend)
    header = [p + name for p in ("", "d", "dd") for name in NAMES] + ["Fx", "Fy", "Fz"]
    rows = np.hstack([CASES[key] for key in ("q", "qd", "qdd", "F")])
    with open(tmp_path / "states.csv", "w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows.tolist())
    arguments = ("--states", "states.csv", "--out", "out.csv", "--load-point", "right_molar")
    outcome = condyle_command("solve", "masticatory", *arguments, *options)
    assert outcome.status == 0, outcome.err
    with open(tmp_path / "out.csv", newline="") as file:
        columns, *found = list(csv.reader(file))
    table = np.array(found, dtype=float)
    assert table.shape == (len(rows), 20)
    close(table[:, :6], "tau")
    close(table[:, 6:8], "contact")
    close(table[:, 8:14], "pose")
    close(table[:, 14:], "theta")
    assert columns[0] == "tau_temporalis_left" and columns[19] == "joint_pterygoid_right"
