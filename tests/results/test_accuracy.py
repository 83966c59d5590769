"""A required accuracy: too few digits are an error, and bounds are written on request."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.errors import AccuracyError, InputError


def columns(path: Path) -> dict[str, np.ndarray]:
    names = path.read_text().splitlines()[0].split(",")
    return dict(zip(names, np.genfromtxt(path, delimiter=",", skip_header=1).T, strict=True))


@pytest.mark.parametrize("question", ["solve", "forward", "pose"])
def test_tables(question: str, tmp_path: Path) -> None:
    states, out = tmp_path / "states.csv", tmp_path / "out.csv"
    head, chains = ["X", "Y", "alpha", "beta"], model("masticatory").mechanism.chain_names
    names = {
        "solve": head,
        "forward": [*head, *(f"tau_{c}" for c in chains)],
        "pose": [f"joint_{c}" for c in chains],
    }[question]
    row = ",".join("0" for _ in names)
    states.write_text("\n".join([",".join(names), row, row]))
    run = partial(getattr(condyle, f"{question}_states"), model("masticatory"), states, out)
    run()
    assert "bound" not in out.read_text()
    run(max_error=1e-8)
    bound = columns(out)["bound"]
    assert (bound > 0).all() and (bound < 1e-8).all()
    with pytest.raises(AccuracyError, match="the relative error at row 1 may be") as caught:
        run(max_error=1e-15)
    assert caught.value.row == 1 and caught.value.samples == [0, 1]
    assert caught.value.bound == 1e-15 < caught.value.value


def test_a_motion(tmp_path: Path) -> None:
    solution = condyle.run(backend="numpy", max_error=1e-8)
    solution.condyle.save(tmp_path / "run.csv")
    np.testing.assert_array_equal(columns(tmp_path / "run.csv")["bound"], solution["bound"])
    with pytest.raises(AccuracyError, match="at t = 0 s"):
        condyle.run(backend="numpy", max_error=1e-15)
    for given in (0, -1e-8, "small", True, float("nan")):
        with pytest.raises(InputError, match="max_error: expected a positive number such as 1e-8"):
            condyle.run(backend="numpy", max_error=given)


def test_few_digits_are_a_warning(tmp_path: Path) -> None:
    """Next to the end of a chain's reach."""
    ray = np.array([1.0, 0, 0, 0])
    near, far = 0.0, 1.0
    for _ in range(60):
        middle = (near + far) / 2
        ok = model("masticatory").inverse_dynamics(middle * ray, 0 * ray, 0 * ray).status == 0
        near, far = (middle, far) if ok else (near, middle)
    states = tmp_path / "states.csv"
    states.write_text(f"X,Y,alpha,beta\n{near * (1 - 1e-9)!r},0,0,0\n0,0,0,0\n")
    report = condyle.solve_states(model("masticatory"), states, tmp_path / "out.csv")
    (text,) = [t for t in report.data["warnings"] if "few digits" in t]
    assert text.startswith("1 row with few digits: the relative error may be")
