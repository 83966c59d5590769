"""condyle derivatives: its table has what the model has."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.errors import InputError, SampleError

CALL = ("derivatives", "masticatory", "--states", "states.csv", "--backend", "numpy")


@pytest.fixture
def states(in_tmp: Path) -> np.ndarray:
    rows = np.random.default_rng(0).normal(0, 1, (2, 12)) * np.repeat([1e-3, 0.1, 1.0], 4)
    names = [p + n for p in ("", "d", "dd") for n in ("X", "Y", "alpha", "beta")]
    np.savetxt("states.csv", rows, "%.17g", ",", header=",".join(names), comments="")
    return rows


@pytest.fixture
def in_tmp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_columns(states: np.ndarray, condyle_command: Callable[..., Any]) -> None:
    wrt = ("q", "a", "platform.mass", "chain.*.actuator.viscous", "gravity")
    asked = [word for by in wrt for word in ("--wrt", by)]
    condyle_command(*CALL, "--of", "effort", *asked, "--out", "out.csv")
    head = Path("out.csv").read_text().splitlines()[0].split(",")
    table = np.genfromtxt("out.csv", delimiter=",", skip_header=1)
    model = condyle.derive("masticatory", backend="numpy")
    q, v, a = np.split(states, 3, axis=1)
    d = model.derivatives("effort", wrt, q=q, v=v, a=a)
    for name, i, by, at in (
        ("d tau_masseter_left / d beta", 2, "q", 3),
        ("d tau_pterygoid_right / d ddX", 5, "a", 0),
        ("d tau_temporalis_left / d platform.mass", 0, "platform.mass", ()),
        (
            "d tau_masseter_right / d chain.masseter_left.actuator.viscous",
            *(3, "chain.*.actuator.viscous", 2),
        ),
        ("d tau_masseter_right / d gravity[2]", 3, "gravity", 2),
    ):
        wanted = d["effort", by][:, i][(..., at) if at != () else ...]
        np.testing.assert_allclose(table[:, head.index(name)], wanted, rtol=1e-12)


def test_what_is_refused(states: np.ndarray) -> None:
    given: dict[str, Any] = {"model": "masticatory", "states": "states.csv", "out": "out.csv"}
    with pytest.raises(InputError, match="there is no 'torque' of states"):
        condyle.derivative_states(**given, of="torque")
    with pytest.raises(InputError, match="effort cannot depend on joint"):
        condyle.derivative_states(**given, wrt="joint")
    text = Path("states.csv").read_text().splitlines()
    Path("states.csv").write_text("\n".join([text[0], ",".join(["10"] + ["0"] * 11)]) + "\n")
    with pytest.raises(SampleError, match="row 1 has no derivatives"):
        condyle.derivative_states(**given)
    condyle.derivative_states(**given, flag=True)
    assert Path("out.csv").read_text().splitlines()[1].endswith("unreachable")
