"""What the convention for the couplers' spin costs: the numbers of the theory page."""

from __future__ import annotations

import numpy as np
from support.machines import model

import condyle
from condyle.model.model import Model


def test_spin_of_couplers_is_beyond_notice() -> None:
    """A rod between two balls feels no torque about its axis, so from rest it never spins; the
    model turns it with its two angles. The theory page has these numbers, of the bundled chewing.
    """
    turning = model("masticatory")
    machine, times = turning.mechanism, condyle.reference_motion().t[::25]
    free = Model(
        machine.set({f"chain.{name}.coupler.axial": 0.0 for name in machine.chain_names}),
        backend="numpy",
    )
    path = condyle.motion.bundled_reference()[0]
    (q, v, a), _ = turning.poses.of_motion(condyle.Motion.from_csv(path, times=times))
    spinning, still = (by.inverse_dynamics(q, v, a).effort for by in (turning, free))
    held = turning.inverse_dynamics(q, 0 * v, 0 * a).effort
    change = np.abs(spinning - still).max()
    loaded = turning.inverse_dynamics(q, v, a, condyle.reference_load().at(times), "right_molar")
    assert 5e-11 < change / np.abs(loaded.effort).max() < 1.5e-10
    assert 2e-8 < change / np.abs(spinning - held).max() < 5e-8
    # Kinetic energy of the spin, by the two angles' rates, and of the whole machine.
    at, M_3 = turning.inverse_kinematics(q, v, a), turning.jacobians(q).M_3
    spin = np.einsum("ncij,nj->nci", M_3, at.pose_rate)[..., 1] * np.sin(at.gamma)
    own = (spin**2 @ [chain.coupler.axial for chain in machine.chains]) / 2
    whole = turning.kernel("energy").run({"q": q, "q1": v}).values["kinetic"]
    assert 1e-9 < own.max() / whole.max() < 5e-9
    assert 0.01 < np.abs(spin).max() < 0.03  # rad/s, beside 2.7 of the cranks
