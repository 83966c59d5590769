"""From the motion to joint coordinates, as encoders would read them, and back to the poses."""

import numpy as np

import condyle

model = condyle.derive("masticatory")
solution = model.solve(condyle.reference_motion())
encoders = solution["joint"].values + np.random.default_rng(0).normal(0, 1e-5, (5001, 6))

found = model.forward_kinematics(encoders, time=solution["time"].values, tolerance=1e-4)
error = np.abs(found.pose - solution["pose"].values).max(axis=0)
print(f"{(found.status == 0).sum()} poses found, condition at most {found.condition.max():.2f}")
print(f"position error: {error[:3].max() * 1e3:.4f} mm, angle error: {error[3:].max():.2e} rad")
print(f"largest joint residual: {np.abs(found.residual).max():.3e} rad")
