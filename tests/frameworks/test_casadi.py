"""Models in CasADi: values against numpy's, Jacobians against differences."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import condyle
from condyle.errors import UnsupportedError

from .conftest import ARGUMENTS, RESULTS, numpy_answers, slopes, state

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("question", ARGUMENTS)
def test_values_and_jacobians(model, question):
    given, names = state(model), ARGUMENTS[question]
    function = getattr(model.to_casadi(), question)
    result = RESULTS[question]
    assert [function.name_in(i) for i in range(function.n_in())] == list(names)
    symbols = {name: ca.MX.sym(name, len(given[name])) for name in names}
    value = function(**symbols)[result]
    right = numpy_answers(model, question, names)(given)
    numbers = [given[name] for name in names]
    found = ca.Function("value", list(symbols.values()), [value])(*numbers)
    assert np.array(found).ravel() == pytest.approx(right, rel=1e-10, abs=1e-12)
    blocks = [ca.jacobian(value, symbols[name]) for name in names]
    found = ca.Function("slopes", list(symbols.values()), blocks)(*numbers)
    for name, block in zip(names, found, strict=True):
        expected = slopes(model, question, given, name)
        assert np.abs(np.array(block) - expected).max() <= 3e-8 * np.abs(expected).max(), name


def test_functions_outlive_model_and_garbage(compiler_command):
    import gc

    function = condyle.derive("masticatory", backend="compiled").to_casadi().inverse_dynamics
    gc.collect()
    found = function(q=[0, 0, 0, 0], v=[0, 0, 0, 0], a=[0, 0, 0, 0])["effort"]
    model = condyle.derive("masticatory", backend="numpy")
    rest = np.zeros(4)
    right = model.inverse_dynamics(rest, rest, rest).effort
    assert np.array(found).ravel() == pytest.approx(right, rel=1e-10)


def test_two_models_have_their_own_numbers(compiler_command):
    light = condyle.load_mechanism("masticatory")
    heavy = light.set({"platform.mass": 2 * light.platform.mass})
    rest = np.zeros(4)
    models = [condyle.derive(mechanism, backend="compiled") for mechanism in (light, heavy)]
    functions = [model.to_casadi().inverse_dynamics for model in models]
    for function, model in zip(functions, models, strict=True):
        right = model.inverse_dynamics(rest, rest, rest).effort
        found = np.array(function(q=rest, v=rest, a=rest)["effort"]).ravel()
        assert found == pytest.approx(right, rel=1e-10)


def test_no_silent_second_derivative(compiler_command):
    function = condyle.derive("masticatory", backend="compiled").to_casadi().inverse_dynamics
    q = ca.MX.sym("q", 4)
    value = function(q=q)["effort"]
    with pytest.raises(RuntimeError, match="Derivatives cannot be calculated"):
        ca.hessian(ca.sumsqr(value), q)


def test_unreachable_is_not_a_number(compiler_command):
    function = condyle.derive("masticatory", backend="compiled").to_casadi().inverse_dynamics
    assert np.isnan(np.array(function(q=[9, 0, 0, 0])["effort"])).all()


def test_refused(compiler_command):
    with pytest.raises(UnsupportedError, match="numpy"):
        condyle.derive("masticatory", backend="numpy").to_casadi()
    with pytest.raises(UnsupportedError, match="least norm"):
        condyle.derive("human-jaw", backend="compiled").to_casadi()
