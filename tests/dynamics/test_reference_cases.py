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
from support.machines import model
from support.speeds import first, slow

from condyle.dynamics import FORMULATIONS, ROUTES

REFERENCE = json.loads((Path(__file__).parents[1] / "oracles" / "reference_cases.json").read_text())
CASES = {key: np.array([case[key] for case in REFERENCE["cases"]]) for key in REFERENCE["cases"][0]}
NAMES = REFERENCE["coordinates"]


def close(got: np.ndarray, key: str) -> None:
    """To 1e-9 of the largest component of each case."""
    size = np.abs(CASES[key]).max(axis=1, keepdims=True)
    assert (np.abs(got - CASES[key]) < 1e-9 * size).all(), key


def solved(**how: str) -> Any:
    by = model("masticatory", **how)
    assert list(by.independent) == NAMES
    force = np.hstack([CASES["F"], np.zeros_like(CASES["F"])])
    load = with_point(force, load_point_of(by, REFERENCE["load_point"]))
    return by.inverse_dynamics(CASES["q"], CASES["qd"], CASES["qdd"], *parts(load), outputs="all")


@pytest.mark.parametrize("formulation", first(FORMULATIONS, 2, rest=slow))
def test_every_model_meets_the_cases(formulation: str) -> None:
    """And shares are those of the paper's formulation."""
    share = solved(formulation="momentum", route="core").share
    for route in ROUTES:
        found = solved(formulation=formulation, route=route)
        for got, key in (
            *((found.effort, "tau"), (found.contact_force, "contact"), (found.pose, "pose")),
            *((found.pose_rate, "pose_d"), (found.pose_acceleration, "pose_dd")),
            *((found.configuration.joint, "theta"), (found.joint_rate, "theta_d")),
            (found.joint_acceleration, "theta_dd"),
            *((found.configuration.beta, "beta_i"), (found.configuration.gamma, "gamma_i")),
        ):
            close(got, key)
        size = np.abs(share).max(axis=(1, 2), keepdims=True)
        assert (np.abs(found.share - share) < 1e-10 * size).all()


def test_the_command_meets_the_cases(condyle_command: Callable[..., Any], tmp_path: Path) -> None:
    header = [p + name for p in ("", "d", "dd") for name in NAMES] + ["Fx", "Fy", "Fz"]
    rows = np.hstack([CASES[key] for key in ("q", "qd", "qdd", "F")])
    with open(tmp_path / "states.csv", "w", newline="") as file:
        csv.writer(file).writerows([header, *rows.tolist()])
    arguments = ("--states", "states.csv", "--out", "out.csv", "--load-point", "right_molar")
    how = ("--formulation", "lagrange", "--route", "direct")
    outcome = condyle_command("solve", "masticatory", *arguments, *how)
    assert outcome.status == 0, outcome.err
    with open(tmp_path / "out.csv", newline="") as file:
        columns, *found = list(csv.reader(file))
    table = np.array(found, dtype=float)
    assert table.shape == (len(rows), 20)
    for at, end, key in ((0, 6, "tau"), (6, 8, "contact"), (8, 14, "pose"), (14, 20, "theta")):
        close(table[:, at:end], key)
    assert columns[0] == "tau_temporalis_left" and columns[19] == "joint_pterygoid_right"
