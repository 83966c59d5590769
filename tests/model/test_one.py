"""One state by `unchecked`: what it takes and refuses, whose results are, threads, fallbacks."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from support.cases import case, error
from support.machines import model as shared

from condyle.backends.c.compiled_kernel import CompiledKernel, Single
from condyle.backends.kernel import AGAIN, KernelValues
from condyle.errors import InputError
from condyle.model.model import Model
from condyle.status import Status

pytestmark = pytest.mark.usefixtures("compiler_command")
MIXED = "mixed_k2_n8"  # its kernels have the chains in another order
questions = pytest.mark.parametrize("question", ["inverse", "forward"])
backends = pytest.mark.parametrize("backend", ["compiled", "numpy"])
# What is no sample of four numbers.
MISFITS = {
    "a number": lambda a: 0.0,
    "nothing": lambda a: None,
    "a text": lambda a: "1234",
    "too few": lambda a: a[:-1],
    "too many": lambda a: np.append(a, 0.0),
    "a row": lambda a: a[None],
    "a column": lambda a: a[:, None],
    "a list of words": lambda a: ["a"] * len(a),
    "a ragged list": lambda a: [[0.0, 0.0], *a.tolist()[1:]],
}


class Asked:
    """A question of a model, one sample at a time and many at once."""

    def __init__(self, name: str, question: str, backend: str, model: Model | None = None) -> None:
        c, self.model = case(name), model or shared(name, backend)
        self.forward = question == "forward"
        self.names = ("q", "v", "effort" if self.forward else "a", "wrench", "at")
        effort = np.random.default_rng(1).normal(size=(len(c.q), len(c.mechanism.chains)))
        q, v, a, *load = c.arguments
        self.given = (q, v, effort if self.forward else a, *load)
        self.sample = [a[-1] for a in self.given]
        self.one: Any = getattr(self.model.unchecked(), f"{question}_dynamics")

    def many(self, *given: np.ndarray) -> np.ndarray:
        if self.forward:
            return self.model.forward_dynamics(*given).acceleration
        return self.model.inverse_dynamics(*given).effort


@questions
@backends
def test_each_sample_is_that_of_the_batch_whatever_holds_it(question: str, backend: str) -> None:
    """And a result stays what it is, whoever asks next or writes into it."""
    asked = Asked(MIXED, question, backend)
    wanted = asked.many(*asked.given)
    assert np.isfinite(wanted).all()
    assert error([asked.one(*row) for row in zip(*asked.given, strict=True)], wanted) < 1e-11
    if backend == "compiled":
        order = asked.model.kernel("inverse", ()).order
        assert order != tuple(sorted(order))
    rounded = [a.astype(np.float32).astype(float) for a in asked.sample]
    frozen = [a.copy() for a in rounded]
    for a in frozen:
        a.flags.writeable = False
    forms: list[list[object]] = [
        [a.tolist() for a in rounded],
        [tuple(a) for a in rounded],
        [np.stack([a, a], axis=1)[:, 1] for a in rounded],
        [a[::-1].copy()[::-1] for a in rounded],
        [*frozen],
        [a.astype(">f8") for a in rounded],
        [a.astype(np.float32) for a in rounded],
        [a.astype(object) for a in rounded],
        [rounded[0], rounded[1].tolist(), *rounded[2:]],
    ]
    kept = (first := asked.one(*rounded)).copy()
    for form in forms:
        assert error(asked.one(*form), kept) < 1e-12
    whole = [np.zeros(len(a), dtype=int) for a in rounded]
    other = asked.one(*whole)
    assert error(other, asked.one(*(a.astype(float) for a in whole))) < 1e-12
    assert (other != kept).any()
    np.testing.assert_array_equal(first, kept)
    first[:] = 0.0
    np.testing.assert_array_equal(asked.one(*rounded), kept)


@questions
@backends
def test_what_does_not_fit_is_refused_and_what_has_no_answer_is_nan(
    question: str, backend: str
) -> None:
    asked = Asked("masticatory", question, backend)
    q, v, third, *load = asked.sample
    wanted = asked.one(*asked.sample)
    for misfit, spoil in MISFITS.items():
        for i, name in enumerate(asked.names):
            wrong: list[object] = [*asked.sample]
            wrong[i] = spoil(asked.sample[i])
            if wrong[i] is None and i > 2:  # no wrench, O_M
                assert np.isfinite(asked.one(*wrong)).all()
                continue
            expected = "expected" if (i, misfit) != (4, "a text") else "the mechanism has no point"
            with pytest.raises(InputError, match=rf"^{name}: {expected} "):
                asked.one(*wrong)
    name, size = asked.names[2], len(third)
    with pytest.raises(InputError, match=rf"{name}: .* \(\.\.\., {size}\): .*shape \(3,\)"):
        asked.one(q, v, np.zeros(3), *load)
    with pytest.raises(InputError, match=r"wrench: .*Fx, Fy, Fz.* got shape \(9,\)"):
        asked.one(q, v, third, np.zeros(9))
    # As many numbers as there are places, but not as many in each.
    with pytest.raises(InputError, match="q: expected"):
        asked.one(q[:-1], np.append(v, 0.0), third, *load)
    c, kernel = case("masticatory"), asked.model.kernel("inverse", ())
    with pytest.raises(InputError, match="moment: 3 samples, where others have 12"):
        kernel.run({**c.inputs, "moment": np.zeros((3, 3))})
    if backend == "compiled":
        with pytest.raises(InputError, match="has 21 numbers"):
            kernel.evaluate(c.samples[0, :-1])
    far = q + np.eye(4)[1]  # a metre
    for none in (asked.one(far, v, third, *load), asked.one(q, np.full(4, np.nan), third, *load)):
        assert none.shape == wanted.shape and np.isnan(none).all()
        none[:] = 0.0
    assert np.isnan(asked.one(far, v, third, *load)).all()
    np.testing.assert_array_equal(asked.one(*asked.sample), wanted)


@questions
def test_what_a_kernel_doubts_goes_the_robust_path(
    question: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the kernel says so: here of everything."""
    asked = Asked("masticatory", question, "compiled")
    wanted = asked.one(*asked.sample)
    run, single = CompiledKernel.run, CompiledKernel.single

    def doubting(kernel: CompiledKernel, *arguments: Any) -> KernelValues:
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
    own = Model(case("masticatory").mechanism, backend="compiled")
    again = Asked("masticatory", question, "compiled", own)
    assert error(again.one(*asked.sample), wanted) < 1e-9


