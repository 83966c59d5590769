"""Flat sockets against curved ones: what the shape of the joint does to the joint's load."""

import condyle

peaks = {}
for name in ("masticatory", "masticatory-curved"):
    model = condyle.derive(condyle.load_mechanism(name))
    solution = model.solve(condyle.reference_motion(), condyle.reference_load())
    peaks[name] = float(abs(solution["contact_force"]).max())
    print(f"{name:<20} largest contact force {peaks[name]:8.4f} N")
change = peaks["masticatory-curved"] / peaks["masticatory"] - 1
print(f"change: {change:+.4%}")
