"""Many independent states at once: torques only, as fast as the machine."""

import numpy as np

import condyle

model = condyle.derive("masticatory")
count = 20_000
rng = np.random.default_rng(1)
q = rng.uniform(-1, 1, (count, 4)) * [1e-3, 1e-3, 0.02, 0.05]  # X, Y [m], alpha, beta [rad]
q_rate = rng.normal(size=(count, 4)) * [0.02, 0.02, 0.2, 0.5]
q_acceleration = 10 * q_rate
# Force and moment in {S}.
wrench = np.zeros((count, 6))
wrench[:, 2] = rng.uniform(-20, 0, count)

found = model.inverse_dynamics(q, q_rate, q_acceleration, wrench, at="right_molar")
print(f"{(found.status == 0).sum()} of {count} states computed")
print(f"mean effort: {np.abs(found.effort).mean():.6f} N m")
