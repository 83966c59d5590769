"""Samples that cannot be computed carry a status and leave the others alone."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize
from support.cases import Case, case, ones
from support.interpreter import Interpreter
from support.loads import parts, with_point
from support.speeds import few

from condyle.backends.kernel import AGAIN
from condyle.errors import InputError, UnreachableError
from condyle.model.model import Model
from condyle.model.model_result import ModelResult, require_ok
from condyle.status import Status

NAMES = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide")
COUNT = 250


@cache
def models(name: str) -> tuple[Model, Model]:
    """Compiled and numpy."""
    mechanism = case(name).mechanism
    return Model(mechanism, backend="compiled"), Model(mechanism, backend="numpy")


@cache
def far(name: str) -> Case:
    """States from home to far outside, most of them beyond reach or in doubt."""
    c, rng = case(name), np.random.default_rng(5)
    m = c.q.shape[1]
    names = models(name)[0].independent
    size = np.array([0.03 if n in "XYZ" else 0.8 for n in names])
    q = rng.uniform(-1, 1, (COUNT, m)) * size * 10 ** rng.uniform(-2, 0.5, (COUNT, 1))
    q1, q2 = rng.normal(0, 0.3, (COUNT, m)), rng.normal(0, 3, (COUNT, m))
    return Case(c.mechanism, q, q1, q2, with_point(rng.normal(0, 10, (COUNT, 6)), c.point))


def both(name: str, c: Case) -> tuple[ModelResult, ModelResult]:
    with np.errstate(all="ignore"):
        compiled, numpy = (
            model.inverse_dynamics(*c.arguments, outputs="all") for model in models(name)
        )
    return compiled, numpy


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("name", NAMES)
def test_status_and_numbers_are_those_of_numpy_and_of_the_witness(name: str) -> None:
    c = far(name)
    compiled, numpy = both(name, c)
    witness = Interpreter(c.mechanism, "momentum").solve(*c.packed)
    np.testing.assert_array_equal(compiled.status, numpy.status)
    np.testing.assert_array_equal(compiled.status != Status.unreachable, witness.reached)
    ok = compiled.status == Status.ok
    assert 0.1 < ok.mean() <= 1
    # Far away some are nearly singular, where digits are lost as the condition number says.
    loss = np.maximum(numpy.configuration.singularity.condition[ok], 1e3)
    for got, wanted in ((compiled, numpy), (compiled, witness), (numpy, witness)):
        off = np.abs(got.effort - wanted.effort)[ok].max(axis=1)
        assert (off < 1e-14 * loss * np.abs(wanted.effort[ok]).max(axis=1)).all()
    for model in models(name):
        np.testing.assert_array_equal(model.inverse_dynamics(*c.arguments).status, numpy.status)


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("name", ["rss_k2_n6_sphere", "mixed_k3_n9_curved"])
def test_what_newton_cannot_decide_is_decided_from_home(name: str) -> None:
    """A pose that Newton has not found must not count as one that chains cannot reach."""
    compiled, numpy = both(name, far(name))
    np.testing.assert_array_equal(compiled.status, numpy.status)


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("name", NAMES)
def test_others_keep_their_digits(name: str) -> None:
    """Bit for bit what they are in a batch of good samples."""
    good, bad = case(name).repeated(64), far(name)
    for model in models(name):
        alone = model.inverse_dynamics(*good.arguments, outputs="all")
        where = np.sort(np.random.default_rng(1).choice(64 + COUNT, 64, replace=False))
        mixed = []
        for ours, theirs in zip(good.arguments, bad.arguments, strict=True):
            mixed.append(np.insert(theirs, where - np.arange(64), ours, axis=0))
        got = model.inverse_dynamics(*mixed, outputs="all")
        assert got.status.any() or name == "gough-stewart"
        for key in ("effort", "contact_force", "joint_rate", "joint_acceleration", "pose"):
            np.testing.assert_array_equal(getattr(got, key)[where], getattr(alone, key))
        np.testing.assert_array_equal(got.share[where], alone.share)


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308, 1e160, 1e20])
@pytest.mark.parametrize(
    "name", few(["masticatory", "masticatory-curved", "gough-stewart"], "masticatory")
)
def test_what_is_no_number(name: str, value: float) -> None:
    """In q, q', q'' or the load: a status, no number, and no harm to the neighbours."""
    c, model = case(name), models(name)[0]
    clean = model.inverse_dynamics(*c.arguments, outputs="all")
    for which in range(4):
        spoiled = [a.copy() for a in c.arguments]
        spoiled[which][5, 1] = value
        with np.errstate(all="ignore"):
            got, wanted = (m.inverse_dynamics(*spoiled, outputs="all") for m in models(name))
            found = model.inverse_dynamics(*spoiled)
        rest = np.arange(len(c.q)) != 5
        np.testing.assert_array_equal(got.effort[rest], clean.effort[rest])
        np.testing.assert_array_equal(got.status, wanted.status)
        if not np.isfinite(value):
            wanted_status = {Status.overflow} if which else {Status.unreachable}
            if which == 0 and not c.mechanism.contacts:
                wanted_status.add(Status.singular)  # a leg may be as long as it likes
            assert got.status[5] in wanted_status
            np.testing.assert_array_equal(found.status, got.status)
            assert np.isnan(found.effort[5]).all()


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("name", ["masticatory", "hexaglide"])
def test_cause_of_failure_is_named_alike(name: str) -> None:
    """A chain that is too short is not taken for a contact that is off its surface."""
    q = np.zeros((5, case(name).q.shape[1]))
    q[:, 1] = np.linspace(0, 2, 5)
    said = []
    for model in models(name):
        with pytest.raises(UnreachableError) as failure:
            require_ok(model.mechanism, model.inverse_dynamics(q, q * 0, q * 0, outputs="all"))
        said.append((str(failure.value), failure.value.samples))
    assert said[0] == said[1]
    assert "cannot reach M" in said[0][0]


