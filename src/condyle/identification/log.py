"""What a machine recorded: encoders or poses, efforts, loads, forces of contacts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..mechanism.coordinates import COORDINATES
from ..model.model import Model
from ..motion.column_names import columns_are
from ..motion.column_units import BASE, FORCE, GRAVITY, MOMENT
from ..motion.gravity_and_base import Given, each, gravity_and_base_columns, gravity_and_base_of
from ..motion.number_table import NumberTable
from ..motion.smoothing import LowPass
from ..motion.table_reader import read_table
from ..quantities import QUANTITIES

DENSE = 20  # samples to a period of the cut-off; denser logs are averaged
WANTED = 6  # rows of equations to a period of the cut-off
APART = 1.0  # rad or m, that readings may contradict each other by
FAR = 5.0  # deviations of a reading, beyond which it is an outlier
NEIGHBOURS = 3  # samples on either side, that an outlier is held against
NORMAL = 0.6745  # median of a normal number's size
END = 1.5  # periods of the cut-off that are left out at either end


@dataclass(frozen=True, eq=False)
class Log:
    """A recording on a mechanism, smoothed.

    t: (N,) [s], from 0;  q, v, a: (N, m);  effort: (N, n), averaged but not smoothed;
    wrench: (N, 6);  contact: (N, k) or None;  given: gravity and the base's motion, if recorded;
    encoders: whether q comes from the joints.
    averaged: how many samples of the file make one;  equation_times: (K,) [s], of the equations.
    noise: standard deviations of a sample here, from what smoothing removes: effort (n,), encoder
    (n,), contact (k,).  replaced: how many readings were outliers, where these are looked for.
    notes: what of the file was read otherwise than it stands.
    """

    source: str
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    effort: np.ndarray
    wrench: np.ndarray
    contact: np.ndarray | None
    given: Given
    encoders: bool
    averaged: int
    equation_times: np.ndarray
    low_pass: LowPass
    noise: tuple[np.ndarray, np.ndarray, np.ndarray]
    replaced: int = 0
    notes: tuple[str, ...] = ()

    @cached_property
    def effort_spline(self) -> Any:
        """The efforts, smoothed."""
        return self.low_pass.spline(self.effort)

    @cached_property
    def impulses(self) -> np.ndarray:
        """Weights of the samples, (4, N), in the middle's value smoothed once, and in its value,
        rate and acceleration smoothed twice."""
        middle = self.t[len(self.t) // 2 : len(self.t) // 2 + 1]
        once = self.low_pass.back(np.ones((1, 1)), middle)
        rows = [once, *(self.low_pass.back(once, self.t, nu) for nu in range(3))]
        return np.concatenate(rows, axis=1).T

    def smoothed(self, values: np.ndarray) -> np.ndarray:
        """Values at the samples, (N, ...), smoothed, at the times kept, (K, ...)."""
        flat = self.low_pass.spline(values.reshape(len(values), -1))(self.equation_times)
        return flat.reshape(len(self.equation_times), *values.shape[1:])

    def back(self, weights: np.ndarray) -> np.ndarray:
        """Weights of what `smoothed` takes from those of what it gives, (N, ...)."""
        flat = self.low_pass.back(weights.reshape(len(weights), -1), self.equation_times)
        return flat.reshape(len(self.t), *weights.shape[1:])

    def part(self, start: float, stop: float) -> Log:
        """The log with the equations of a part of its time alone, shares of the whole in 0..1."""
        span = self.equation_times[-1] - self.equation_times[0]
        since = (self.equation_times - self.equation_times[0]) / (span or 1.0)
        chosen = (since >= start) & (since < stop if stop < 1 else since <= 1)
        return Log(**{**vars_of(self), "equation_times": self.equation_times[chosen]})


def vars_of(log: Log) -> dict[str, Any]:
    """The fields of a log."""
    return {name: getattr(log, name) for name in Log.__dataclass_fields__}


def read_log(
    model: Model, path: Any, cutoff: float, trim: float | None = None, robust: bool = False
) -> Log:
    """A log of a mechanism: CSV, Parquet or MCAP.

    Columns: t, and joint_<chain> of all actuators or coordinates as of a motion; tau_<chain>;
    if any Fx .. Mz at the load point, contact_<contact>.
    """
    joints, efforts, forces = (
        QUANTITIES[name].columns(model.mechanism) for name in ("joint", "effort", "contact_force")
    )
    known = ("t", *COORDINATES, *joints, *efforts, *FORCE, *MOMENT, *forces, *GRAVITY, *BASE)
    table = read_table(path, known=known)
    t = table.times()
    effort = table.require(efforts)
    encoders = any(name in table.columns for name in joints)
    if encoders:
        places = table.require(joints)
    else:
        places = table.require(_coordinates(model, set(table.columns), table.source))
    wrench = table.filled((*FORCE, *MOMENT))
    given = [name for name in forces if name in table.columns]
    if given and len(given) != len(forces):
        missing = [name for name in forces if name not in given]
        raise InputError(
            f"{table.source}: {columns_are(missing)} missing; give all contacts' or none"
        )
    contact = table.require(forces) if given else None
    own = places, effort, wrench, contact, encoders, cutoff, trim, Path(path).name
    log = make_log(model, t, *own, _gravity_and_base(table, t), robust)
    return replace(log, notes=tuple(table.notes))


def _gravity_and_base(table: NumberTable, t: np.ndarray) -> Given:
    """Gravity and the base's motion."""
    columns = {
        name: table.columns[name] for name in gravity_and_base_columns(table.columns, table.source)
    }
    return gravity_and_base_of(columns, lambda name: np.gradient(columns[name], t))


