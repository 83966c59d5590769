"""`excite`: exact gradients, limits kept, and a path that tells more than another."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.errors import InputError
from condyle.identification.excite import OF_DRIVES, OF_PLATFORM, ExcitationStudy, _Path
from condyle.mechanism import Mechanism

from .recorded import rubbing

pytestmark = pytest.mark.slow

NOISE = {"effort": 1e-3, "encoder": 1e-4}


@pytest.fixture(scope="module")
def machine() -> Mechanism:
    """With limits that bind."""
    found = rubbing(condyle.load_mechanism("masticatory"))
    limits = {"torque_limit": 0.05, "speed_limit": 1.0}
    names = [f"chain.{name}.actuator" for name in found.chain_names]
    return found.set({f"{own}.{key}": x for own in names for key, x in limits.items()})


def test_gradients(machine: Mechanism) -> None:
    """Of what a path tells, and of every limit, against differences."""
    model = condyle.derive(machine, distribution="minimum_norm")
    asked = {"noise": NOISE, "singularity": 0.3, "contact_force": 0.5, "harmonics": 3}
    path = _Path(model, ExcitationStudy.checked(asked, "study"), (*OF_PLATFORM, *OF_DRIVES))
    c = 0.03 * np.random.default_rng(0).normal(size=(4, 7))
    states = [basis @ (c * path._scale[:, None]).T for basis in path.basis]
    used = {name: float(np.max(share)) for name, share in path._used(states)[0].items()}
    assert {"effort", "speed", "contact force", "singularity"} < set(used)
    assert sum(share > 1 for share in used.values()) >= 4, used
    for penalty in (0.0, 10.0):
        gradient = path._cost(c, penalty)[1]
        for k in range(0, c.size, 3):
            step = np.zeros(c.size)
            step[k] = 1e-6
            ends = [path._cost(c + s * step.reshape(c.shape), penalty)[0] for s in (1, -1)]
            slope = (ends[0] - ends[1]) / 2e-6
            assert abs(slope - gradient[k]) < 1e-6 * np.abs(gradient).max()


@pytest.mark.usefixtures("compiler_command")
def test_a_path(machine: Mechanism, tmp_path: Path) -> None:
    asked: dict[str, Any] = {"noise": NOISE, "harmonics": 2, "starts": 1, "period": 3.0}
    found = condyle.excite(machine, asked | {"wanted": {"platform.mass": 1e-5}})
    assert all(0 < share <= 1 + 1e-9 for share in found.closest.values())
    ratio = found.deviations["platform.mass"] / 1e-5
    assert found.repetitions == int(np.ceil(ratio**2)) > 1
    file = tmp_path / "path.csv"
    found.save(file)
    # All limits are kept by the solution of the file, and it ends where it began.
    motion = condyle.Motion.from_csv(file)
    solution = condyle.derive(machine, distribution="minimum_norm").solve(motion)
    assert np.abs(solution["effort"]).max() <= 0.05
    assert np.abs(solution["joint_rate"]).max() <= 1.0
    assert solution["singularity_ratio"].min() >= 0.02
    assert (solution["bound_margin"] >= 0).all()
    np.testing.assert_allclose(motion.value[0], motion.value[-1], atol=1e-12)
    # It tells more than the bundled trial motion of the same length.
    model = condyle.derive(machine, distribution="minimum_norm")
    path = _Path(model, ExcitationStudy.checked(asked, "study"), (*OF_PLATFORM, *OF_DRIVES))
    told = []
    for one in (motion, condyle.trial_motion(machine)):
        states = model.poses.of_motion(one)[0]
        every = len(states[0]) // len(path.t)
        told.append(path._information([x[: every * len(path.t) : every] for x in states]))
    better, worse = told
    assert better is not None and worse is not None and better[0] > worse[0]


def test_what_it_refuses() -> None:
    for change, said in (
        ({"number": []}, "number"),
        ({"numbers": ["platform.weight"]}, "weight"),
        ({"period": 0}, "period"),
        ({"margin": 2.0}, "margin"),
        ({"smooth": 1e-6}, "15 s are too short, with 1.5e.06 s less at both ends"),
        ({"harmonics": 101}, "harmonics: expected a value of at most 100"),
        ({"rate": 1e12}, "1.5e.13 samples, expected at most 10000000"),
    ):
        with pytest.raises(InputError, match=said):
            condyle.excite("masticatory", change)