# -- next to singularities --------------------------------------------------------------------


@cache
def singular_pose(name: str) -> np.ndarray:
    """q at which the torques are not determined, in units of `reach`; found by descent."""
    model = models(name)[1]
    size = reach(name)

    def ratio(u: np.ndarray) -> float:
        q = (u * size)[None]
        poses, reached = model.poses.whole(q, 0 * q, 0 * q)
        found = model.poses.configuration(poses["pose"])
        if not reached[0] or (found.discriminant < 0).any():
            return 1.0
        return float(found.singularity.direct_ratio[0])

    rng = np.random.default_rng(0)
    options = {"maxiter": 400, "xatol": 1e-12, "fatol": 1e-16}
    starts = (rng.uniform(-1, 1, len(size)) for _ in range(12))
    for start in starts:
        found = minimize(ratio, start, method="Nelder-Mead", options=options)
        if found.fun < 1e-13:
            return found.x
    raise AssertionError("no singularity found")


def reach(name: str) -> np.ndarray:
    return np.array([0.02 if n in "XYZ" else 0.5 for n in models(name)[0].independent])


@pytest.mark.usefixtures("compiler_command")
@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide"])
def test_near_singularities(name: str) -> None:
    """n = m and n > m: as good as the condition allows, and the status of the interpreter."""
    c, size = case(name), reach(name)
    away = 10.0 ** -np.arange(2, 15)
    q = (singular_pose(name) + away[:, None] * np.cos(np.arange(len(size)))) * size
    q1, q2 = np.full(q.shape, 0.1) * size, np.full(q.shape, 1.0) * size
    load = with_point(np.full((len(q), 6), 5.0), c.point)
    near = Case(c.mechanism, q, q1, q2, load)
    compiled, numpy = both(name, near)
    np.testing.assert_array_equal(compiled.status, numpy.status)
    assert {Status.ok, Status.singular} <= set(compiled.status)
    condition = numpy.configuration.singularity.condition
    assert condition.max() > 1e12
    for model in models(name):  # what is singular has efforts of no meaning: they are not given
        found = model.inverse_dynamics(*near.arguments)
        np.testing.assert_array_equal(np.isfinite(found.effort).all(axis=1), found.status == 0)
        assert np.isnan(found.effort[found.status != Status.ok]).all()
    wanted = numpy.effort
    kernel = models(name)[0].kernel("inverse", ())
    answer = kernel.run(near.inputs)
    single, judged = ones(kernel, near.samples)
    doubtful = condition > 3e11  # singular from 1e12 on
    assert {AGAIN} == set(answer.status[doubtful]) == set(judged[doubtful])
    for values in (answer.values, single):
        off = np.abs(values["effort"].T - wanted).max(axis=1) / np.abs(wanted).max(axis=1)
        assert (off < 2e-15 * condition)[numpy.status == Status.ok].all()


