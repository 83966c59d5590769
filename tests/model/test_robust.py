"""Near singularities: the residual of A^T tau = b, and of the platform's balance, every way."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.cases import ones
from support.interpreter import Interpreter
from support.loads import parts

import condyle
from condyle.mechanism import Mechanism, parse
from condyle.model.model import Model
from condyle.status import Status

BACKENDS = ("numpy", "one", "batch")
RESIDUAL = 1e-12
COUNT = 9


def near_stewart() -> tuple[Mechanism, np.ndarray]:
    """A platform a quarter turn about Z is singular; towards it by tenths, off centre."""
    q = np.zeros((COUNT, 6))
    q[:, :5] = [0.01, -0.02, 0.015, 0.02, -0.03]
    singular = turn_of_stewart(q[0])
    q[:, 5] = singular - 10.0 ** -np.arange(1, COUNT + 1)
    return condyle.load_mechanism("gough-stewart"), q


def turn_of_stewart(q: np.ndarray) -> float:
    """gamma near pi / 2 where the legs' Jacobian is singular, by bisection of its sign."""
    model = Model(condyle.load_mechanism("gough-stewart"), backend="numpy")

    def sign(gamma: float) -> float:
        return np.linalg.slogdet(model.jacobians(np.array([[*q[:5], gamma]])).J_theta[0])[0]

    low, high = np.pi / 2 - 0.4, np.pi / 2 + 0.4
    assert sign(low) != sign(high)
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if sign(middle) == sign(low) else (low, middle)
    return low


def near_four_chains() -> tuple[Mechanism, np.ndarray]:
    """Two contacts and as many chains as freedoms; towards where its Jacobian is singular."""
    for seed in range(40):
        raw = random_mechanism(np.random.default_rng(seed), contacts=2, chains=6)
        raw["chain"] = raw["chain"][:4]
        mechanism = parse(toml_text(raw))
        model = Model(mechanism, backend="numpy")
        unit = np.array([0.006 if name in "XYZ" else 0.25 for name in model.independent])
        way = np.random.default_rng(seed).normal(0, 1, 4) * unit

        def sign(part: float, model: Model = model, way: np.ndarray = way) -> float:
            J = model.jacobians(part * way[None])
            return np.linalg.slogdet(J.J_theta[0] @ J.M_J[0])[0]

        try:
            if {sign(0.05), sign(1.0)} != {-1.0, 1.0}:
                continue
        except condyle.InputError:  # out of reach
            continue
        low, high = 0.05, 1.0
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if sign(middle) == sign(low) else (low, middle)
        q = (low * (1 - 10.0 ** -np.arange(1, COUNT + 1)))[:, None] * way
        J = model.jacobians(q[-1:])
        if np.linalg.cond(J.J_theta[0] @ J.M_J[0]) > 1e10:  # and no stretched crank
            return mechanism, q
    raise AssertionError("no singularity found")


CASES = {"gough-stewart": near_stewart, "four chains": near_four_chains}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.usefixtures("compiler_command")
def test_near_singularities(case: str) -> None:
    mechanism, q = CASES[case]()
    rng = np.random.default_rng(0)
    unit = np.abs(q).max(axis=0) + 0.01
    q1, q2 = rng.normal(0, 1, (2, *q.shape)) * unit
    load = np.hstack([rng.normal(0, 5, (COUNT, 6)), rng.normal(0, 0.02, (COUNT, 3))])
    witness = Interpreter(mechanism)
    poses, _ = witness.poses(q, q1, q2)
    s = witness.system(poses, load)
    A, b, scale = s["A"], s["b"].sum(axis=2), witness._scale
    singular = np.linalg.svd(A / scale, compute_uv=False)
    condition = singular[:, 0] / singular[:, -1]
    assert condition.max() > 1e8 > 1e3 > condition.min()
    compiled, numpy = (Model(mechanism, backend=name) for name in ("compiled", "numpy"))
    found = {}
    for name, model in (("numpy", numpy), ("batch", compiled)):
        answer = model.inverse_dynamics(q, q1, q2, *parts(load))
        found[name] = answer.effort, answer.contact_force, answer.status
    values, status = ones(compiled.kernel("inverse", ("contact",)), np.hstack([q, q1, q2, load]))
    found["one"] = values["effort"].T, values["contact_force"].T, status
    for name in BACKENDS:
        effort, contact, status = found[name]
        good = status == Status.ok
        assert good[condition < 1e8].all(), (name, status)
        left = ((A.transpose(0, 2, 1) @ effort[..., None])[..., 0] - b) / scale
        size = np.abs(b / scale).max(axis=1)
        assert (np.abs(left).max(axis=1) < RESIDUAL * condition * size)[good].all(), name
        # The whole platform: inertia, joints and contacts leave nothing over.
        G, n_length = s["G"], s["n_length"]
        carried = (s["J"].transpose(0, 2, 1) @ effort[..., None])[..., 0]
        mu = np.divide(contact, n_length)
        over = s["Q"] - carried - (G @ mu[..., None])[..., 0]
        terms = np.maximum(np.abs(carried), np.abs(s["Q"])).max(axis=1)
        limit = RESIDUAL * np.maximum(terms, np.abs(s["Q"]).max(axis=1) * condition)
        assert (np.abs(over).max(axis=1) < limit)[good].all(), name


def test_no_effort_that_overflows_is_ok() -> None:
    model = Model(condyle.load_mechanism("masticatory"), backend="numpy")
    zero = np.zeros((3, 4))
    load = np.zeros((3, 9))
    load[1, 0] = 1e308
    load[1, 7] = 1e10
    with np.errstate(all="ignore"):
        found = model.inverse_dynamics(zero, zero, zero, *parts(load))
    assert found.status.tolist() == [Status.ok, Status.overflow, Status.ok]
    assert np.isnan(found.effort[1]).all() and np.isfinite(found.effort[[0, 2]]).all()
