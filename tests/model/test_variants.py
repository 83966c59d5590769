"""Variants of a mechanism against each made by `mechanism.set`, derived and asked by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.cases import BUNDLED, Case, case, error
from support.speeds import few, slow

import condyle
from condyle.errors import CondyleError
from condyle.model.model import Model
from condyle.status import Status

RESULTS = ("effort", "contact_force", "share", "joint_rate", "pose", "bound")


def table(c: Case, count: int, spread: float) -> dict[str, np.ndarray]:
    """Random numbers about those of the file; some are no mechanism's."""
    rng, machine = np.random.default_rng(5), c.mechanism
    first, last = machine.chains[0], machine.chains[-1]
    paths = ["platform.mass", "platform.inertia.xx", "gravity", f"chain.{first.name}.base"]
    paths += [f"chain.{last.name}.platform[1]", f"chain.{last.name}.actuator.viscous"]
    found = {}
    for path in paths:
        own = np.asarray(machine.get(path), dtype=float)
        size = np.abs(own).max() or 0.1
        found[path] = own + spread * size * rng.normal(size=(count, *own.shape))
    found[paths[0]][2] *= -1  # no mass below nothing
    found[paths[-1]] = np.abs(found[paths[-1]])
    return found


def alone(c: Case, changes: dict[str, Any], **how: Any) -> Model | str:
    """The variant made by itself, or why it is no mechanism."""
    model = Model(c.mechanism, **how)
    try:
        held = c.mechanism.set("dependent", model.dependent) if model.dependent else c.mechanism
        return Model(held.set(changes, keep="home"), **how)
    except CondyleError as error:
        return "; ".join(getattr(error, "problems", [str(error)]))


@pytest.mark.parametrize("backend", few(["numpy", "compiled"], "numpy", rest=slow))
@pytest.mark.parametrize("name", [*BUNDLED, "mixed_k2_n8", "rss_k1_n6_ball"])
def test_one_by_one(name: str, backend: str) -> None:
    c = case(name)
    rows = table(c, 6, 0.0005)
    batch = Model(c.mechanism, backend=backend).variants(rows)
    q, v, a, wrench, at = c.arguments
    found = batch.inverse_dynamics(q, v, a, wrench, at, outputs="all")
    moved = batch.forward_dynamics(q, v, np.nan_to_num(found.effort[0]), wrench, at)
    assert found.effort.shape == (6, len(q), len(c.mechanism.chains))
    good = 0
    for i in range(6):
        own = alone(c, batch.changes(i), backend=backend)
        if isinstance(own, str):
            assert batch.status[i] and batch.reason(i) == own
            assert np.isnan(found.effort[i]).all() and (found.status[i] == batch.status[i]).all()
            continue
        good += 1
        assert batch.status[i] == Status.ok and not batch.reason(i)
        wanted = own.inverse_dynamics(q, v, a, wrench, at, outputs="all")
        np.testing.assert_array_equal(found.status[i], wanted.status)
        for result in RESULTS:
            assert error(getattr(found, result)[i], getattr(wanted, result)) < 1e-12, result
        ratio = wanted.configuration.singularity.ratio
        assert error(found.configuration.singularity.ratio[i], ratio) < 1e-12
        forward = own.forward_dynamics(q, v, np.nan_to_num(found.effort[0]), wrench, at)
        assert error(moved.acceleration[i], forward.acceleration) < 1e-10
    assert 2 <= good < 6


def test_solutions_of_all() -> None:
    """Along a motion of other coordinates, with an own limit of each; one variant fails."""
    base = condyle.load_mechanism("masticatory")
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=4.0)
    load = condyle.reference_load()
    own = np.array(base.get("chain.temporalis_left.base"))
    rows = {
        "platform.mass": [0.2, 0.31, -1.0, 0.25],
        "platform.points.incisor[0]": base.get("platform.points.incisor[0]") + np.arange(4) * 1e-3,
        "chain.temporalis_left.base": own + np.outer([0, 0, 0, -0.0165], (1.0, 0, 0)),
        "chain.temporalis_left.actuator.torque_limit": [1.0, 2.0, 3.0, 4.0],
    }
    batch = Model(base, backend="numpy").variants(rows)
    found = batch.solve(motion, load, keep=("effort", "share", "activation", "singularity_ratio"))
    assert found["share"].dims == ("variant", "part", "time", "chain")
    for i in (0, 1, 3):
        alone = Model(batch.mechanism(i), backend="numpy").solve(motion, load, flag=True)
        np.testing.assert_array_equal(found["status"][i], alone["status"])
        for name in ("effort", "share", "activation", "singularity_ratio"):
            assert error(found[name][i], alone[name]) < 1e-12, name
    assert found["status"][3].any() and not found["status"][1].any()
    assert "platform.mass" in found["reason"].values[2] and np.isnan(found["effort"][2]).all()
