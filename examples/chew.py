"""Chew a bolus under two controllers, on the machine they know and on one that is 10 % heavier.

The plant differs from the controller's model, which stays the bundled mechanism. Prints tracking
errors, efforts and joint loads, and draws results/chew.png.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import condyle

HERE = Path(__file__).parent
RESULTS = Path("results")
SECONDS = 5.0

known = condyle.load_mechanism("masticatory")
platform = known.platform
heavier = known.set(
    {
        "platform.mass": 1.1 * platform.mass,
        "platform.inertia": {k: 1.1 * v for k, v in platform.inertia.entries().items()},
    }
)
RESULTS.mkdir(exist_ok=True)
condyle.dump(known, RESULTS / "known.toml")

figure, axes = plt.subplots(3, 1, figsize=(7, 7), sharex=True, layout="constrained")
for controller in ("chew", "bite"):
    scenario = condyle.load_scenario(HERE / f"{controller}.toml")
    law = scenario.controller.model_copy(update={"model": str(RESULTS / "known.toml")})
    scenario = scenario.model_copy(update={"controller": law, "duration": SECONDS})
    for plant, dash in ((known, "-"), (heavier, ":")):
        run = condyle.simulate(plant, scenario)
        t, name = run["time"], f"{law.kind}, {'10 % heavier' if plant is heavier else 'as known'}"
        opening = np.degrees(run["tracking_error"].sel(independent="beta"))
        food = np.linalg.norm(run["load_force"].sel(source="food"), axis=1)
        joint = abs(run["contact_force"]).max("contact")
        axes[0].plot(t, opening, dash, label=name)
        axes[1].plot(t, food, dash)
        axes[2].plot(t, joint, dash)
        print(
            f"{name:30}: error of beta {abs(opening).max().item():.3f} deg, effort "
            f"{abs(run['effort']).max().item():.3f} N m, food {food.max():.1f} N, joint "
            f"{joint.max().item():.2f} N"
        )
axes[0].set_ylabel("error of the opening [deg]")
axes[1].set_ylabel("force on the food [N]")
axes[2].set(ylabel="larger joint load [N]", xlabel="time [s]")
figure.legend(loc="outside upper center", ncols=2, fontsize="small")
figure.savefig(RESULTS / "chew.png", dpi=120)
