"""One state by `unchecked`: what it takes and refuses, whose results are, threads, fallbacks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from support.cases import case, error

from condyle.backends.c.compiled_kernel import CompiledKernel, Single
from condyle.backends.kernel import AGAIN, Answer
from condyle.errors import InputError
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.usefixtures("compiler_command")
MIXED = "mixed_k2_n8"  # its kernels have the chains in another order
QUESTIONS = ("inverse", "forward")
BACKENDS = ("compiled", "numpy")
Arrays = tuple[np.ndarray, ...]
# What is no sample of four numbers.
MISFITS = {
    "a number": lambda a: 0.0,
    "nothing": lambda a: None,
    "a text": lambda a: "1234",
    "one number": lambda a: a[:1],
    "too few": lambda a: a[:-1],
    "too many": lambda a: np.append(a, 0.0),
    "a row": lambda a: a[None],
    "a column": lambda a: a[:, None],
    "a list of words": lambda a: ["a"] * len(a),
    "a ragged list": lambda a: [[0.0, 0.0], *a.tolist()[1:]],
    "a short list": lambda a: a.tolist()[1:],
}


class Asked:
    """A question of a model, one sample at a time and many at once."""

    def __init__(self, name: str, question: str, backend: str) -> None:
        c = case(name)
        self.model = Model(c.mechanism, backend=backend)
        self.names = ("q", "v", "a" if question == "inverse" else "effort", "wrench", "at")
        effort = np.random.default_rng(1).normal(size=(len(c.q), len(c.mechanism.chains)))
        q, v, a, *load = c.arguments
        self.given: Arrays = (q, v, a if question == "inverse" else effort, *load)
        self.one: Callable[..., np.ndarray] = getattr(
            self.model.unchecked(), f"{question}_dynamics"
        )
        self.forward = question == "forward"

    def many(self, *given: np.ndarray) -> np.ndarray:
        if self.forward:
            return self.model.forward_dynamics(*given).acceleration
        return self.model.inverse_dynamics(*given).effort

    @property
    def kernel(self) -> CompiledKernel:
        details = ("forward", ("contact",)) if self.forward else ("inverse", ())
        kernel = self.model.kernel(*details)
        assert isinstance(kernel, CompiledKernel)
        return kernel

    @property
    def sample(self) -> list[np.ndarray]:
        return [a[-1] for a in self.given]


@pytest.fixture(params=QUESTIONS)
def compiled(request: pytest.FixtureRequest, compiler_command: object) -> Asked:
    return Asked(MIXED, request.param, "compiled")


@pytest.mark.parametrize("name", ["masticatory", MIXED])
@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize("backend", BACKENDS)
def test_each_sample_is_that_of_the_batch(name: str, question: str, backend: str) -> None:
    asked = Asked(name, question, backend)
    wanted = asked.many(*asked.given)
    assert np.isfinite(wanted).all()
    assert error([asked.one(*row) for row in zip(*asked.given, strict=True)], wanted) < 1e-11
    if backend == "compiled":
        order = asked.kernel.order
        assert (order == tuple(sorted(order))) == (name != MIXED)


def test_a_result_stays_what_it_is(compiled: Asked) -> None:
    first = compiled.one(*compiled.sample)
    kept = first.copy()
    second = compiled.one(*(a[0] for a in compiled.given))
    assert (first != second).any()
    np.testing.assert_array_equal(first, kept)
    first[:] = 0.0
    np.testing.assert_array_equal(compiled.one(*compiled.sample), kept)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("question", QUESTIONS)
def test_whatever_holds_the_numbers(question: str, backend: str) -> None:
    """Lists, columns of other arrays, read-only ones, swapped bytes, single precision."""
    asked = Asked(MIXED, question, backend)
    rounded = [a.astype(np.float32).astype(float) for a in asked.sample]
    wanted = asked.one(*rounded)
    frozen = [a.copy() for a in rounded]
    for a in frozen:
        a.flags.writeable = False
    forms: dict[str, list[object]] = {
        "lists": [a.tolist() for a in rounded],
        "tuples": [tuple(a) for a in rounded],
        "columns": [np.stack([a, a], axis=1)[:, 1] for a in rounded],
        "backwards": [a[::-1].copy()[::-1] for a in rounded],
        "read-only": [*frozen],
        "swapped": [a.astype(">f8") for a in rounded],
        "single": [a.astype(np.float32) for a in rounded],
        "objects": [a.astype(object) for a in rounded],
        "one list": [rounded[0], rounded[1].tolist(), *rounded[2:]],
    }
    for name, form in forms.items():
        assert error(asked.one(*form), wanted) < 1e-12, name
    whole = [np.zeros(len(a), dtype=int) for a in rounded]
    assert error(asked.one(*whole), asked.one(*(a.astype(float) for a in whole))) < 1e-12


@pytest.mark.parametrize("misfit", MISFITS)
@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("question", QUESTIONS)
def test_what_does_not_fit_is_refused(question: str, backend: str, misfit: str) -> None:
    asked = Asked("masticatory", question, backend)
    wanted = asked.one(*asked.sample)
    for i, name in enumerate(asked.names):
        wrong: list[object] = [*asked.sample]
        wrong[i] = MISFITS[misfit](asked.sample[i])
        if wrong[i] is None and i > 2:  # no wrench, O_M
            assert np.isfinite(asked.one(*wrong)).all()
            continue
        expected = "expected" if (i, misfit) != (4, "a text") else "the mechanism has no point"
        with pytest.raises(InputError, match=rf"^{name}: {expected} "):
            asked.one(*wrong)
    np.testing.assert_array_equal(asked.one(*asked.sample), wanted)


def test_what_is_wrong_is_said(compiled: Asked) -> None:
    q, v, third, *load = compiled.sample
    name, size = compiled.names[2], len(third)
    with pytest.raises(InputError, match=rf"{name}: .* \(\.\.\., {size}\): .*shape \(3,\)"):
        compiled.one(q, v, np.zeros(3), *load)
    with pytest.raises(InputError, match=r"wrench: .*Fx, Fy, Fz.* got shape \(9,\)"):
        compiled.one(q, v, third, np.zeros(9))
    # As many numbers as there are places, but not as many in each.
    with pytest.raises(InputError, match="q: expected"):
        compiled.one(q[:-1], np.append(v, 0.0), third, *load)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("question", QUESTIONS)
def test_no_number_where_there_is_no_answer(question: str, backend: str) -> None:
    asked = Asked("masticatory", question, backend)
    q, *rest = asked.sample
    far = q + np.eye(4)[1]  # a metre
    none = asked.one(far, *rest)
    overflow = asked.one(q, np.full(4, np.nan), *rest[1:])
    wanted = asked.one(q, *rest)
    assert np.isfinite(wanted).all()
    for got in (none, overflow):
        assert got.shape == wanted.shape and np.isnan(got).all()
    none[:] = 0.0
    assert np.isnan(asked.one(far, *rest)).all()


@pytest.mark.parametrize("question", QUESTIONS)
def test_what_a_kernel_doubts_goes_the_robust_path(
    question: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the kernel says so: here of everything."""
    asked = Asked("masticatory", question, "compiled")
    wanted = asked.one(*asked.sample)
    run, single = CompiledKernel.run, CompiledKernel.single

    def doubting(kernel: CompiledKernel, *arguments: Any) -> Answer:
        answer = run(kernel, *arguments)
        answer.status[:] = AGAIN
        for value in answer.values.values():
            value[:] = np.nan
        return answer

    def doubting_single(kernel: CompiledKernel) -> Single:
        found = single(kernel)
        found.run = lambda: AGAIN
        return found

    monkeypatch.setattr(CompiledKernel, "run", doubting)
    monkeypatch.setattr(CompiledKernel, "single", doubting_single)
    again = Asked("masticatory", question, "compiled")
    assert error(again.one(*asked.sample), wanted) < 1e-9