# -- shapes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("backend", [0, 1], ids=["compiled", "numpy"])
@pytest.mark.usefixtures("compiler_command")
def test_any_number_of_samples(backend: int) -> None:
    """None, one, and all around multiples of the lane width."""
    name = "masticatory"
    c = case(name).repeated(70)
    kernel = models(name)[backend].kernel("inverse", ("contact",))
    whole = kernel.run(c.inputs)
    assert not whole.status.any()
    for count in (0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 31, 33, 63, 64, 65):
        part = kernel.run({key: a[:count] for key, a in c.inputs.items()})
        assert part.status.shape == (count,)
        for key, values in whole.values.items():
            np.testing.assert_array_equal(part.values[key], values[..., :count])


@pytest.mark.usefixtures("compiler_command")
def test_empty_batch() -> None:
    c = case("masticatory")
    compiled, numpy = models("masticatory")
    nothing = [a[:0] for a in c.arguments]
    got, wanted = (
        compiled.inverse_dynamics(*nothing, outputs="all"),
        numpy.inverse_dynamics(*nothing, outputs="all"),
    )
    for key in ("effort", "share", "contact_force", "joint_rate", "pose", "status"):
        assert getattr(got, key).shape == getattr(wanted, key).shape
    assert got.status.shape == (0,) and got.share.shape == (0, 4, 6)


def layouts(samples: np.ndarray) -> dict[str, Any]:
    """One array in every way that arrays can lie in memory."""
    count, columns = samples.shape
    wide = np.full((3 * count, 2 * columns), np.nan)
    wide[::3, ::2] = samples
    record = np.zeros(count, dtype=[("name", "S3"), ("numbers", "f8", (columns,))])
    record["numbers"] = samples
    offset = np.zeros(samples.nbytes + 4, dtype=np.uint8)[4:]
    unaligned = np.ndarray(samples.shape, float, buffer=offset)
    unaligned[:] = samples
    return {
        "columns": np.asfortranarray(samples),
        "strided": wide[::3, ::2],
        "backwards": samples[::-1].copy()[::-1],
        "columns backwards": samples[:, ::-1].copy()[:, ::-1],
        "record": record["numbers"],
        "unaligned": unaligned,
        "other byte order": samples.astype(">f8"),
        "list": samples.tolist(),
        "read-only": np.broadcast_to(samples, samples.shape),
    }


@pytest.mark.parametrize("backend", [0, 1], ids=["compiled", "numpy"])
@pytest.mark.usefixtures("compiler_command")
def test_memory_of_any_layout(backend: int) -> None:
    """Rows, columns, strides, backwards, repeated, single precision, records, lists."""
    c = case("masticatory").repeated(41)
    kernel = models("masticatory")[backend].kernel("inverse", ())

    def efforts(**changed: Any) -> np.ndarray:
        return kernel.run({**c.inputs, **changed}).values["effort"]

    wanted = efforts()
    for port, values in c.inputs.items():
        for name, given in layouts(values).items():
            np.testing.assert_array_equal(efforts(**{port: given}), wanted, err_msg=name)
    single = {port: a.astype(np.float32) for port, a in c.inputs.items()}
    double = {port: a.astype(float) for port, a in single.items()}
    np.testing.assert_array_equal(efforts(**single), efforts(**double))
    same = {port: np.broadcast_to(a[7], (20, a.shape[1])) for port, a in c.inputs.items()}
    np.testing.assert_array_equal(efforts(**same), wanted[:, [7] * 20])


@pytest.mark.parametrize("backend", [0, 1], ids=["compiled", "numpy"])
@pytest.mark.usefixtures("compiler_command")
def test_samples_of_the_wrong_size(backend: int) -> None:
    c = case("masticatory")
    kernel = models("masticatory")[backend].kernel("inverse", ())
    for given in (c.q[:, :-1], c.q[0], np.zeros((4, 0)), np.zeros((12, 4, 1))):
        with pytest.raises(InputError, match=r"q: expected an array of shape \(N, 4\), got"):
            kernel.run({**c.inputs, "q": given})
    with pytest.raises(InputError, match="moment: 3 samples, where others have 12"):
        kernel.run({**c.inputs, "moment": np.zeros((3, 3))})
    if backend == 0:
        with pytest.raises(InputError, match="has 21 numbers"):
            kernel.one(c.samples[0, :-1])
    with pytest.raises(InputError, match=r"at: expected numbers in an array of shape \(..., 3\)"):
        models("masticatory")[backend].inverse_dynamics(c.q, c.q1, c.q2, *parts(c.load[:, :6]))
