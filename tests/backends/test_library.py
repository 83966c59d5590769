"""Surfaces written in Python may use every function of CasADi: kernels have C for all of them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from support.cases import Case, case, error, ones
from support.interpreter import Interpreter

import condyle
from condyle.graph.operations import BY_CASADI
from condyle.mechanism.surface import Expression
from condyle.model.model import Model
from condyle.status import Status

SIZE = 1e-5  # of what the functions add to a plane [m]


def functions(u: ca.SX, v: ca.SX) -> list[ca.SX]:
    """All of them, of u near -1 and v near 3, where none has a jump."""
    return [
        *(f(u) for f in (ca.exp, ca.expm1, ca.atan, ca.sinh, ca.cosh, ca.tanh, ca.asinh, ca.erf)),
        *(f(u / 3) for f in (ca.tan, ca.asin, ca.acos, ca.atanh, ca.log1p)),
        *(f(v) for f in (ca.log, ca.acosh)),
        *(f(u / 10) * u for f in (ca.floor, ca.ceil, ca.sign)),
        *(u * f(v, 2) for f in (ca.fmod, ca.remainder)),
        *(v**2.5, v**u, v**-3.0, ca.hypot(u, v), ca.copysign(v, u) * u),
        ca.if_else(ca.logic_and(u < 0, ca.logic_not(u == v)), u * u * u, v),
        ca.if_else(ca.logic_or(u > 0, u != v), u * v * u, u),
        ca.fmin(u, v) * ca.fmax(u, v) * ca.fabs(u) * ca.atan2(u, v),
    ]


def bumpy(p: ca.SX) -> ca.SX:
    u, v = 40 * p[0], 3.2 + 10 * (p[1] ** 2) + p[0]
    home = [-0.02665, 0.072, 0.04253]
    terms = ca.vertcat(*functions(u, v))
    weighted = ca.dot(terms, ca.SX(np.sqrt(np.arange(2, 2 + terms.numel()))))
    at_home = ca.evalf(ca.substitute(weighted, p, ca.DM(home)))
    return p[2] + 1.1 * p[0] - 0.013215 + SIZE * (weighted - at_home)


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
@pytest.mark.usefixtures("compiler_command")
def test_kernels_agree_with_casadi(backend: str) -> None:
    reference: Case = case("masticatory")
    mechanism = condyle.load_mechanism("masticatory")
    left, right = mechanism.contacts
    left = left.model_copy(update={"surface": Expression(bumpy)})
    mechanism = mechanism.replace(contacts=(left, right))
    wanted = Interpreter(mechanism).solve(*reference.packed)
    kernel = Model(mechanism, backend=backend).kernel("inverse", ())
    answer = kernel.run(reference.inputs)
    good = answer.status == Status.ok
    assert wanted.reached[good].all() and good.mean() > 0.5
    assert error(answer.values["effort"].T[good], wanted.effort[good]) < 1e-10
    if backend == "compiled":
        values, status = ones(kernel, reference.samples)
        np.testing.assert_array_equal(status, answer.status)
        assert error(values["effort"].T[good], wanted.effort[good]) < 1e-10
    plane = Interpreter(condyle.load_mechanism("masticatory")).solve(*reference.packed)
    assert error(plane.effort[good], wanted.effort[good]) > 1e-4  # the bumps matter


def test_no_function_is_left_out() -> None:
    """What CasADi has for two numbers or one, but for its own bookkeeping."""
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    f = ca.Function("f", [u, v], functions(u, v))
    used = {f.instruction_id(k) for k in range(f.n_instructions())}
    own = {ca.OP_SIN, ca.OP_COS, ca.OP_SQRT, ca.OP_NEG, ca.OP_SUB, ca.OP_LE}
    assert set(BY_CASADI) - used <= own
