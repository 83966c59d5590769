"""Models in JAX: values of both methods against numpy's, derivatives against differences."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.mechanism.files import from_data

from .conftest import ARGUMENTS, RESULTS, differences, slopes, state

jax = pytest.importorskip("jax")
pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def doubles():
    jax.config.update("jax_enable_x64", True)


@pytest.mark.parametrize("method", ["kernel", "graph"])
@pytest.mark.parametrize("question", ARGUMENTS)
def test_values(model, method, question):
    given = state(model, count=30)
    given["q"][3] = 9.0  # out of reach
    function = jax.jit(getattr(model.to_jax(method), question))
    arguments = [given[name] for name in ARGUMENTS[question]]
    found = function(*arguments)
    plain = condyle.derive(model.mechanism, backend="numpy")
    expected = getattr(plain, question)(*arguments)
    good = np.asarray(found["status"]) == 0
    assert (good == (expected.status == 0)).all()
    assert not (good[3] and model.mechanism.contacts)
    for name in (RESULTS[question], "contact_force"):
        value, right = np.asarray(found[name]), getattr(expected, name)
        assert value.shape == right.shape and np.isnan(value[~good]).all()
        largest = np.abs(right[good]).max(initial=0.0)
        assert np.abs(value[good] - right[good]).max(initial=0.0) <= 1e-11 * largest, name


@pytest.mark.parametrize("question", ARGUMENTS)
def test_derivatives(model, question):
    given, result = state(model), RESULTS[question]
    names = ARGUMENTS[question]
    for method, ways in (("kernel", (jax.jacfwd, jax.jacrev)), ("graph", (jax.jacfwd,))):
        function = getattr(model.to_jax(method), question)

        def first(*x, function=function):
            return function(*x)[result]

        wanted = range(len(names))
        both = [way(first, argnums=wanted)(*(given[n] for n in names)) for way in ways]
        for i, name in enumerate(names):
            right = slopes(model, question, given, name)
            for found in both:
                error = np.abs(np.asarray(found[i]) - right).max()
                assert error <= 3e-8 * np.abs(right).max(), (method, name)


def test_jit_of_vmap_of_grad(model):
    given, dynamics = state(model, count=4), model.to_jax()

    def cost(q, v):
        return (dynamics.inverse_dynamics(q, v, v * 0)["effort"] ** 2).sum()

    many = jax.jit(jax.vmap(jax.grad(cost, argnums=(0, 1))))(given["q"], given["v"])
    one = jax.grad(cost, argnums=(0, 1))(given["q"][2], given["v"][2])
    for a, b in zip(many, one, strict=True):
        assert np.asarray(a)[2] == pytest.approx(np.asarray(b), rel=1e-9, abs=1e-12)


def test_two_models_in_one_function(compiler_command):
    light = condyle.load_mechanism("masticatory")
    heavy = light.set({"platform.mass": 2 * light.platform.mass})
    models = [condyle.derive(mechanism, backend="compiled") for mechanism in (light, heavy)]
    given = state(models[0])
    functions = [model.to_jax().inverse_dynamics for model in models]
    both = jax.jit(lambda q, v, a: [f(q, v, a)["effort"] for f in functions])
    found = both(*(given[name] for name in "qva"))
    for value, model in zip(found, models, strict=True):
        right = model.inverse_dynamics(*(given[name] for name in "qva")).effort
        assert np.asarray(value) == pytest.approx(right, rel=1e-12)


@pytest.mark.parametrize("method", ["kernel", "graph"])
def test_numbers_of_the_file(model, method):
    machine, given = model.mechanism, state(model)
    names = ARGUMENTS["inverse_dynamics"][:3]
    paths = ["platform.mass", f"chain.{machine.chain_names[1]}.base"]
    paths += [f"contact.{machine.contact_names[0]}.point"] if machine.contacts else []
    function = model.to_jax(method, numbers=[*paths, "chain.*.actuator.viscous"]).inverse_dynamics
    state_ = [given[name] for name in names]

    def right(changes):
        other = condyle.derive(machine.set(changes, keep="home"), backend="numpy")
        return other.inverse_dynamics(*state_).effort

    changes = {paths[0]: 0.3, paths[1]: np.array(machine.get(paths[1])) + 1e-4}
    for own in ({}, changes):
        found = np.asarray(function(*state_, numbers=own)["effort"])
        assert found == pytest.approx(right(own), rel=1e-9, abs=1e-12)
    nominal = {path: np.array(machine.get(path), dtype=float) for path in paths}
    nominal["chain.*.actuator.viscous"] = np.zeros(len(machine.chains))

    def effort(numbers):
        return function(*state_, numbers=numbers)["effort"]

    by = {name: way(effort)(nominal) for name, way in (("f", jax.jacfwd), ("r", jax.jacrev))}
    for path in paths:
        base = np.atleast_1d(nominal[path])
        h = 1e-4 * max(np.abs(base).max(), 0.01)

        def moved(x, path=path):
            return right({path: x.tolist() if x.size > 1 else float(x[0])})

        expected = differences(moved, base, h).reshape(by["f"][path].shape)
        for found in by.values():
            error = np.abs(np.asarray(found[path]) - expected).max()
            assert error <= 1e-8 * np.abs(expected).max(), path
    if machine.name == "gough-stewart":  # not redundant: what rubs is its own actuator's
        joint_rate = model.inverse_dynamics(*state_, outputs="joint_rate").joint_rate
        viscous = np.asarray(by["r"]["chain.*.actuator.viscous"])
        assert viscous == pytest.approx(np.diag(joint_rate), rel=1e-9, abs=1e-12)
    with pytest.raises(InputError, match=r"expected some of .*; got gravity"):
        function(*state_, numbers={"gravity": np.zeros(3)})
    with pytest.raises(InputError, match=r"expected an array of shape \(\.\.\., 3\)"):
        function(*state_, numbers={paths[1]: 1.0})
    with pytest.raises(InputError, match="name them first"):
        model.to_jax(method).inverse_dynamics(*state_, numbers={"platform.mass": 1.0})


def test_numbers_of_chains_of_all_families_in_any_order(compiler_command):
    rng = np.random.default_rng(3)
    raw = random_mechanism(rng, families=("RSS", "PSS", "SPS"), chains=7, contacts=2)
    machine = from_data(raw)
    model = condyle.derive(machine, backend="compiled")
    bases = np.array([chain.base for chain in machine.chains]) + rng.normal(0, 1e-4, (7, 3))
    names = machine.chain_names
    other = machine.set({f"chain.{n}.base": b.tolist() for n, b in zip(names, bases, strict=True)})
    q, v, a = (rng.normal(0, size, 4) for size in (0.001, 0.1, 1.0))
    right = condyle.derive(other, backend="numpy").inverse_dynamics(q, v, a).effort
    for method in ("kernel", "graph"):
        function = model.to_jax(method, numbers="chain.*.base").inverse_dynamics
        found = np.asarray(function(q, v, a, numbers={"chain.*.base": bases})["effort"])
        assert found == pytest.approx(right, rel=1e-9, abs=1e-12)


def test_refused(model):
    function = model.to_jax().inverse_dynamics
    given = state(model)
    with pytest.raises(InputError, match=r"q: expected an array of shape \(\.\.\., \d\)"):
        function(np.zeros(2), given["v"], given["a"])
    with pytest.raises(InputError, match="a is missing"):
        function(given["q"], given["v"])
    with pytest.raises(InputError, match="expected the arguments q, v, a"):
        function(given["q"], given["v"], given["a"], speed=1.0)
    with pytest.raises(InputError, match="method: there is no 'window'"):
        model.to_jax("window")
    plain = condyle.derive(model.mechanism, backend="numpy")
    with pytest.raises(UnsupportedError, match='method="graph"'):
        plain.to_jax()
    with pytest.raises(UnsupportedError, match="least norm"):
        condyle.derive("human-jaw", backend="compiled").to_jax()
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(InputError, match="jax_enable_x64"):
        model.to_jax()
