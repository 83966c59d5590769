"""A mechanism of one's own: change the bundled one, write it as a file, move it."""

import tempfile
from pathlib import Path

import numpy as np

import condyle

# A heavier platform, and condyles that slide on steeper planes through the same home points.
bundled = condyle.load_mechanism("masticatory")
changes = {"name": "heavy", "platform.mass": 0.3}
for contact in bundled.contacts:
    x, _, z = contact.point
    surface = f"contact.{contact.name}.surface"
    changes |= {f"{surface}.slope": (-0.8, 0.0), f"{surface}.offset": z + 0.8 * x}
robot = bundled.set(changes)

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "heavy.toml"
    condyle.dump(robot, path)
    robot = condyle.load_mechanism(path)

# Open and close once, a push of 20 N on the incisor.
t = np.linspace(0.0, 1.0, 201)
opening = (1.0 - np.cos(2 * np.pi * t)) / 2
motion = condyle.Motion.from_arrays(
    t, {"X": 0.002 * opening, "Y": 0 * t, "alpha": 0 * t, "beta": 0.08 * opening}
)
load = condyle.Load.constant([0.0, 0.0, -20.0], point="incisor")
solution = condyle.derive(robot).solve(motion, load)
for warning in solution.condyle.warnings:
    print("warning:", warning)
peak = float(abs(solution["effort"]).max())
print(f"largest effort: {peak:.6f} N m")
