"""Models in JAX: values of both methods against numpy's, derivatives against differences."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism
from support.machines import model

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.mechanism.files import from_data
from condyle.questions.file_numbers import numbers_of

from .conftest import ARGUMENTS, RESULTS, STENCIL, answer, arguments, check_slopes, slopes, state

jax = pytest.importorskip("jax")
pytestmark = pytest.mark.usefixtures("compiler_command")


@pytest.fixture(autouse=True)
def doubles():
    """And XLA compiles soon, not well."""
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_disable_most_optimizations", True)


@cache
def functions(name, method="kernel"):
    return model(name, "compiled").to_jax(method)


def batch(name):
    """The state of `slopes`, and many more; the fourth is out of reach where there are contacts."""
    one, given = state(name), state(name, seed=1, count=30)
    for own, value in one.items():
        given[own][0] = value
    given["q"][3] = 9.0
    return given


def check_values(name, question, found):
    expected = answer(name, question, batch(name))
    good = np.asarray(found["status"]) == 0
    assert (good == (expected.status == 0)).all()
    assert not (good[3] and model(name).mechanism.contacts)
    for own in (RESULTS[question], "contact_force"):
        value, right = np.asarray(found[own]), getattr(expected, own)
        assert value.shape == right.shape and np.isnan(value[~good]).all()
        largest = np.abs(right[good]).max(initial=0.0)
        assert np.abs(value[good] - right[good]).max(initial=0.0) <= 1e-11 * largest, own


@pytest.mark.parametrize("question", ARGUMENTS)
def test_a_kernels_values_and_derivatives(question):
    """In a batch; derivatives backwards and, of one, forwards, and the same in a batch of them."""
    name, result = "masticatory", RESULTS[question]
    function = getattr(functions(name), question)
    given, one = (arguments(question, f(name)) for f in (batch, state))
    check_values(name, question, jax.jit(function)(*given))
    every = range(len(given))
    for way in (jax.jacfwd, jax.jacrev) if question == "inverse_dynamics" else (jax.jacrev,):
        slope = way(lambda *x: function(*x)[result], argnums=every)
        check_slopes(slope(*one), slopes(name, question))
    many = jax.jit(jax.vmap(slope))(*(a[:3] for a in given))
    for a, b in zip(many, slope(*(a[2] for a in given)), strict=True):
        assert np.asarray(a)[2] == pytest.approx(np.asarray(b), rel=1e-9, abs=1e-12)


def test_a_graphs_values_and_derivatives():
    """Without a kernel: what XLA makes of the graph, along one direction of all arguments."""
    name, question = "gough-stewart", "inverse_dynamics"
    function, given = getattr(functions(name, "graph"), question), arguments(question, batch(name))
    way = [np.random.default_rng(2).uniform(0.3, 1, a.shape[1]) for a in given]
    ways = [np.broadcast_to(w, a.shape) for w, a in zip(way, given, strict=True)]
    found, moved = jax.jit(lambda x, d: jax.jvp(function, x, d))(tuple(given), tuple(ways))
    check_values(name, question, found)
    parts = zip(slopes(name, question).values(), way, strict=True)
    check_slopes([moved["effort"][0]], {"all": sum(slope @ w for slope, w in parts)})


def test_two_models_in_one_function():
    light = condyle.load_mechanism("masticatory")
    heavy = condyle.derive(light.set({"platform.mass": 0.4}), backend="compiled")
    models = model("masticatory", "compiled"), heavy
    given = [state("masticatory")[own] for own in "qva"]
    own = [one.to_jax().inverse_dynamics for one in models]
    found = jax.jit(lambda *x: [f(*x)["effort"] for f in own])(*given)
    for value, one in zip(found, models, strict=True):
        right = one.inverse_dynamics(*given).effort
        assert np.asarray(value) == pytest.approx(right, rel=1e-12)


def test_numbers_of_the_file():
    """As arguments: values where some are given, derivatives in all of them; of chains of two
    families, in whatever order the file has them."""
    rng = np.random.default_rng(3)
    machine = from_data(random_mechanism(rng, ("PSS", "SPS"), chains=5, contacts=1))
    machine = machine.set({f"chain.{n}.actuator.viscous": 0.01 for n in machine.chain_names})
    compiled = condyle.derive(machine, backend="compiled")
    given = {own: rng.normal(0, size, 5) for own, size in (("q", 1e-3), ("v", 0.1), ("a", 1.0))}
    assert sorted(kinds := [chain.kind for chain in machine.chains]) != kinds
    wide = condyle.derive(machine, backend="numpy").system.unreduced
    kernel = wide.kernel("inverse", ())
    inputs = {port: given[own][None] for port, own in (("q", "q"), ("q1", "v"), ("q2", "a"))}
    inputs |= dict.fromkeys(("force", "moment", "point"), np.zeros((1, 3)))
    losses = "chain.*.actuator.viscous"
    paths = ["platform.mass", f"chain.{machine.chain_names[1]}.base"]
    paths += [f"contact.{machine.contact_names[0]}.point"]
    function = compiled.to_jax(numbers=[*paths, losses]).inverse_dynamics

    def effort(numbers):
        return function(*(given[own] for own in "qva"), numbers=numbers)["effort"]

    def right(numbers):
        own = {path: x.tolist() for path, x in numbers.items() if path != losses}
        for chain, x in zip(machine.chain_names, numbers.get(losses, ()), strict=False):
            own[f"chain.{chain}.actuator.viscous"] = float(x)
        other = numbers_of(wide.structure, machine.set(own, keep="home"))
        return kernel.renumbered(other).run(inputs).values["effort"][:, 0]

    def along(numbers, way, h=1e-4):
        ends = ({path: x + k * h * way[path] for path, x in numbers.items()} for k, _ in STENCIL)
        return sum(w / h * right(end) for (_, w), end in zip(STENCIL, ends, strict=True))

    nominal = {path: np.array(machine.get(path), dtype=float) for path in paths}
    all_ = nominal | {losses: np.full(len(machine.chains), 0.01)}
    way = {k: np.abs(x).max() * rng.uniform(0.3, 1, x.shape) for k, x in all_.items()}
    some = {path: x + 2e-3 * way[path] for path, x in nominal.items()}
    moved = {path: way[path] for path in some}
    weights = rng.normal(size=5)
    slope = jax.jit(lambda x, d: jax.jvp(effort, (x,), (d,))[1])(all_, way)
    check_slopes([slope], {"forwards": along(all_, way)}, 1e-8)
    cost = jax.value_and_grad(lambda x: (weights @ effort(x), effort(x)), has_aux=True)
    (_, value), by = jax.jit(cost)(some)
    assert np.asarray(value) == pytest.approx(right(some), rel=1e-9, abs=1e-12)
    back = sum(np.vdot(by[path], moved[path]) for path in some)
    check_slopes([back], {"backwards": weights @ along(some, moved)}, 1e-8)
    for numbers, said in (
        ({"gravity": np.zeros(3)}, r"expected some of .*; got gravity"),
        ({paths[1]: 1.0}, r"expected an array of shape \(\.\.\., 3\)"),
    ):
        with pytest.raises(InputError, match=said):
            effort(numbers)
    with pytest.raises(InputError, match="name them first"):
        functions("masticatory").inverse_dynamics(*np.zeros((3, 4)), numbers={paths[0]: 1.0})


def test_refused():
    inverse, (q, v, a) = functions("masticatory").inverse_dynamics, np.zeros((3, 4))
    for call, said in (
        (lambda: inverse(np.zeros(2), v, a), r"q: expected an array of shape \(\.\.\., 4\)"),
        (lambda: inverse(q, v), "a is missing"),
        (lambda: inverse(q, v, a, speed=1.0), "expected the arguments q, v, a"),
        (lambda: functions("masticatory", "window"), "method: unknown method 'window'"),
    ):
        with pytest.raises(InputError, match=said):
            call()
    for name, backend, said in (
        ("masticatory", "numpy", 'method="graph"'),
        ("human-jaw", "compiled", "least norm"),
    ):
        with pytest.raises(UnsupportedError, match=said):
            model(name, backend).to_jax()
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(InputError, match="jax_enable_x64"):
        model("masticatory", "compiled").to_jax()
