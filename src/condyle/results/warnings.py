"""Warnings as data: what the reader of results should know, with whose it is, when and how much.

watch = Watch(mechanism)
for derived, times in blocks:
    watch.see(derived, times)
notices = watch.notices()
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..kinematics.causes import cause_text, owners, shortfall_text
from ..kinematics.chain import FAMILIES
from ..kinematics.chain.muscle import muscles
from ..kinematics.singularities import NEAR_SINGULAR
from ..mechanism.chain import limits
from ..mechanism.home import HOME_WARNING, home_residuals, home_warnings
from ..mechanism.mechanism import Mechanism
from ..mechanism.mechanism_checks import mechanism_warnings
from ..mechanism.vocabulary import words_of
from ..status import POSED, STATUS_NAMES, Status
from .accuracy import FEW_DIGITS
from .contacts import BOUND_TOLERANCE
from .derived import Derived

POSE_RESIDUAL = 1e-9  # largest distance of given poses from the surfaces without a warning [m]


class WarningKind(NamedTuple):
    """A kind of warning: what it says, and what to do."""

    meaning: str
    advice: str


KINDS = {
    "implausible": WarningKind(
        "implausible numbers in the mechanism file",
        "`condyle check` shows sizes, masses, gravity and limits: mind the units",
    ),
    "home_residual": WarningKind(
        "a contact point is off its surface at home", "`condyle check --project` shows where it is"
    ),
    "bounds": WarningKind(
        "a contact leaves its bounds",
        "scale the motion, or move the bounds; `--strict` makes it an error",
    ),
    "contact_loss": WarningKind(
        "a unilateral contact is lost",
        "the ball would leave the surface: the model no longer holds there; "
        "`--distribution bounded` chooses efforts that press it on, where there are some",
    ),
    "contact_strain": WarningKind(
        "a contact gives more than its law holds for",
        "the indentation is large beside the layer, or the patch beside the ball: take "
        "`large_strain`, a thicker layer, or the pressures as a sign alone",
    ),
    "contact_edge": WarningKind(
        "the patch of a contact reaches beyond the bounds of its surface",
        "the law has no edge: pressures there are higher; scale the motion, or move the bounds",
    ),
    "contact_law": WarningKind(
        "a contact under load whose law has no answer",
        "ball and surface do not touch at a point there, or the layer is squeezed out: a smaller "
        "`radius`, a `length` for a line of contact, or a stiffer layer",
    ),
    "given_pose_residual": WarningKind(
        "poses off the contact surfaces",
        "the measured poses do not fit the surfaces; the dependent coordinates were recomputed",
    ),
    "failed_samples": WarningKind(
        "samples without a result (`--flag`)",
        "see their intervals and causes; scale the motion",
    ),
    "failed_variants": WarningKind(
        "variants with samples without a result (`--vary`)",
        "the bands leave them out; a study of the same numbers by `condyle sweep` has the reasons",
    ),
    "ambiguous": WarningKind(
        "efforts that do not determine the motion",
        "under friction this strong other motions follow from the same efforts: reduce friction, "
        "or change the motion; the theory page on what can go wrong has more",
    ),
    "near_singularity": WarningKind(
        "samples near a singularity",
        f"ratio below {NEAR_SINGULAR:g}: torques grow, and so does the effect of every error in "
        "the geometry",
    ),
    "accuracy": WarningKind(
        "samples with few digits",
        f"the bound of their relative error is above {FEW_DIGITS:g}: keep away from singularities; "
        "`--max-error` makes it an error",
    ),
    "effort_limit": WarningKind(
        "effort beyond a limit",
        "another actuator, or another motion; efforts of least norm know no limits, "
        "`--distribution bounded` keeps them",
    ),
    "ended": WarningKind(
        "a simulation that ended before its time",
        "`solution.condyle.events` says why, in which state",
    ),
    "speed_limit": WarningKind("speed above a limit", "another actuator, or another motion"),
    "slack": WarningKind(
        "a muscle whose line is no longer than its tendon: its tension is 0",
        "shorten `tendon_length`, or keep to poses where it is taut",
    ),
    "rod_angles": WarningKind(
        "gamma_i near 90 degrees",
        "a singularity of the two rod angles, not of the mechanism; `virtual_power` does not use "
        "them",
    ),
}

# Unit of what is met, factor for people, and what is said of it.
CONTACT_TEXTS = {
    "contact_strain": ("1", 100.0, "its law holds for small strains, which reach {:.3g} % {}"),
    "contact_edge": ("m", 1e3, "its patch reaches up to {:.3g} mm beyond the bounds, {}"),
    "contact_law": ("N", 1.0, "its law has no answer; the force is {:.4g} N {}"),
}
LOW = "effort_low"  # efforts below a lower limit of their own; reported as effort_limit


@dataclass(frozen=True)
class Notice:
    """A warning.

    kind:  one of `KINDS`; "other" in files that were written before there were kinds.
    text:  to read.
    owner: name of the chain or contact it is about;  status: of the samples that failed.
    count: samples or rows;  time: of the first [s], along a motion;  row: of a table, from 1.
    value, bound, unit: the largest or smallest that was met, and what it is held against.
    """

    kind: str
    text: str
    owner: str | None = None
    count: int | None = None
    time: float | None = None
    row: int | None = None
    value: float | None = None
    bound: float | None = None
    unit: str | None = None
    status: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """What is known, as JSON has it."""
        return {name: value for name, value in asdict(self).items() if value is not None}


class _Tally:
    """How often something was met, when first, and the largest of its size, so far."""

    def __init__(self) -> None:
        self.count, self.first, self.worst, self.worst_at = 0, 0.0, -np.inf, 0.0

    def see(self, where: np.ndarray, at: np.ndarray, size: np.ndarray) -> None:
        """Args: where: (N,), whether it is met;  at: (N,), times or rows;  size: (N,)."""
        met = np.flatnonzero(where)
        if not met.size:
            return
        if not self.count:
            self.first = at[met[0]].item()
        self.count += met.size
        largest = met[size[met].argmax()]
        if size[largest] > self.worst:
            self.worst, self.worst_at = size[largest].item(), at[largest].item()


class Watch:
    """Checks blocks of samples, in order, and collects warnings.

    Args: rows: samples are rows of a table and stand alone; otherwise they follow a motion.
          residual: largest distance of given poses from the contact surfaces [m].
    """

    def __init__(
        self, mechanism: Mechanism, rows: bool = False, residual: float | None = None
    ) -> None:
        self.mechanism: Mechanism = mechanism
        self.rows: bool = rows
        self.residual: float | None = residual
        self._tallies: dict[tuple[str, int, int], _Tally] = {}

    def see(self, derived: Derived, at: np.ndarray) -> None:
        """Look at a block.

        Args: at: times [s], or numbers of rows from 1, (N,).
        """
        e, ok = derived.evaluation, derived.ok
        configuration = e.configuration

        def tally(kind: str, i: int, where: np.ndarray, size: np.ndarray, status: int = 0) -> None:
            if status == 0 and not derived.all_ok:
                where = where & ok
            if where.any():
                self._tallies.setdefault((kind, i, status), _Tally()).see(where, at, size)

        with np.errstate(invalid="ignore"):
            for i in range(len(self.mechanism.contacts)):
                margin = derived.bound_margin[:, i]
                tally("bounds", i, margin < -BOUND_TOLERANCE, -margin)
                tally("contact_loss", i, derived.contact_loss[:, i], np.abs(e.contact_force[:, i]))
            for i, contact in enumerate(self.mechanism.contacts):
                if (law := contact.compliance) is None:
                    continue
                patch, loaded = derived.contact_patch, ~derived.contact_loss[:, i]
                strain, over = patch.strain[:, i], patch.reach[:, i] - derived.bound_margin[:, i]
                tally("contact_strain", i, strain > law.largest_strain, strain)
                tally("contact_edge", i, (over > 0) & (patch.reach[:, i] > 0), over)
                none = loaded & np.isnan(patch.indentation[:, i])
                tally("contact_law", i, none, np.abs(e.contact_force[:, i]))
            if "ambiguous" in vars(e):
                tally("ambiguous", 0, e.ambiguous, np.zeros(len(ok)))
            if "bound" in vars(e):
                tally("accuracy", 0, e.bound > FEW_DIGITS, e.bound)
            tally("near_singularity", 0, derived.near != 0, -configuration.singularity.ratio)
            for i in muscles(self.mechanism.chains):
                tally("slack", i, derived.muscle.slack[:, i], -derived.muscle.length[:, i])
            for i, chain in enumerate(self.mechanism.chains):
                limit, effort, speed = limits(chain), e.effort[:, i], np.abs(e.joint_rate[:, i])
                tally("speed_limit", i, speed > limit.speed, speed)
                if derived.limited:  # kept, to the accuracy of the certificate
                    continue
                if limit.symmetric:
                    size = np.abs(effort)
                    tally("effort_limit", i, size > limit.high, size)
                else:
                    tally("effort_limit", i, effort > limit.high, effort)
                    tally(LOW, i, effort < limit.low, -effort)
            flat = np.abs(configuration.cos_gamma)
            if (flat < NEAR_SINGULAR).any():
                for i in range(flat.shape[1]):
                    tally("rod_angles", i, flat[:, i] < NEAR_SINGULAR, -flat[:, i])
        if not derived.all_ok:
            for code in np.unique(derived.cause[~ok]):
                mine = derived.cause == code
                for status in np.unique(e.status[mine]):
                    of_both = mine & (e.status == status)
                    needed = status == Status.infeasible and derived.limited
                    size = derived.shortfall if needed else np.zeros(len(ok))
                    tally("failed_samples", int(code), of_both, size, int(status))

    def notices(self) -> list[Notice]:
        """What there is to say, in the order of `KINDS` and the words of the mechanism."""
        notices = list(home_notices(self.mechanism))
        if self.residual is not None and self.residual > POSE_RESIDUAL:
            notices.append(
                Notice(
                    "given_pose_residual",
                    f"the given poses are up to {self.residual * 1e3:.3g} mm off the contact "
                    "surfaces; the dependent coordinates were recomputed",
                    value=self.residual,
                    bound=POSE_RESIDUAL,
                    unit="m",
                )
            )
        order, say = list(KINDS), words_of(self.mechanism)
        notices += [self._notice(*key, self._tallies[key]) for key in sorted(self._tallies)]
        notices.sort(key=lambda notice: order.index(notice.kind))
        return [replace(notice, text=say(notice.text)) for notice in notices]

    def _notice(self, kind: str, i: int, status: int, tally: _Tally) -> Notice:
        about: dict[str, Any] = {"count": tally.count}
        about |= {"row": int(tally.first)} if self.rows else {"time": tally.first}
        when, worst, size = self._when(tally), self._at(tally.worst_at), tally.worst
        count = f"{tally.count} {'row' if self.rows else 'sample'}{'s' * (tally.count != 1)}"
        if kind == "failed_samples":
            owner = owners(self.mechanism)[i]
            left = "left without efforts" if status in POSED else "left empty"
            text = f"{count} {left}, first {self._at(tally.first)}: {cause_text(status, owner)}"
            named = owner.name or None
            if size > 0:
                text += f"; {shortfall_text(size)} {worst}"
                # What no limits would do for has no number: JSON knows none that is infinite.
                about |= {"value": size if np.isfinite(size) else None, "bound": 1.0, "unit": "1"}
            return Notice(kind, text, named, status=STATUS_NAMES[status], **about)
        # Owner, text, value and bound.
        name: str | None
        if kind in ("bounds", "contact_loss"):
            name, value, bound = self.mechanism.contact_names[i], size, 0.0
            if kind == "contact_loss":
                unit = "N"
                text = f"loses contact {when}: its surface would have to pull the ball"
            else:
                unit, text = "m", f"leaves its bounds {when}, by up to {size * 1e3:.3g} mm {worst}"
            text = f'contact "{name}" {text}'
        elif kind in CONTACT_TEXTS:
            contact = self.mechanism.contacts[i]
            name, value, (unit, factor, sentence) = contact.name, size, CONTACT_TEXTS[kind]
            bound = 0.0
            if kind == "contact_strain" and contact.compliance is not None:
                bound = contact.compliance.largest_strain
            text = f'contact "{name}" {when}: {sentence.format(size * factor, worst)}'
        elif kind == "ambiguous":
            name, value, bound, unit = None, None, None, None
            text = f"the efforts of {count} do not determine the motion, first "
            text += f"{self._at(tally.first)}: under friction other motions follow from them too"
        elif kind == "accuracy":
            name, value, bound, unit = None, size, FEW_DIGITS, "1"
            text = f"{count} with few digits: the relative error may be {size:.2g} {worst}"
        elif kind == "near_singularity":
            name, value, bound, unit = None, -size, NEAR_SINGULAR, "1"
            are = "is" if tally.count == 1 else "are"
            text = f"{count} {are} near a singularity (ratio below {NEAR_SINGULAR:g}), closest "
            text += f"{-size:.3g} {worst}"
        else:
            chain = self.mechanism.chains[i]
            name, family, limit = chain.name, FAMILIES[chain.kind], limits(chain)
            if kind == "slack":
                value, bound, unit = None, None, None
                text = f"{count} slack {worst}: its line is no longer than its tendon"
            elif kind == "rod_angles":
                value, bound, unit = -size, NEAR_SINGULAR, "1"
                text = (
                    f"its rod comes near gamma_i = +-90 degrees {worst}, where its two angles lose "
                    "their meaning; that is a singularity of the description, not of the mechanism"
                )
            elif kind == LOW:
                kind, value, bound, unit = "effort_limit", -size, limit.low, family.effort_unit
                text = f"effort falls to {-size:.4g} {unit} {worst}, below its minimum of {bound:g}"
            else:
                what, unit, bound, value = "effort", family.effort_unit, limit.high, size
                if kind == "speed_limit":
                    what, unit, bound = "speed", f"{family.joint_unit}/s", limit.speed
                text = f"{what} reaches {size:.4g} {unit} {worst}, above its limit of {bound:g}"
            text = f'chain "{name}": {text}'
        return Notice(kind, text, name, value=value, bound=bound, unit=unit, **about)

    def _at(self, place: float) -> str:
        return f"in row {int(place)}" if self.rows else f"at t = {place:g} s"

    def _when(self, tally: _Tally) -> str:
        if self.rows:
            return f"in {tally.count} rows, first {self._at(tally.first)}"
        return f"{self._at(tally.first)} ({tally.count} samples)"


def home_notices(mechanism: Mechanism) -> Iterable[Notice]:
    """Warnings about the mechanism file alone: unusual sizes, contacts off their surfaces."""
    for odd in mechanism_warnings(mechanism):
        yield Notice("implausible", str(odd))
    off = zip(mechanism.contact_names, home_residuals(mechanism), strict=True)
    far = [(name, float(value)) for name, value in off if abs(value) > HOME_WARNING]
    for (name, value), text in zip(far, home_warnings(mechanism), strict=True):
        yield Notice("home_residual", text, name, value=value, bound=HOME_WARNING, unit="m")