@pytest.fixture
def restless() -> Iterator[None]:
    """Threads take turns as often as can be."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.usefixtures("restless")
def test_threads_do_not_meet(compiled: Asked) -> None:
    rows = list(zip(*compiled.given, strict=True))
    calls = (compiled.one, compiled.many)
    wanted = [[f(*row) for f in calls] for row in rows]

    def ask(i: int) -> bool:
        pairs = list(zip(calls, wanted[i], strict=True))
        return all((f(*rows[i]) == found).all() for _ in range(1500) for f, found in pairs)

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(ask, range(4)))


def test_another_choice_of_efforts_is_another_answer() -> None:
    """`with_distribution` keeps the kernels, but not what is bound to the least norm."""
    c = case("masticatory")
    model = Model(c.mechanism, backend="compiled")
    sample = [a[-1] for a in c.arguments]
    least = model.unchecked().inverse_dynamics(*sample)
    other = model.with_distribution("minimax")
    wanted = other.inverse_dynamics(*(a[-1:] for a in c.arguments))
    assert wanted.status[0] == Status.ok
    assert error(other.unchecked().inverse_dynamics(*sample), wanted.effort[0]) < 1e-9
    assert error(least, wanted.effort[0]) > 1e-3
    np.testing.assert_array_equal(model.unchecked().inverse_dynamics(*sample), least)
    np.testing.assert_array_equal(
        other.with_distribution().unchecked().inverse_dynamics(*sample), least
    )
