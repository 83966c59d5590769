"""Variants of a mechanism against each made by `mechanism.set`, derived and asked by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.cases import Case, case, error

import condyle
from condyle.errors import CondyleError
from condyle.model.model import Model
from condyle.status import Status

RESULTS = ("effort", "contact_force", "share", "joint_rate", "pose", "bound")
CASES = [
    ("gough-stewart", "numpy"),
    pytest.param("mixed_k2_n8", "numpy", marks=pytest.mark.slow),
    pytest.param("masticatory", "compiled", marks=pytest.mark.slow),
    pytest.param("masticatory-curved", "numpy", marks=pytest.mark.ci),
]


def table(c: Case, count: int, spread: float) -> dict[str, np.ndarray]:
    """Random numbers about those of the file; some are no mechanism's."""
    rng, machine = np.random.default_rng(5), c.mechanism
    first, last = machine.chains[0].name, machine.chains[-1].name
    paths = ["platform.mass", "platform.inertia.xx", "gravity", f"chain.{first}.base"]
    paths += [f"chain.{last}.platform[1]", f"chain.{last}.actuator.viscous"]
    found = {}
    for path in paths:
        own = np.asarray(machine.get(path), dtype=float)
        size = np.abs(own).max() or 0.1
        found[path] = own + spread * size * rng.normal(size=(count, *own.shape))
    found[paths[0]][1] *= -1  # no mass below nothing
    found[paths[-1]] = np.abs(found[paths[-1]])
    return found


def alone(c: Case, changes: dict[str, Any]) -> Model | str:
    """The variant made by itself, or why it is no mechanism."""
    model = Model(c.mechanism, backend="numpy")
    try:
        held = c.mechanism.set("dependent", model.dependent) if model.dependent else c.mechanism
        return Model(held.set(changes, keep="home"), backend="numpy")
    except CondyleError as error:
        return "; ".join(getattr(error, "problems", [str(error)]))


@pytest.mark.parametrize(("name", "backend"), CASES)
def test_one_by_one(name: str, backend: str, request: pytest.FixtureRequest) -> None:
    if backend == "compiled":
        request.getfixturevalue("compiler_command")
    c = case(name)
    batch = Model(c.mechanism, backend=backend).variants(table(c, 3, 0.0005))
    q, v, a, wrench, at = c.arguments
    found = batch.inverse_dynamics(q, v, a, wrench, at, outputs="all")
    moved = batch.forward_dynamics(q, v, np.nan_to_num(found.effort[0]), wrench, at)
    assert found.effort.shape == (3, len(q), len(c.mechanism.chains))
    good = 0
    for i in range(3):
        own = alone(c, batch.changes(i))
        if isinstance(own, str):
            assert batch.status[i] and batch.reason(i) == own
            assert np.isnan(found.effort[i]).all() and (found.status[i] == batch.status[i]).all()
            continue
        good += 1
        assert batch.status[i] == Status.ok and not batch.reason(i)
        wanted = own.inverse_dynamics(q, v, a, wrench, at, outputs="all")
        np.testing.assert_array_equal(found.status[i], wanted.status)
        for result in RESULTS:
            if (backend, result) != ("compiled", "bound"):  # of other sums
                assert error(getattr(found, result)[i], getattr(wanted, result)) < 1e-11, result
        ratio = wanted.configuration.singularity.ratio
        assert error(found.configuration.singularity.ratio[i], ratio) < 1e-11
        forward = own.forward_dynamics(q, v, np.nan_to_num(found.effort[0]), wrench, at)
        assert error(moved.acceleration[i], forward.acceleration) < 1e-10
    assert good == 2


def test_solutions_of_all() -> None:
    """Along a motion of other coordinates, with an own limit of each; one variant fails."""
    base = condyle.load_mechanism("masticatory")
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=4.0)
    own, incisor = (
        base.get(path) for path in ("chain.temporalis_left.base", "platform.points.incisor[0]")
    )
    rows = {
        "platform.mass": [0.2, -1.0, 0.25],
        "platform.points.incisor[0]": incisor + np.arange(3) * 1e-3,
        "chain.temporalis_left.base": np.array(own) + np.outer([0, 0, -0.0165], (1.0, 0, 0)),
        "chain.temporalis_left.actuator.torque_limit": [1.0, 2.0, 4.0],
    }
    batch = Model(base, backend="numpy").variants(rows)
    keep = ("effort", "share", "activation", "singularity_ratio")
    found = batch.solve(motion, condyle.reference_load(), keep=keep)
    assert found["share"].dims == ("variant", "part", "time", "chain")
    for i in (0, 2):
        model = Model(batch.mechanism(i), backend="numpy")
        alone = model.solve(motion, condyle.reference_load(), flag=True)
        np.testing.assert_array_equal(found["status"][i], alone["status"])
        for name in keep:
            assert error(found[name][i], alone[name]) < 1e-12, name
    assert found["status"][2].any() and not found["status"][0].any()
    assert "platform.mass" in found["reason"].values[1] and np.isnan(found["effort"][1]).all()


@pytest.mark.parametrize(
    ("path", "change"),
    [("contact.left_condyle.surface.slope", (0.02, 0.0)), ("chain.*.actuator.viscous", 0.1)],
)
def test_the_first_has_less_structure(path: str, change: Any) -> None:
    """Slopes that only later variants have apart, and losses that only they have."""
    base = condyle.load_mechanism("masticatory")
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=4.0)
    chains = [base.get(path.replace("*", name)) for name in base.chain_names]
    own = np.array(chains if "*" in path else base.get(path))
    rows = {path: np.stack([own, own + change, own])}
    batch = Model(base, backend="numpy").variants(rows)
    found = batch.solve(motion, condyle.reference_load())
    assert not batch.status.any() and len(batch.groups) == 1
    for i in range(3):
        alone = Model(batch.mechanism(i), backend="numpy").solve(motion, condyle.reference_load())
        assert error(found["effort"][i], alone["effort"]) < 1e-12
    assert error(found["effort"][1], found["effort"][0]) > 1e-3
