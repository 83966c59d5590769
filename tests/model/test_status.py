"""Samples that cannot be computed carry a status and leave the others alone."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import minimize

from condyle.errors import InputError, UnreachableError
from condyle.kernels.compiled import LOOK_AGAIN
from condyle.model import OK, SINGULAR_STATUS, UNREACHABLE, Evaluation, Model, with_point
from support.cases import Case, case, error

NAMES = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide")
COUNT = 250


@cache
def models(name: str) -> tuple[Model, Model]:
    """Compiled and interpreted."""
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


def both(name: str, c: Case) -> tuple[Evaluation, Evaluation]:
    with np.errstate(all="ignore"):
        compiled, interpreted = (model.evaluate(*c.arguments) for model in models(name))
    return compiled, interpreted


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", NAMES)
def test_status_is_the_interpreters(name: str) -> None:
    c = far(name)
    compiled, interpreted = both(name, c)
    np.testing.assert_array_equal(compiled.status, interpreted.status)
    np.testing.assert_array_equal(compiled.poses.reached, interpreted.poses.reached)
    ok = compiled.status == OK
    assert 0.1 < ok.mean() <= 1
    assert error(compiled.effort[ok], interpreted.effort[ok]) < 1e-10
    _, status = models(name)[0].torques(*c.arguments)
    np.testing.assert_array_equal(status, interpreted.status)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", ["rss_k2_n6_sphere", "mixed_k3_n9_curved"])
def test_what_newton_cannot_decide_is_decided_from_home(name: str) -> None:
    """A pose that Newton has not found must not count as one that chains cannot reach."""
    compiled, interpreted = both(name, far(name))
    np.testing.assert_array_equal(compiled.status, interpreted.status)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", NAMES)
def test_others_keep_their_digits(name: str) -> None:
    """Bit for bit what they are in a batch of good samples."""
    good, bad = case(name).repeated(64), far(name)
    model = models(name)[0]
    alone = model.kernel.solve(*good.arguments)
    where = np.sort(np.random.default_rng(1).choice(64 + COUNT, 64, replace=False))
    mixed = []
    for ours, theirs in zip(good.arguments, bad.arguments, strict=True):
        rows = np.insert(theirs, where - np.arange(64), ours, axis=0)
        mixed.append(rows)
    got = model.kernel.solve(*mixed)
    assert not got.reached.all() or name == "gough-stewart"
    for key in ("torque", "contact_force", "rate", "acceleration"):
        np.testing.assert_array_equal(getattr(got, key)[where], getattr(alone, key))
    np.testing.assert_array_equal(got.share[:, where], alone.share)
    np.testing.assert_array_equal(got.pose[where], alone.pose)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308, 1e160, 1e20])
@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved", "gough-stewart"])
def test_what_is_no_number(name: str, value: float) -> None:
    """In q, q', q'' or the load: a status, no number, and no harm to the neighbours."""
    c, model = case(name), models(name)[0]
    clean = model.evaluate(*c.arguments)
    for which in range(4):
        spoiled = [a.copy() for a in c.arguments]
        spoiled[which][5, 1] = value
        with np.errstate(all="ignore"):
            got, wanted = (m.evaluate(*spoiled) for m in models(name))
            found, status = model.torques(*spoiled)
        rest = np.arange(len(c.q)) != 5
        np.testing.assert_array_equal(got.effort[rest], clean.effort[rest])
        np.testing.assert_array_equal(got.status, wanted.status)
        if not np.isfinite(value):
            assert got.status[5] == (UNREACHABLE if wanted.status[5] == 1 else SINGULAR_STATUS)
            np.testing.assert_array_equal(status, got.status)
            assert np.isnan(found.torque[5]).all()
            if which == 0 and c.mechanism.contacts:
                assert got.status[5] == UNREACHABLE


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", ["masticatory", "hexaglide"])
def test_cause_of_failure_is_named_alike(name: str) -> None:
    """A chain that is too short is not taken for a contact that is off its surface."""
    q = np.zeros((5, case(name).q.shape[1]))
    q[:, 1] = np.linspace(0, 2, 5)
    said = []
    for model in models(name):
        with pytest.raises(UnreachableError) as failure:
            model.require_ok(model.evaluate(q, q * 0, q * 0, np.zeros((5, 9))))
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
        poses = model.kernel.poses(q, 0 * q, 0 * q)
        posture = model.configuration(poses.pose)
        if not poses.reached[0] or (posture.reach < 0).any():
            return 1.0
        return float(posture.singularity.direct_ratio[0])

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


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", ["gough-stewart", "hexaglide"])
def test_near_singularities(name: str) -> None:
    """n = m and n > m: as good as the condition allows, and the status of the interpreter."""
    c, size = case(name), reach(name)
    away = 10.0 ** -np.arange(2, 15)
    q = (singular_pose(name) + away[:, None] * np.cos(np.arange(len(size)))) * size
    q1, q2 = np.full(q.shape, 0.1) * size, np.full(q.shape, 1.0) * size
    load = with_point(np.full((len(q), 6), 5.0), c.point)
    near = Case(c.mechanism, q, q1, q2, load)
    compiled, interpreted = both(name, near)
    np.testing.assert_array_equal(compiled.status, interpreted.status)
    assert {OK, SINGULAR_STATUS} <= set(compiled.status)
    condition = interpreted.configuration.singularity.condition
    assert condition.max() > 1e12
    wanted = interpreted.effort
    kernel = models(name)[0].kernel.kernel(c.point, (), moment=True)
    found, status = kernel.run(near.samples)
    lanes = kernel.in_order(found["torque"])
    single = np.array([kernel.one(sample) for sample in near.samples])
    single = kernel.in_order(single[:, : lanes.shape[1]])
    assert (status[condition > 1e10] == LOOK_AGAIN).all()
    for got in (lanes, single):
        off = np.abs(got - wanted).max(axis=1) / np.abs(wanted).max(axis=1)
        assert (off < 2e-15 * condition).all()


