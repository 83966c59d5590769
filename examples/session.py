"""A session of recordings, from C3D files to joint loads: SYNTHETIC.

Writes a static trial and two chewing trials as cameras would see them, with 0.1 mm of noise, a
session file beside them, and the results. Prints the tables.
"""

from pathlib import Path

import c3d
import numpy as np
from scipy.spatial.transform import Rotation

import condyle

FOLDER = Path("results/session")
RATE, SECONDS, NOISE = 50.0, 5.1, 0.1  # Hz, s, mm
UPPER = {
    "Upper_FL": (80, 30, 20),
    "Upper_BL": (50, 45, 25),
    "Upper_FR": (82, -28, 22),
}  # mm, in {S}
LOWER = {"Lower_FL": (85, 25, -20), "Lower_BL": (55, 42, -30), "Lower_FR": (83, -27, -18)}  # in {M}
LABORATORY = Rotation.from_euler("yz", [-0.2, 2.0])  # from {S}: the head is tilted back

jaw = condyle.derive("human-jaw", backend="numpy")
rng = np.random.default_rng(0)


def record(name: str, opening: np.ndarray, sideways: np.ndarray) -> None:
    """A C3D file of the jaw at openings [rad] and sideways shifts [m], (N,) each."""
    zero = np.zeros_like(opening)
    q = np.column_stack([0.03 * opening, sideways, zero, opening])  # X, Y, alpha, beta
    pose = jaw.inverse_kinematics(q).pose
    turn = Rotation.from_euler("XYZ", pose[:, 3:])
    lower = [turn.apply(point) + 1e3 * pose[:, :3] for point in LOWER.values()]
    upper = [np.tile(point, (len(q), 1)) for point in UPPER.values()]
    points = np.stack([LABORATORY.apply(point) for point in [*upper, *lower]], axis=1)
    points += rng.normal(0, NOISE, points.shape)
    writer = c3d.Writer(point_rate=RATE, analog_rate=RATE)
    writer.set_point_labels([*UPPER, *LOWER])
    writer.set_analog_labels(["Trigger"])
    seen = np.concatenate([points, np.zeros((*points.shape[:2], 2))], axis=2)
    writer.add_frames([(frame, np.zeros((1, 1))) for frame in seen])
    with (FOLDER / f"{name}.c3d").open("wb") as file:
        writer.write(file)


FOLDER.mkdir(parents=True, exist_ok=True)
t = np.arange(0, SECONDS, 1 / RATE)
record("static", np.zeros(50), np.zeros(50))
for name, side in (("right", -1), ("left", 1)):
    phase = 2 * np.pi * np.clip(1.4 * (t - 0.4), 0, 6)  # six cycles, at rest before and after
    record(f"chewing-{name}", 0.06 * (1 - np.cos(phase)), side * 1e-3 * np.sin(phase))

machine = jaw.mechanism
places = {c.name: c.point for c in machine.contacts} | {
    "incisor": machine.platform.points["incisor"]
}
register = {n: LABORATORY.apply(1e3 * np.array(p)).tolist() for n, p in places.items()}
session = f"""
mechanism = "human-jaw"
static = {{ file = "static.c3d", home = [0.0, 0.98] }}
markers = {{ fixed = {[*UPPER]}, platform = {[*LOWER]} }}
filter = {{ markers = 8.0 }}
cycles = {{ by = "gape", least = 2.0 }}
solve = {{ distribution = "cubic" }}
[register]
{"".join(f"{name} = {place}{chr(10)}" for name, place in register.items())}
[[trial]]
file = "chewing-right.c3d"
task = "chew"
labels = {{ side = "right" }}
[[trial]]
file = "chewing-left.c3d"
task = "chew"
labels = {{ side = "left" }}
"""
(FOLDER / "session.toml").write_text(session)

found = condyle.measure_session(FOLDER / "session.toml", FOLDER / "results")
print(found)
peaks = [cycle["peak_contact_left_condyle"] for cycle in found.cycles]
print(f"Results: {FOLDER / 'results'}")
print(f"Peak load of the left joint, mean of {len(peaks)} cycles [N]: {np.mean(peaks):.3f}")
