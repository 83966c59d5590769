"""Samples that cannot be computed carry a status and leave the others alone; singularities."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.cases import Case, case, ones
from support.interpreter import Interpreter
from support.loads import parts, with_point
from support.machines import model as shared
from support.speeds import first

from condyle.backends.kernel import AGAIN
from condyle.errors import UnreachableError
from condyle.kinematics.causes import require_ok
from condyle.mechanism import Mechanism, parse
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.usefixtures("compiler_command")
COUNT = 120
KEYS = ("effort", "contact_force", "joint_rate", "pose", "share")


@cache
def far(name: str) -> Case:
    """States from home to far outside, most of them beyond reach or in doubt."""
    c, rng = case(name), np.random.default_rng(5)
    m = c.q.shape[1]
    size = np.array([0.03 if n in "XYZ" else 0.8 for n in shared(name).independent])
    q = rng.uniform(-1, 1, (COUNT, m)) * size * 10 ** rng.uniform(-2, 0.5, (COUNT, 1))
    q1, q2 = rng.normal(0, 0.3, (COUNT, m)), rng.normal(0, 3, (COUNT, m))
    return Case(c.mechanism, q, q1, q2, with_point(rng.normal(0, 10, (COUNT, 6)), c.point))


FAR = [
    ("masticatory", "compiled"),
    ("gough-stewart", "compiled"),
    ("masticatory-curved", "numpy"),
    ("masticatory-curved", "compiled"),
    ("hexaglide", "compiled"),
]


@pytest.mark.parametrize(("name", "backend"), first(FAR, 3))
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_status_and_numbers_are_those_of_the_witness(name: str, backend: str) -> None:
    """And of numpy; good samples keep their digits among bad ones, bit for bit."""
    c, model = far(name), shared(name, backend)
    found, numpy = (m.inverse_dynamics(*c.arguments, outputs="all") for m in (model, shared(name)))
    witness = Interpreter(c.mechanism, "momentum").solve(*c.packed)
    np.testing.assert_array_equal(found.status, numpy.status)
    np.testing.assert_array_equal(found.status != Status.unreachable, witness.reached)
    ok = found.status == Status.ok
    assert 0.1 < ok.mean() <= 1
    # Far away some are nearly singular, where digits are lost as the condition number says.
    loss = np.maximum(numpy.configuration.singularity.condition[ok], 1e3)
    for wanted in (numpy, witness):
        off = np.abs(found.effort - wanted.effort)[ok].max(axis=1)
        assert (off < 1e-14 * loss * np.abs(wanted.effort[ok]).max(axis=1)).all()
    good = case(name).repeated(32)
    where = np.sort(np.random.default_rng(1).choice(32 + COUNT, 32, replace=False))
    mixed = [
        np.insert(theirs, where - np.arange(32), ours, axis=0)
        for ours, theirs in zip(good.arguments, c.arguments, strict=True)
    ]
    alone, got = (model.inverse_dynamics(*x, outputs="all") for x in (good.arguments, mixed))
    assert got.status.any() or name == "gough-stewart"
    for key in (*KEYS, "joint_acceleration"):
        np.testing.assert_array_equal(getattr(got, key)[where], getattr(alone, key))


def test_what_newton_cannot_decide_is_decided_from_home() -> None:
    """A pose that Newton has not found must not count as one that chains cannot reach."""
    c = far("rss_k2_n6_sphere")
    status = shared("rss_k2_n6_sphere").inverse_dynamics(*c.arguments).status
    reached = Interpreter(c.mechanism).solve(*c.packed).reached
    np.testing.assert_array_equal(status != Status.unreachable, reached)


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_what_is_no_number() -> None:
    """In q, q', q'' or the load: a status, no number, and no harm to the neighbours."""
    c, rest = case("masticatory"), np.arange(12) != 5
    compiled, numpy = shared("masticatory", "compiled"), shared("masticatory")
    clean = compiled.inverse_dynamics(*c.arguments)
    for value, which in product([np.nan, np.inf, -np.inf, 1e308, 1e160, 1e20], range(4)):
        spoiled = [a.copy() for a in c.arguments]
        spoiled[which][5, 1] = value
        got, wanted = (m.inverse_dynamics(*spoiled) for m in (compiled, numpy))
        np.testing.assert_array_equal(got.effort[rest], clean.effort[rest])
        np.testing.assert_array_equal(got.status, wanted.status)
        if not np.isfinite(value):
            assert got.status[5] == (Status.overflow if which else Status.unreachable)
            assert np.isnan(got.effort[5]).all()
    # A leg may be as long as it likes, and a force and its lever overflow together.
    legs = shared("gough-stewart")
    found = legs.inverse_dynamics(np.full(6, np.inf), np.zeros(6), np.zeros(6))
    assert found.status in (Status.unreachable, Status.singular) and np.isnan(found.effort).all()
    zero, load = np.zeros((3, 4)), np.zeros((3, 9))
    load[1, 0], load[1, 7] = 1e308, 1e10
    found = numpy.inverse_dynamics(zero, zero, zero, *parts(load))
    assert found.status.tolist() == [Status.ok, Status.overflow, Status.ok]
    assert np.isnan(found.effort[1]).all() and np.isfinite(found.effort[[0, 2]]).all()


def test_cause_of_failure_is_named_alike() -> None:
    """A chain that is too short is not taken for a contact that is off its surface."""
    for name, also in (("masticatory", ["compiled"]), ("hexaglide", [])):
        q, said = np.zeros((5, case(name).q.shape[1])), set()
        q[:, 1] = np.linspace(0, 2, 5)
        for model in (shared(name, *b) for b in ([], also)):
            with pytest.raises(UnreachableError, match="cannot reach M") as failure:
                require_ok(model.mechanism, model.inverse_dynamics(q, q * 0, q * 0, outputs="all"))
            said.add((str(failure.value), tuple(failure.value.samples)))
        assert len(said) == 1


