"""Derivatives of places and of forward kinematics against differences of the eighth order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.model.model import Model

Array = np.ndarray
WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
PLACES = ("pose", "joint", "contact_point", "singularity_ratio")
MACHINES = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide", "human-jaw")
PATHS = {"RSS": ("base", "crank_tip"), "PSS": ("base",), "SPS": ("base",), "cable": ("base",)}
STEP = 5e-5  # m or rad


def differences(at: Callable[[float], dict[str, Array]], h: float) -> dict[str, Array]:
    """d at / d step at 0, each to some h^8."""
    ends = [(at((k + 1) * h), at(-(k + 1) * h)) for k in range(len(WEIGHTS))]
    return {
        name: sum(w * (a[name] - b[name]) for w, (a, b) in zip(WEIGHTS, ends, strict=True)) / h
        for name in ends[0][0]
    }


def places(model: Model, q: Array) -> dict[str, Array]:
    found = model.inverse_kinematics(q)
    assert not found.status.any()
    own = {name: getattr(found, name) for name in PLACES[:3]}
    return own | {"singularity_ratio": found.singularity.ratio}


def changed(model: Model, path: str, direction: Array, size: float) -> Model:
    machine = model.mechanism
    names = machine.chain_names
    moves: dict[str, Any] = {
        path.replace("*", name): tuple(np.array(machine.get(path.replace("*", name))) + size * step)
        for name, step in zip(names, direction, strict=True)
    }
    for name, step in zip(names, direction, strict=True):
        chain = machine.chains[names.index(name)]
        if chain.kind == "RSS" and path.endswith("base"):  # the crank keeps its direction
            tip = np.array(chain.crank_tip) + size * step
            moves[f"chain.{name}.crank_tip"] = tuple(tip)
    return Model(machine._set(moves, "all"), backend="numpy")


@pytest.mark.parametrize("name", MACHINES)
def test_places_and_readings(name: str) -> None:
    model = Model(name, backend="numpy")
    rng, m = np.random.default_rng(3), len(model.independent)
    q = 2e-3 * rng.normal(size=(2, m))
    kind = model.mechanism.chains[0].kind
    paths = [f"chain.*.{key}" for key in PATHS[kind]]
    d = model.derivatives(PLACES, ("q", *paths), q=q, keep="all", zeros=True)
    assert not d.status.any()

    along = rng.normal(size=m)
    wanted = differences(lambda s: places(model, q + s * along), STEP)
    for of in PLACES:
        check(d[of, "q"] @ along, wanted[of], of)

    direction = rng.normal(size=(len(model.mechanism.chains), 3))
    wanted = differences(lambda s: places(changed(model, paths[0], direction, s), q), STEP)
    for of in PLACES:
        found = sum(np.sum(d[of, path] * direction, axis=(-1, -2)) for path in paths)
        check(np.asarray(found), wanted[of], f"{of} by {paths}")

    # From the joints back to q.
    joint = model.inverse_kinematics(q).joint + model.mechanism.zeros
    back = model.derivatives("q", ("joint", *paths), joint=joint, keep="all")
    turn = rng.normal(size=joint.shape[1])

    def solved(other: Model, readings: Array) -> dict[str, Array]:
        found = other.forward_kinematics(readings, tolerance=1.0)
        assert not found.status.any()
        return {"q": found.q}

    wanted = differences(lambda s: solved(model, joint + s * turn), STEP)
    check(back["q", "joint"] @ turn, wanted["q"], "q by joint")
    wanted = differences(lambda s: solved(changed(model, paths[0], direction, s), joint), STEP)
    found = sum(np.sum(back["q", path] * direction, axis=(-1, -2)) for path in paths)
    check(np.asarray(found), wanted["q"], "q by numbers")


def check(found: Array, wanted: Array, what: str) -> None:
    if wanted.size:
        off = np.abs(found - wanted).max() / max(np.abs(wanted).max(), 1e-9)
        assert off < 1e-8, (what, off)


def test_what_it_is_about() -> None:
    assert set(MACHINES) <= set(condyle.bundled_mechanisms())
