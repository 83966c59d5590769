"""The reference motion and load, and a motion to try any mechanism with: SYNTHETIC, by formulas.

The reference is not the recordings of the paper, which were never published in numbers. It has the
traits that Section 6 of [Cheng2023] tells of its Figures 5 and 7: five seconds, the first one at
rest, then rhythmic chewing nearly in one inclined plane, and five bursts of bite force.

    x, y, z = -2.55 mm o, 2 mm w sin(phi), -15 mm o,    o = w (1 - cos(phi)) / 2,   phi = 2 pi u / T

with u = t - 1 s, T = 0.8 s, and w rising from 0 to 1 in half a second (`rise`). Bursts of
100, 90, 80, 70 and 60 N, sin^2 of a quarter second, begin 0.1 s after the mouth is widest open;
their sideways and forward parts are 15 and 10 %.
"""

from __future__ import annotations

import os
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import as_path
from ..files.atomic import replacing
from ..mechanism.files import as_mechanism
from ..mechanism.home import characteristic_length, independent_coordinates
from ..mechanism.mechanism import Mechanism
from .column_units import LANDMARK
from .path import Motion
from .platform_load import Load
from .points import DEFAULT_LOAD_POINT

MOTION_FILE = "chewing-incisor.csv"
LOAD_FILE = "bite-force.csv"
SWAY = 0.03  # of the characteristic length, and in radians
SLOWEST, STEP = 0.4, 0.15  # of the first coordinate's sway, and from one to the next [Hz]
SYNTHETIC = "synthetic, not the recording of the paper"


def fits_reference(mechanism: Mechanism, landmark: str | None = None) -> bool:
    """Whether the bundled motion is one for a mechanism: two contacts, and a landmark."""
    named = landmark is not None or "incisor" in mechanism.platform.points
    return named and len(mechanism.contacts) == 2


def fits_load(mechanism: Mechanism) -> bool:
    """Whether the bundled load is one for a mechanism: it has the jaw's molar, and can chew."""
    return DEFAULT_LOAD_POINT in mechanism.platform.points and fits_reference(mechanism)


def reference_motion() -> Motion:
    """Path of the incisor in five seconds of chewing, at 1 kHz. Synthetic."""
    t, *path = _columns(bundled_reference()[0])
    values = dict(zip(LANDMARK, path, strict=True))
    return Motion.from_arrays(t, values, landmark="incisor", source=f"{MOTION_FILE} ({SYNTHETIC})")


def reference_load() -> Load:
    """Bite force at the right molar in the same five seconds. Synthetic."""
    t, *force = _columns(bundled_reference()[1])
    source = f"{LOAD_FILE} ({SYNTHETIC})"
    return Load.from_arrays(t, np.column_stack(force), point="right_molar", source=source)


def write_reference(folder: str | os.PathLike[str]) -> list[Path]:
    """Copy the bundled motion and load into `folder`, as they are; returns their paths."""
    paths = []
    for source in bundled_reference():
        paths.append(Path(as_path(folder, "folder")) / source.name)
        with replacing(paths[-1]) as temporary:
            temporary.write_bytes(source.read_bytes())
    return paths


def bundled_reference() -> tuple[Path, Path]:
    """Paths of the two files as they come with the package: motion, load."""
    folder = Path(str(resources.files("condyle.motion"))) / "data"
    return folder / MOTION_FILE, folder / LOAD_FILE


def _columns(file: Path) -> np.ndarray:
    return np.loadtxt(file, delimiter=",", skiprows=1, unpack=True)


def trial_motion(
    model: Any, *, cutoff: float | str | None = None, rate: float | None = None, trim: float = 0.0
) -> Motion:
    """Five seconds in which the independent coordinates oscillate about home, each at its own rate.

        q_i = a_i w(t) sin(2 pi f_i t),    f_i = 0.4, 0.55, 0.7, ... Hz

    with a_i = 3 % of the characteristic length or 0.03 rad, and w rising from 0 to 1 in the first
    second. Synthetic.

    Args:   model: a model or mechanism, the path of a mechanism file or a bundled name.
            cutoff, rate, trim: as of `Motion.from_arrays`.
    Raises: InputError: for anything else.
    """
    mechanism = as_mechanism(model)
    t = np.round(np.linspace(0, 5, 5001), 3)
    names = independent_coordinates(mechanism)
    length = SWAY * characteristic_length(mechanism)
    columns = {
        name: (length if name in "XYZ" else SWAY)
        * rise(t)
        * np.sin(2 * np.pi * (SLOWEST + STEP * i) * t)
        for i, name in enumerate(names)
    }
    source = "trial motion (synthetic)"
    return Motion.from_arrays(t, columns, cutoff=cutoff, rate=rate, trim=trim, source=source)


def rise(s: np.ndarray) -> np.ndarray:
    """A rise from 0 at 0 to 1 at 1, with four smooth derivatives."""
    s = np.clip(s, 0, 1)
    return s**5 * (126 - 420 * s + 540 * s**2 - 315 * s**3 + 70 * s**4)
