"""Checks of motions and loads: values that suggest a wrong unit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..mechanism.mechanism_checks import EARTH, EARTH_SPREAD
from .column_units import dimension

SOUND = 343.0  # m/s
_PATH = 3.0  # m: a platform goes no farther
_SLOW = {"length": 0.1, "angle": 0.5}  # per second: a machine that is hardly seen to move
_STEP, _STEPS = 0.5, 100  # s between samples, and number of samples: perhaps milliseconds
_FORCE = 1e6  # N or N m

_MS = 'if t is in milliseconds, name the column "t [ms]" or say --units ms'


def motion_warnings(
    source: str, names: Sequence[str], t: np.ndarray, value: np.ndarray, rate: np.ndarray
) -> tuple[str, ...]:
    """Warnings of a motion, (N,) [s] and (N, m) in SI, that suggest a wrong unit."""
    warnings = []
    slow = True
    for name, x, v in zip(names, value.T, np.abs(rate).max(axis=0), strict=True):
        kind, span, most = (dimension(name) or ("length", 0))[0], np.ptp(x), np.abs(x).max()
        slow = slow and v < _SLOW[kind]
        if kind == "length" and v > SOUND:
            text = f"moves at {v:.4g} m/s, faster than sound. Are lengths in mm (--units mm) or "
            warnings.append(f"{source}: {name} {text}times in other units?")
        elif kind == "length" and span > _PATH:
            text = f"goes over {span:.4g} m; if lengths are in mm, say --units mm"
            warnings.append(f"{source}: {name} {text}")
        elif kind == "angle" and most > 2 * np.pi:
            text = f"reaches {most:.4g} rad, more than a turn; if angles are in degrees, say"
            warnings.append(f"{source}: {name} {text} --units deg")
    return (*warnings, *(time_warnings(source, t) if slow else ()))


def gravity_warnings(source: str, gravity: np.ndarray | None) -> tuple[str, ...]:
    """A warning of gravity, (N, 3) [m/s^2], whose size is neither the Earth's nor none."""
    if gravity is None:
        return ()
    size = np.linalg.norm(gravity, axis=1)
    odd = (np.abs(size - EARTH) > EARTH_SPREAD) & (size > 0)
    if not odd.any():
        return ()
    worst = size[odd][np.argmax(np.abs(size[odd] - EARTH))]
    said = f"gx, gy, gz: gravity of {worst:.4g} m/s^2 is neither the Earth's 9.81 nor none"
    return (f"{source}: {said} ({int(odd.sum())} of {len(size)} samples)",)


def load_warnings(source: str, t: np.ndarray, wrench: np.ndarray) -> tuple[str, ...]:
    """Warnings of a load, (N,) [s] and (N, 6) [N, N m], that suggest a wrong unit."""
    largest = np.abs(wrench).max(initial=0)
    huge = (
        f"{source}: reaches {largest:.4g} N or N m; name other units in the header, as Fz [mN]",
    )
    return (*time_warnings(source, t), *(huge if largest > _FORCE else ()))


def time_warnings(source: str, t: np.ndarray) -> tuple[str, ...]:
    """Whether the times look like milliseconds."""
    if len(t) < _STEPS or (step := float(np.median(np.diff(t)))) < _STEP:
        return ()
    total = f"{len(t)} rows in steps of {step:.4g} s, {t[-1] - t[0]:.4g} s in all"
    return (f"{source}: {total}; {_MS}",)
