"""Derivatives of frequencies against differences of them."""

import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, random_state, toml_text

from condyle.errors import InputError
from condyle.mechanism import parse
from condyle.model.model import Model

from .test_stiffness import sprung, stewart

NUMBERS = (
    "platform.mass",
    "platform.com",
    "chain.*.actuator.stiffness",
    "chain.{}.platform",
    "contact.{}.point",
    "gravity",
)
SIXTH = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}


def differences(function, size):
    return sum(w * (function(i * size) - function(-i * size)) for i, w in SIXTH.items()) / size


@pytest.mark.slow
@pytest.mark.parametrize(("k", "given"), [(0, False), (1, True), (2, False), (3, False)])
def test_against_differences(k: int, given: bool) -> None:
    """By states, the load and numbers of the file, with efforts that follow or are given."""
    rng = np.random.default_rng([4 if k else 3, k])
    families = ("RSS",) if k != 1 else ("SPS",)
    raw = random_mechanism(rng, families, chains=7, contacts=k, surface="quadratic")
    model = Model(parse(toml_text(sprung(rng, raw, "both"))), backend="numpy")
    state = random_state(rng, raw)
    q, wrench = state["q"][0], 0.3 * state["wrench"][0]
    own = {"effort": rng.uniform(-0.2, 0.2, 7)} if given else {}
    names = [
        path.format(model.mechanism.chain_names[2] if "chain" in path else "left_condyle")
        for path in NUMBERS
        if k or "contact" not in path
    ]
    wrt = ("q", "wrench", *own, *names)
    found = model.derivatives("frequency", wrt, q=q, wrench=wrench, at="incisor", **own)
    assert found.status == 0

    tau = own.get("effort")

    def at(machine=model, q=q, wrench=wrench, effort=tau):
        return machine.modes(q, effort, wrench, "incisor").frequency

    def compare(by, value, function):
        got, direction = found["frequency", by], rng.normal(size=np.shape(value))
        size = 2e-3 * (np.abs(value).max() or 0.01)
        wanted = differences(lambda step: function(value + step * direction), size)
        along = np.reshape(got, (len(q), -1)) @ np.ravel(direction)
        scale = np.abs(got).max() * np.abs(direction).max()
        assert np.abs(along - wanted).max() < 1e-7 * scale, by

    compare("q", q, lambda x: at(q=x))
    compare("wrench", wrench, lambda x: at(wrench=x))
    if given:
        compare("effort", own["effort"], lambda x: at(effort=x))
    machine = model.mechanism
    for path in names:
        each = [path.replace("*", name) for name in machine.chain_names] if "*" in path else [path]
        value = np.array([machine.get(one) for one in each])
        value = value if "*" in path else value[0]

        def changed(x, each=each, path=path):
            table = dict(zip(each, x if "*" in path else [x], strict=True))
            table = {p: tuple(v) if np.ndim(v) else float(v) for p, v in table.items()}
            return at(Model(machine.set(table, keep="home"), backend="numpy"))

        compare(path, value, changed)


def test_equal_frequencies_are_a_kink() -> None:
    """Of a symmetric platform; the derivative of their sum is that of both together."""
    model, path = Model(parse(stewart()), backend="numpy"), "chain.leg_1.actuator.stiffness"
    found = model.derivatives("frequency", path, q=np.zeros(6))
    assert found.status == 9
    k, step = model.mechanism.get(path), 2e3
    near = [Model(model.mechanism.set(path, k + s * step), backend="numpy") for s in (1, -1)]
    ahead, behind = (m.modes(np.zeros(6)).frequency for m in near)
    wanted = (ahead - behind) / (2 * step)
    pairs = [(0, 2), (2, 3), (3, 5), (5, 6)]
    for a, b in pairs:
        np.testing.assert_allclose(
            found["frequency", path][a:b].sum(), wanted[a:b].sum(), rtol=1e-6
        )


def test_says_what_frequencies_do_not_know() -> None:
    model = Model(parse(stewart()), backend="numpy")
    with pytest.raises(InputError, match="gravity"):
        model.derivatives("frequency", "q", q=np.zeros(6), gravity=np.zeros(3))
    with pytest.raises(InputError, match="cannot depend"):
        model.derivatives("frequency", "chain.leg_0.leg.stiffness", q=np.zeros(6))
    with pytest.raises(InputError, match="rigid"):
        rigid = Model(parse(stewart(None)), backend="numpy")
        rigid.derivatives("frequency", "q", q=np.zeros(6))
