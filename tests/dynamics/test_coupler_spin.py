"""What the convention for the couplers' spin costs: the numbers of the theory page."""

from __future__ import annotations

import numpy as np

import condyle
from condyle.model.model import Model


def test_spin_of_couplers_is_beyond_notice() -> None:
    """A rod between two balls feels no torque about its axis, so from rest it never spins; the
    model turns it with its two angles. The bundled mechanism along the bundled chewing motion.
    """
    machine = condyle.load_mechanism("masticatory")
    bare = [
        chain.model_copy(update={"coupler": chain.coupler.model_copy(update={"axial": 0.0})})
        for chain in machine.chains
    ]
    times = condyle.reference_motion().t[::25]
    path = condyle.motion.bundled_reference()[0]
    turning = Model(machine, backend="numpy")
    free = Model(machine.replace(chains=tuple(bare)), backend="numpy")
    (q, v, a), _ = turning.poses.of_motion(condyle.Motion.from_csv(path, times=times))
    efforts = [m.inverse_dynamics(q, v, a).effort for m in (turning, free)]
    held = turning.inverse_dynamics(q, 0 * v, 0 * a).effort
    change = np.abs(efforts[0] - efforts[1]).max()
    loaded = turning.inverse_dynamics(q, v, a, condyle.reference_load().at(times), "right_molar")
    assert 5e-11 < change / np.abs(loaded.effort).max() < 1.5e-10
    assert 2e-8 < change / np.abs(efforts[0] - held).max() < 5e-8
    # Kinetic energy of the spin, by the two angles' rates, and of the whole machine.
    at, J = turning.inverse_kinematics(q, v, a), turning.jacobians(q)
    angle_rates = np.einsum("ncij,nj->nci", J.M_3, at.pose_rate)
    spin = angle_rates[..., 1] * np.sin(at.gamma)
    axial = np.array([chain.coupler.axial for chain in machine.chains])
    own = (spin**2 @ axial) / 2
    whole = turning.kernel("energy").run({"q": q, "q1": v}).values["kinetic"].ravel()
    assert 1e-9 < own.max() / whole.max() < 5e-9
    assert 0.01 < np.abs(spin).max() < 0.03  # rad/s, beside 2.7 of the cranks
