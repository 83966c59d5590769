"""Derivatives of places and of forward kinematics against differences of the eighth order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from support.families import close
from support.machines import model as shared
from support.speeds import few

from condyle.model.model import Model

Array = np.ndarray
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
PLACES = ("pose", "joint", "contact_point", "singularity_ratio")
MACHINES = ("masticatory-curved", "gough-stewart", "hexaglide", "human-jaw")
STEP = 5e-5  # m or rad


def differences(at: Callable[[float], Any]) -> dict[str, Array]:
    """d at / d step at 0 of every array in `at`, each to some STEP^8."""
    ends = [(at((k + 1) * STEP), at(-(k + 1) * STEP)) for k in range(len(WEIGHTS))]
    return {
        name: sum(w * (a[name] - b[name]) for w, (a, b) in zip(WEIGHTS, ends, strict=True)) / STEP
        for name in ends[0][0]
    }


def places(model: Model, q: Array) -> dict[str, Array]:
    found = model.inverse_kinematics(q)
    assert not found.status.any()
    own = {name: getattr(found, name) for name in PLACES[:3]}
    return own | {"singularity_ratio": found.singularity.ratio}


def changed(model: Model, direction: Array, size: float) -> Model:
    """With other bases of the chains; a crank keeps its direction."""
    machine, moves = model.mechanism, {}
    for chain, step in zip(machine.chains, direction, strict=True):
        for key in ("base", "crank_tip")[: 1 + (chain.kind == "RSS")]:
            moves[f"chain.{chain.name}.{key}"] = tuple(getattr(chain, key) + size * step)
    return Model(machine._set(moves, "all"), backend="numpy")


@pytest.mark.parametrize("name", few(MACHINES, "masticatory-curved", "human-jaw"))
def test_places_and_readings(name: str) -> None:
    model = Model(name, backend="numpy")
    rng, m = np.random.default_rng(3), len(model.independent)
    q, along = 2e-3 * rng.normal(size=(2, m)), rng.normal(size=m)
    turns = model.mechanism.chains[0].kind == "RSS"
    paths = ["chain.*.base", "chain.*.crank_tip"][: 1 + turns]
    d = model.derivatives(PLACES, ("q", *paths), q=q, keep="all", zeros=True)
    assert not d.status.any()
    direction = rng.normal(size=(len(model.mechanism.chains), 3))
    by_q = differences(lambda s: places(model, q + s * along))
    by_numbers = differences(lambda s: places(changed(model, direction, s), q))
    for of in PLACES:
        close(d[of, "q"] @ along, by_q[of], 1e-8)
        found = sum(np.sum(d[of, path] * direction, axis=(-1, -2)) for path in paths)
        close(found, by_numbers[of], 1e-8, 1e-9)
    # From the joints back to q.
    joint = model.inverse_kinematics(q).joint + model.mechanism.zeros
    back = model.derivatives("q", ("joint", *paths), joint=joint, keep="all")
    turn = rng.normal(size=joint.shape[1])

    def solved(other: Model, readings: Array) -> dict[str, Array]:
        found = other.forward_kinematics(readings, tolerance=1.0)
        assert not found.status.any()
        return {"q": found.q}

    wanted = differences(lambda s: solved(model, joint + s * turn))["q"]
    close(back["q", "joint"] @ turn, wanted, 1e-8)
    wanted = differences(lambda s: solved(changed(model, direction, s), joint))["q"]
    found = sum(np.sum(back["q", path] * direction, axis=(-1, -2)) for path in paths)
    close(found, wanted, 1e-8)


def test_whose_home_is_kept_is_said() -> None:
    """A contact whose own offset is asked for in the same call does not follow its point."""
    own, left = shared("masticatory"), "contact.left_condyle"
    q = np.zeros(4)
    by: dict[tuple[str, ...], Any] = {
        paths: own.derivatives("joint", paths, q=q, zeros=True)
        for paths in ((f"{left}.point",), (f"{left}.point", f"{left}.surface.offset"), ("q",))
    }
    assert [d.home_kept for d in by.values()] == [
        own.mechanism.contact_names,
        ("right_condyle",),
        (),
    ]
    alone, both, _ = by.values()
    assert np.abs(alone["joint", f"{left}.point"] - both["joint", f"{left}.point"]).max() > 1e-3
    assert "home kept: right_condyle" in repr(both)
