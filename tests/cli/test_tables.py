"""condyle derivatives: its table, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.errors import InputError, SampleError

from .conftest import read_csv, write_csv


def test_columns_of_derivatives(run: Any) -> None:
    """The table has what the model has."""
    rows = np.random.default_rng(0).normal(0, 1, (2, 12)) * np.repeat([1e-3, 0.1, 1.0], 4)
    names = [p + n for p in ("", "d", "dd") for n in ("X", "Y", "alpha", "beta")]
    write_csv("states.csv", names, rows)
    viscous = "chain.*.actuator.viscous"
    wrt = ("q", "a", "platform.mass", viscous, "gravity")
    asked = [word for by in wrt for word in ("--wrt", by)]
    call = ("derivatives", "masticatory", "--states", "states.csv", "--of", "effort")
    assert run(*call, *asked, "--out", "out.csv").status == 0
    head, cells = read_csv("out.csv")
    table = np.array(cells, dtype=float)
    q, v, a = np.split(rows, 3, axis=1)
    d = model("masticatory").derivatives("effort", wrt, q=q, v=v, a=a)
    for name, i, by, at in (
        ("masseter_left / d beta", 2, "q", 3),
        ("pterygoid_right / d ddX", 5, "a", 0),
        ("temporalis_left / d platform.mass", 0, "platform.mass", ...),
        ("masseter_right / d chain.masseter_left.actuator.viscous", 3, viscous, 2),
        ("masseter_right / d gravity[2]", 3, "gravity", 2),
    ):
        wanted = d["effort", by][:, i]
        wanted = wanted if at is ... else wanted[..., at]
        np.testing.assert_allclose(table[:, head.index(f"d tau_{name}")], wanted, rtol=1e-12)

    given: dict[str, Any] = dict(model=model("masticatory"), states="states.csv", out="out.csv")
    with pytest.raises(InputError, match=r"unknown result 'torque'.*Available: .*effort"):
        condyle.derivative_states(**given, of="torque")
    with pytest.raises(InputError, match="effort cannot depend on joint"):
        condyle.derivative_states(**given, wrt="joint")
    write_csv("states.csv", names, [[10, *[0] * 11]])
    with pytest.raises(SampleError, match="row 1 has no derivatives"):
        condyle.derivative_states(**given)
    condyle.derivative_states(**given, flag=True)
    assert Path("out.csv").read_text().splitlines()[1].endswith("unreachable")
