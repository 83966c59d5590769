"""Many independent states at once: torques only, as fast as the machine."""

import numpy as np

import condyle

model = condyle.derive(condyle.load_mechanism("masticatory"))
count = 20_000
rng = np.random.default_rng(1)
q = rng.uniform(-1, 1, (count, 4)) * [1e-3, 1e-3, 0.02, 0.05]  # X, Y [m], alpha, beta [rad]
q_rate = rng.normal(size=(count, 4)) * [0.02, 0.02, 0.2, 0.5]
q_acceleration = 10 * q_rate
# Force and moment in {S}, and the platform point they act at, in {M}.
load = np.zeros((count, 9))
load[:, 2] = rng.uniform(-20, 0, count)
load[:, 6:] = model.load_point("right_molar")

found = model.torques(q, q_rate, q_acceleration, load)
print(f"{(found.status == 0).sum()} of {count} states computed")
print(f"mean effort: {np.abs(found.effort).mean():.6f} N m")
