"""The bundled chewing robot along the reference motion, in ten lines."""

import condyle

mechanism = condyle.load_mechanism("masticatory")
model = condyle.derive(mechanism)
solution = model.solve(condyle.reference_motion(), condyle.reference_load())
peak = abs(solution["effort"]).max(dim="time")
for chain in solution["chain"].values:
    print(f"{chain:<17}{float(peak.sel(chain=chain)):8.4f} N m")
print(f"largest effort: {float(peak.max()):.6f} N m")
