"""Which poses can be reached: by contacts, by chains, and within the strokes of the joints.

Strokes are given with the map, since a mechanism file has none: ranges of joint coordinates from
home, by the chains' names, `leg_*=-200:300 mm`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property

import numpy as np

from ...errors import InputError, did_you_mean, texts_of
from ...kinematics.chain import FAMILIES
from ...mechanism.contact import Bounds
from ...mechanism.mechanism import Mechanism
from ...model.model import Model
from ...model.surveying import Survey
from ...motion.column_units import unit_factor
from ...motion.written_values import number, parsed
from ...status import Status

Strokes = Collection[str] | Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Reach:
    """What a mechanism can reach; low, high: of the joint coordinates, (n,) [rad or m]."""

    model: Model
    low: np.ndarray
    high: np.ndarray
    threads: int | None = None

    @staticmethod
    def of(model: Model, stroke: Strokes = (), threads: int | None = None) -> Reach:
        """Raises InputError for unknown chains or empty ranges."""
        return Reach(model, *strokes_of(model.mechanism, stroke), threads)

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """The survey's values that this is judged by."""
        limited = np.isfinite(self.low).any() or np.isfinite(self.high).any()
        return ("joint",) if limited else ()

    def survey(self, q: np.ndarray, wanted: Collection[str] = ()) -> tuple[Survey, np.ndarray]:
        """A survey, and each chain's margin (n, N): negative where it forbids the pose.

        Poses beyond a stroke count as unreachable. Margins are dimensionless and continuous,
        no number where the contacts are not met.
        """
        survey = self.model.poses.survey(q, {*wanted, *self.needs}, self.threads)
        margin = np.where(survey.status == Status.overlap, np.nan, survey.discriminant)
        if self.needs:
            joint = survey.values["joint"]
            spans = np.where(np.isfinite(self.high - self.low), self.high - self.low, 1.0)
            inside = np.minimum(joint - self.low[:, None], self.high[:, None] - joint)
            margin = np.fmin(margin, inside / spans[:, None])
            beyond = survey.reached & (margin < 0).any(axis=0)
            survey.status[beyond] = Status.unreachable
            for value in survey.values.values():
                value[..., beyond] = np.nan
        return survey, margin

    def margin(self, q: np.ndarray) -> np.ndarray:
        """The least margin of all chains, (N,): negative, or no number, out of reach."""
        return self.survey(q)[1].min(axis=0)


def bounded(mechanism: Mechanism) -> list[int]:
    """Contacts that have bounds, by number."""
    return [i for i, c in enumerate(mechanism.contacts) if c.bounds != Bounds()]


def strokes_of(mechanism: Mechanism, given: Strokes) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest joint coordinates, (n,) each; infinite where nothing is said."""
    low = np.full(len(mechanism.chains), -np.inf)
    high = -low
    if isinstance(given, Mapping):
        pairs = [(name, ends, "") for name, ends in given.items()]
    else:
        texts = texts_of("stroke", given, separated=False)
        form = "chain=low:high unit", "leg_*=-200:300 mm", "stroke"
        pairs = [parsed(text, *form) for text in texts]  # type: ignore[misc]
    for pattern, ends, unit in pairs:
        where = f"stroke: {pattern}={ends[0]}:{ends[1]}"
        matching = [i for i, name in enumerate(mechanism.chain_names) if fnmatchcase(name, pattern)]
        if not matching:
            known = did_you_mean(pattern, mechanism.chain_names)
            raise InputError(f'{where}: no chain is called "{pattern}".{known}')
        for i in matching:
            kind = "angle" if FAMILIES[mechanism.chains[i].kind].joint_unit == "rad" else "length"
            scale = unit_factor(unit, (kind, 0), f"{where}: ") if unit else 1.0
            low[i], high[i] = (number(end, where) * scale for end in ends)
            if not low[i] < 0 < high[i]:
                raise InputError(
                    f'{where}: expected a range about home, such as "{pattern}=-0.1:0.2"'
                )
    return low, high
