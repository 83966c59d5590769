"""Digits that intervals prove: beside an oracle of 60 digits, and what can go wrong."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest
from oracles.digits import Machine

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.mechanism.library import bundled_text


@pytest.mark.slow
def test_what_is_proven_is_true() -> None:
    """At least as many digits agree with the other text, whose constants are no doubles."""
    solution = condyle.run("masticatory-curved", backend="numpy", prove=2)
    proofs = json.loads(solution.attrs["proof"])
    assert len(proofs) == 2
    names = list(solution.condyle.options["independent"])
    machine = Machine(tomllib.loads(bundled_text("masticatory-curved")), names)
    for proof in proofs:
        here = solution.sel(time=proof["time"])
        parts = ("pose", "pose_rate", "pose_acceleration")
        rows = [here[n].sel(coordinate=names).values for n in parts]
        options = solution.condyle.options
        point = solution.condyle.mechanism.platform.points[options["load_point"] or "right_molar"]
        wrench = here["load"].values
        tau, _ = machine.inverse(here["pose"].values, *rows, wrench, point)
        exact = np.array([float(x) for x in tau])
        off = np.abs(exact - here["effort"].values).max() / np.abs(exact).max()
        assert proof["digits"] > 13 and off < 50 * 10 ** -proof["digits"]
        assert 10 ** -proof["digits"] < proof["bound"]


def test_what_cannot_be_proven() -> None:
    """A number of samples that is none; efforts within limits."""
    for given in (0, -1, 1.5, "all", True):
        with pytest.raises(InputError, match="prove: expected a number of samples, at least 1"):
            condyle.run(backend="numpy", prove=given)
    with pytest.raises(UnsupportedError, match="--distribution minimum_norm"):
        condyle.run("human-jaw", backend="numpy", prove=1)