def towards(singular: Callable[[float], np.ndarray], low: float, high: float) -> np.ndarray:
    """Numbers that approach where a matrix is singular, by tenths; from its sign."""
    start, found = np.linalg.slogdet(singular(low))[0], low
    assert np.linalg.slogdet(singular(high))[0] == -start
    for _ in range(60):
        middle = (found + high) / 2
        same = np.linalg.slogdet(singular(middle))[0] == start
        found, high = (middle, high) if same else (found, middle)
    return found - (found - low) * 10.0 ** -np.arange(1, 14)


def near_stewart() -> tuple[Mechanism, np.ndarray]:
    """A platform a quarter turn about Z is singular; off centre."""
    model, q = shared("gough-stewart"), np.array([0.01, -0.02, 0.015, 0.02, -0.03])
    turns = towards(
        lambda g: model.jacobians(np.r_[q, g]).J_theta, np.pi / 2 - 0.4, np.pi / 2 + 0.4
    )
    return model.mechanism, np.array([[*q, turn] for turn in turns])


def near_four_chains() -> tuple[Mechanism, np.ndarray]:
    """Two contacts and as many chains as freedoms, none of them stretched."""
    raw = random_mechanism(np.random.default_rng(9), contacts=2, chains=6)
    raw["chain"] = raw["chain"][:4]
    mechanism = parse(toml_text(raw))
    model = Model(mechanism, backend="numpy")
    unit = np.array([0.006 if name in "XYZ" else 0.25 for name in model.independent])
    way = np.random.default_rng(9).normal(0, 1, 4) * unit

    def jacobian(part: float) -> np.ndarray:
        J = model.jacobians(part * way)
        return J.J_theta @ J.M_J

    return mechanism, towards(jacobian, 0.05, 1.0)[:, None] * way


def near_hexaglide() -> tuple[Mechanism, np.ndarray]:
    """More chains than freedoms: where two singular values would have to vanish, none changes its
    sign. The pose was found by descent of `singularity.direct_ratio`."""
    model = shared("hexaglide")
    unit = np.array([0.02 if name in "XYZ" else 0.5 for name in model.independent])
    singular = [
        3.134460122014727,
        -2.4153596724559145,
        0.4734810109038131,
        0.9442626167986378,
        1.3412324533088613,
    ]
    away = 10.0 ** -np.arange(2, 15)[:, None] * np.cos(np.arange(5))
    return model.mechanism, (singular + away) * unit


NEAR = [(near_stewart, "compiled"), (near_four_chains, "numpy"), (near_hexaglide, "numpy")]


@pytest.mark.parametrize(
    ("near", "backend"), [*NEAR, pytest.param(near_four_chains, "compiled", marks=pytest.mark.ci)]
)
def test_near_singularities(near: Callable[[], tuple[Mechanism, np.ndarray]], backend: str) -> None:
    """The residuals of A^T tau = b and of the platform's balance are as small as rounding makes
    them at this condition, every way; what is singular has no efforts."""
    mechanism, q = near()
    rng, count = np.random.default_rng(0), len(q)
    q1, q2 = rng.normal(0, 1, (2, *q.shape)) * (np.abs(q).max(axis=0) + 0.01)
    load = np.hstack([rng.normal(0, 5, (count, 6)), rng.normal(0, 0.02, (count, 3))])
    given = Case(mechanism, q, q1, q2, load)
    witness = Interpreter(mechanism)
    s = witness.system(witness.poses(q, q1, q2)[0], load)
    A, b, scale = s["A"], s["b"].sum(axis=2), witness._scale
    singular = np.linalg.svd(A / scale, compute_uv=False)
    condition = singular[:, 0] / singular[:, -1]
    assert condition.max() > 1e12 and condition.min() < 1e4
    model = Model(mechanism, backend=backend)
    kernel = model.kernel("inverse", ("contact",))
    found, numpy = (
        m.inverse_dynamics(*given.arguments) for m in (model, Model(mechanism, backend="numpy"))
    )
    assert {Status.ok, Status.singular} <= set(found.status)
    np.testing.assert_array_equal(found.status, numpy.status)
    lost = np.isnan(found.effort).all(axis=1)
    np.testing.assert_array_equal(lost, found.status != Status.ok)
    if backend == "compiled":
        values, judged = ones(kernel, given.samples)
    else:
        answer = kernel.run(given.inputs)
        values, judged = answer.values, answer.status
    assert set(judged[condition > 1e13]) == {AGAIN} and not judged[condition < 1e8].any()
    alone = values["effort"].T, values["contact_force"].T, judged
    for effort, contact, status in (alone, (found.effort, found.contact_force, found.status)):
        good = status == Status.ok
        assert good[condition < 1e8].all()
        left = ((A.transpose(0, 2, 1) @ effort[..., None])[..., 0] - b) / scale
        size = np.abs(b / scale).max(axis=1)
        assert (np.abs(left).max(axis=1) < 1e-12 * condition * size)[good].all()
        # The whole platform: inertia, joints and contacts leave nothing over.
        carried = (s["J"].transpose(0, 2, 1) @ effort[..., None])[..., 0]
        over = s["Q"] - carried - (s["G"] @ (contact / s["n_length"])[..., None])[..., 0]
        terms = np.maximum(np.abs(carried), np.abs(s["Q"])).max(axis=1)
        limit = 1e-12 * np.maximum(terms, np.abs(s["Q"]).max(axis=1) * condition)
        assert (np.abs(over).max(axis=1) < limit)[good].all()
