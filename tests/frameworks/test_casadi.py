"""Models in CasADi: values against numpy's, Jacobians against differences."""

from __future__ import annotations

import gc

import casadi as ca
import numpy as np
import pytest
from support.machines import model

import condyle
from condyle.errors import UnsupportedError

from .conftest import ARGUMENTS, RESULTS, answer, arguments, check_slopes, slopes, state

pytestmark = pytest.mark.usefixtures("compiler_command")
REST = np.zeros(4)


def test_values_and_jacobians():
    name = "masticatory"
    given, functions = state(name), model(name, "compiled").to_casadi()
    for question, names in ARGUMENTS.items():
        function, result = getattr(functions, question), RESULTS[question]
        assert [function.name_in(i) for i in range(function.n_in())] == list(names)
        symbols = {own: ca.MX.sym(own, len(given[own])) for own in names}
        value = function(**symbols)[result]
        blocks = [ca.jacobian(value, symbols[own]) for own in names]
        both = ca.Function("both", list(symbols.values()), [value, *blocks])
        got, *found = map(np.array, both(*arguments(question, given)))
        right = getattr(answer(name, question, given), result)
        assert got.ravel() == pytest.approx(right, rel=1e-10, abs=1e-12)
        check_slopes(found, slopes(name, question))


def test_functions_have_the_numbers_of_their_model_and_outlive_it():
    light = condyle.load_mechanism("masticatory")
    heavy = light.set({"platform.mass": 2 * light.platform.mass})
    functions = [
        condyle.derive(machine, backend="compiled").to_casadi().inverse_dynamics
        for machine in (light, heavy)
    ]
    gc.collect()
    for function, machine in zip(functions, (light, heavy), strict=True):
        right = condyle.derive(machine, backend="numpy").inverse_dynamics(REST, REST, REST).effort
        found = np.array(function(q=REST, v=REST, a=REST)["effort"]).ravel()
        assert found == pytest.approx(right, rel=1e-10)


def test_what_there_is_not():
    """A second derivative, a number where nothing can be reached, least norm within limits."""
    function = model("masticatory", "compiled").to_casadi().inverse_dynamics
    q = ca.MX.sym("q", 4)
    with pytest.raises(RuntimeError, match="Derivatives cannot be calculated"):
        ca.hessian(ca.sumsqr(function(q=q)["effort"]), q)
    assert np.isnan(np.array(function(q=[9, 0, 0, 0])["effort"])).all()
    for name, backend, said in (
        ("masticatory", "numpy", "numpy"),
        ("human-jaw", "compiled", "least norm"),
    ):
        with pytest.raises(UnsupportedError, match=said):
            model(name, backend).to_casadi()