# -- shapes -----------------------------------------------------------------------------------


def test_any_number_of_samples() -> None:
    """None, one, and all around multiples of the lane width."""
    name = "masticatory"
    c = case(name).repeated(70)
    kernel = models(name)[0].kernel.kernel(c.point, ("contact",), moment=True)
    whole, status = kernel.run(c.samples)
    assert not status.any()
    for count in (0, 1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 31, 33, 63, 64, 65):
        part, few = kernel.run(c.samples[:count])
        assert few.shape == (count,)
        for key, values in whole.items():
            np.testing.assert_array_equal(part[key], values[:count])


@pytest.mark.usefixtures("quick")
def test_empty_batch() -> None:
    c = case("masticatory")
    compiled, interpreted = models("masticatory")
    nothing = [a[:0] for a in c.arguments]
    got, wanted = compiled.evaluate(*nothing), interpreted.evaluate(*nothing)
    for key in ("torque", "share", "contact_force", "rate"):
        assert getattr(got.torques, key).shape == getattr(wanted.torques, key).shape
    assert got.status.shape == (0,)


def test_memory_of_any_layout() -> None:
    """Rows, columns, strides, backwards, repeated, single precision, records, lists."""
    c = case("masticatory").repeated(41)
    kernel = models("masticatory")[0].kernel.kernel(c.point, (), moment=True)
    samples = c.samples
    count, columns = samples.shape
    wanted = kernel.run(samples)[0]["torque"]
    wide = np.full((3 * count, 2 * columns), np.nan)
    wide[::3, ::2] = samples
    record = np.zeros(count, dtype=[("name", "S3"), ("numbers", "f8", (columns,))])
    record["numbers"] = samples
    offset = np.zeros(samples.nbytes + 4, dtype=np.uint8)[4:].view()
    unaligned = np.frombuffer(offset.data, dtype="V1").view(np.uint8)
    unaligned = np.ndarray(samples.shape, float, buffer=unaligned)
    unaligned[:] = samples
    layouts = {
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
    for name, given in layouts.items():
        np.testing.assert_array_equal(kernel.run(given)[0]["torque"], wanted, err_msg=name)
    single = samples.astype(np.float32)
    np.testing.assert_array_equal(
        kernel.run(single)[0]["torque"], kernel.run(single.astype(float))[0]["torque"]
    )
    same = np.broadcast_to(samples[7], (20, columns))
    np.testing.assert_array_equal(kernel.run(same)[0]["torque"], wanted[[7] * 20])


def test_samples_of_the_wrong_size() -> None:
    c = case("masticatory")
    kernel = models("masticatory")[0].kernel.kernel(c.point, (), moment=True)
    for given in (c.samples[:, :-1], c.samples[0], np.zeros((4, 0))):
        with pytest.raises(InputError, match="18 numbers"):
            kernel.run(given)
    with pytest.raises(InputError, match="18 numbers"):
        kernel.one(c.samples[0, :-1])