def _coordinates(model: Model, there: set[str], source: str) -> list[str]:
    """Names of q, in order, if the log has them."""
    names = list(model.independent)
    if missing := [name for name in names if name not in there]:
        raise InputError(
            f"{source}: expected joint_<chain> of every chain, or {', '.join(names)}; "
            f"{columns_are(missing)} missing"
        )
    return names


def make_log(
    model: Model,
    t: np.ndarray,
    places: np.ndarray,
    effort: np.ndarray,
    wrench: np.ndarray,
    contact: np.ndarray | None,
    encoders: bool,
    cutoff: float,
    trim: float | None = None,
    source: str = "log",
    given: Given | None = None,
    robust: bool = False,
) -> Log:
    """A log from arrays: joints (N, n) or coordinates q (N, m), and efforts (N, n).

    Args:   robust: replace readings far off their neighbours.

    Raises: InputError: where joints cannot be, or it is too short or sparse for the cut-off.
    """
    span, replaced = t[-1] - t[0], 0
    end = END / cutoff if trim is None else trim
    if span - 2 * end <= 0 or int((span - 2 * end) * cutoff * WANTED) + 1 < WANTED:
        raise InputError(
            f"{source}: {span:.3g} s are too short, with {end:.3g} s less at both ends"
        )
    if robust:
        (places, far), (effort, others) = (without_outliers(x) for x in (places, effort))
        replaced = far + others
    averaged = max(1, int((len(t) - 1) / (span * cutoff * DENSE)))
    rows = len(t) // averaged * averaged

    def average(x: np.ndarray) -> np.ndarray:
        return x[:rows].reshape(rows // averaged, averaged, *x.shape[1:]).mean(axis=1)

    t, places, effort, wrench = map(average, (t, places, effort, wrench))
    contact = None if contact is None else average(contact)
    rest = each(given or {}, average)
    t = t - t[0]
    low_pass = LowPass(t, cutoff)
    encoder = np.zeros(effort.shape[1])
    if encoders:
        encoder = _removed(low_pass, t, places)
        solution = model.forward_kinematics(places, time=t, tolerance=APART)
        if (bad := np.flatnonzero(solution.status)).size:
            raise InputError(
                f"{source}: the joints at {t[bad[0]]:.6g} s lead to no pose; are these readings of "
                "this mechanism, from home, in rad and m?"
            )
        q = solution.q
    else:
        q = places
    spline = low_pass.spline(q)
    q, v, a = (spline(t, nu) for nu in range(3))
    count = int((t[-1] - 2 * end) * cutoff * WANTED) + 1
    kept = np.linspace(end, t[-1] - end, count)
    noise = _removed(low_pass, t, effort), encoder, _removed(low_pass, t, contact)
    own = effort, wrench, contact, rest, encoders
    return Log(source, t, q, v, a, *own, averaged, kept, low_pass, noise, replaced)


def without_outliers(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Readings, (N, columns), with outliers replaced by their neighbours, and how many these are.

    Each is held against the median of the means of the pairs 1 to 3 samples before and after it, in
    which a slope cancels; an outlier is FAR deviations off, the deviation by the median (Hampel
    1974).
    """
    reach, count = NEIGHBOURS, len(values)
    more = np.pad(values, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    pairs = [
        (more[reach - k : reach - k + count] + more[reach + k : reach + k + count]) / 2
        for k in range(1, reach + 1)
    ]
    middle = np.median(pairs, axis=0)
    rest = np.abs(values - middle)
    far = rest > FAR * np.median(rest, axis=0) / NORMAL
    return np.where(far, middle, values), int(far.sum())


def _removed(low_pass: LowPass, t: np.ndarray, values: np.ndarray | None) -> np.ndarray:
    """Standard deviations of white noise of a sample, (columns,), from what smoothing removes."""
    if values is None:
        return np.zeros(0)
    rest = values - low_pass.spline(values)(t)
    inner = slice(len(t) // 10, -(len(t) // 10) or None)
    weight = low_pass.back(np.ones((1, 1)), t[len(t) // 2 : len(t) // 2 + 1])[:, 0]
    share = 1 - 2 * weight[len(t) // 2] + weight @ weight  # of white noise that is removed
    # The median is deaf to the jumps of dry friction.
    spread = np.median(np.abs(rest[inner]), axis=0) / NORMAL
    return np.asarray(spread / np.sqrt(share))