@questions
def test_threads_do_not_meet(question: str) -> None:
    """Threads take turns as often as can be."""
    asked = Asked(MIXED, question, "compiled")
    rows, calls = list(zip(*asked.given, strict=True)), (asked.one, asked.many)
    wanted = [[f(*row) for f in calls] for row in rows]

    def ask(i: int) -> bool:
        pairs = list(zip(calls, wanted[i], strict=True))
        return all((f(*rows[i]) == found).all() for _ in range(300) for f, found in pairs)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert all(pool.map(ask, range(4)))
    finally:
        sys.setswitchinterval(before)


def test_another_choice_of_efforts_is_another_answer() -> None:
    """`with_distribution` keeps the kernels, but not what is bound to the least norm."""
    c, own = case("masticatory"), shared("masticatory", "compiled")
    sample = [a[-1] for a in c.arguments]
    least, other = own.unchecked().inverse_dynamics(*sample), own.with_distribution("minimax")
    wanted = other.inverse_dynamics(*(a[-1:] for a in c.arguments))
    assert wanted.status[0] == Status.ok
    assert error(other.unchecked().inverse_dynamics(*sample), wanted.effort[0]) < 1e-9
    assert error(least, wanted.effort[0]) > 1e-3
    for again in (own, other.with_distribution()):
        np.testing.assert_array_equal(again.unchecked().inverse_dynamics(*sample), least)
