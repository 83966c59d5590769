"""Models that share kernels with other mechanisms of their structure."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from support.loads import parts, with_point
from support.speeds import few, slow

import condyle
from condyle.model.model import Model

CHANGES = {
    "masticatory": {"platform.mass": 0.31, "chain.masseter_left.base[0]": 0.0352},
    "gough-stewart": {"platform.mass": 2.0, "chain[0].piston.mass": 0.7},
    "masticatory-curved": {"platform.inertia.xx": 1.7e-4, "chain[1].coupler.mass": 0.02},
}


@pytest.mark.parametrize("name", CHANGES)
@pytest.mark.parametrize("backend", few(["numpy", "compiled"], "numpy", rest=slow))
def test_a_renumbered_model_is_the_mechanisms_own(name: str, backend: str) -> None:
    base = condyle.load_mechanism(name)
    other = base.set(CHANGES[name])
    general = Model(base, backend=backend, general=True)
    motion = condyle.trial_motion(base, rate=4.0)
    load = with_point(np.tile([1.0, 2.0, 3.0, 0.1, 0.2, 0.3], (len(motion), 1)), np.ones(3) / 50)
    states, _ = general.poses.of_motion(motion)
    before = general.inverse_dynamics(*states, *parts(load), threads=1).effort
    found = general.with_mechanism(other).inverse_dynamics(
        *states, *parts(load), outputs="all", threads=1
    )
    wanted = Model(other, backend="numpy").inverse_dynamics(
        *states, *parts(load), outputs="all", threads=1
    )
    for field in ("effort", "contact_force", "joint_rate"):
        a, b = getattr(found, field), getattr(wanted, field)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * np.abs(b).max(initial=1.0))
    assert np.abs(found.effort - before).max() > 1e-3 * np.abs(before).max()
    np.testing.assert_array_equal(
        general.inverse_dynamics(*states, *parts(load), threads=1).effort, before
    )


def test_a_landmarks_path_too() -> None:
    base = condyle.load_mechanism("masticatory")
    other = base.set("platform.points.incisor[0]", base.get("platform.points.incisor[0]") + 0.004)
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=4.0)
    general = Model(base, backend="numpy", general=True)
    own, _ = general.poses.of_motion(motion)
    found, _ = general.with_mechanism(other).poses.of_motion(motion)
    wanted, _ = Model(other, backend="numpy").poses.of_motion(motion)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)
    assert np.abs(found[0] - own[0]).max() > 1e-4


def test_copies_share_their_kernels_and_travel() -> None:
    general = Model(condyle.load_mechanism("gough-stewart"), backend="numpy", general=True)
    kernel = general.kernel("motion")
    assert copy.copy(general).kernel("motion") is kernel
    assert general.with_distribution("bounded").kernel("motion") is kernel
    there = pickle.loads(pickle.dumps(general))
    assert there.with_mechanism(general.mechanism).distribution == general.distribution


def test_what_was_chosen_stays_chosen() -> None:
    base = condyle.load_mechanism("masticatory")
    chosen = Model(base, backend="numpy", general=True).with_distribution("bounded")
    assert (
        chosen.with_mechanism(base.set(CHANGES["masticatory"])).distribution == chosen.distribution
    )
