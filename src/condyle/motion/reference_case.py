"""The reference motion and load: SYNTHETIC, made by the formulas below.

They are not the recordings of the paper, which were never published in numbers. They keep the
traits that Section 6 of [Cheng2023] tells of its Figures 5 and 7: five seconds, the first one at
rest, then rhythmic chewing nearly in one inclined plane, and five bursts of bite force.
"""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path

import numpy as np

from ..atomic import replacing
from .path import Motion
from .platform_load import Load

MOTION_FILE = "chewing-incisor.csv"
LOAD_FILE = "bite-force.csv"
SYNTHETIC = "synthetic, not the recording of the paper"

_TIMES = np.linspace(0, 5, 5001)
_REST = 1.0  # chewing starts [s]
_PERIOD = 0.8  # of a chewing cycle [s]
_RAMP = 0.5  # until cycles have their full size [s]
_BURST = 0.25  # length of a burst of bite force [s]


def reference_motion() -> Motion:
    """Path of the incisor in five seconds of chewing, at 1 kHz. Synthetic."""
    t, columns = _times(), _incisor_path()
    return Motion.from_arrays(t, columns, landmark="incisor", source=f"{MOTION_FILE} ({SYNTHETIC})")


def reference_load() -> Load:
    """Bite force at the right molar in the same five seconds. Synthetic."""
    force = np.column_stack(list(_bite_force().values()))
    return Load.from_arrays(
        _times(), force, point="right_molar", source=f"{LOAD_FILE} ({SYNTHETIC})"
    )


def write_reference(folder: str | os.PathLike[str]) -> list[Path]:
    """Copy the bundled motion and load into `folder`, as they are; returns their paths."""
    paths = []
    for source in bundled_reference():
        paths.append(Path(folder) / source.name)
        with replacing(paths[-1]) as temporary:
            temporary.write_bytes(source.read_bytes())
    return paths


def bundled_reference() -> tuple[Path, Path]:
    """Paths of the two files as they come with the package: motion, load."""
    folder = Path(str(resources.files("condyle.motion"))) / "data"
    return folder / MOTION_FILE, folder / LOAD_FILE


def _times() -> np.ndarray:
    """Times as the files have them: the nearest numbers to 0.001, 0.002, ..."""
    return np.round(_TIMES, 3)


def _incisor_path() -> dict[str, np.ndarray]:
    """Displacement of the incisor [m]: down and back by 15 and 2.55 mm, 2 mm to either side.

        opening = w(u) (1 - cos(2 pi u / T)) / 2,   side = w(u) sin(2 pi u / T),   u = t - 1 s

    with w the polynomial of degree 9 that rises from 0 to 1 with four smooth derivatives.
    numpy's sines differ in the last digit from processor to processor, and so may these numbers
    from those of the bundled file.
    """
    u = _TIMES - _REST
    w = rise(u / _RAMP)
    phase = 2 * np.pi / _PERIOD * u
    opening = w * ((1 - np.cos(phase)) / 2)
    columns = {"x": -0.00255 * opening, "y": 0.002 * w * np.sin(phase), "z": -0.015 * opening}
    return {name: column + 0.0 for name, column in columns.items()}  # + 0.0 turns -0 into 0


def rise(s: np.ndarray) -> np.ndarray:
    """From 0 at 0 to 1 at 1, with four smooth derivatives."""
    s = np.clip(s, 0, 1)
    return s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)


def _bite_force() -> dict[str, np.ndarray]:
    """Force of the food on the jaw [N]: five bursts of 100, 90, 80, 70 and 60 N, each sin^2.

    A burst begins 0.1 s after the mouth is widest open. Sideways and forward parts are 15 and 10 %.
    """
    t = _TIMES
    down = np.zeros_like(t)
    for cycle in range(5):
        begin = _REST + _PERIOD * cycle + 0.4 + 0.1
        inside = (t > begin) & (t < begin + _BURST)
        burst = np.sin(np.pi * (t[inside] - begin) / _BURST) ** 2
        down[inside] = -(100 - 10 * cycle) * burst
    columns = {"Fx": -0.1 * down, "Fy": 0.15 * down, "Fz": down}
    return {name: column + 0.0 for name, column in columns.items()}
