"""The largest bite: what muscles, or other actuators within limits, can press at a point.

At rest, with gravity, each muscle within its limits at that pose, and unilateral contacts pushing:

    largest s >= 0:  J^T tension + N force = Q + s d,    low <= tension <= high,

d the reaction of a unit force on the platform at the point. One linear program a row.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import progress
from ..errors import InputError, as_name, brief, did_you_mean, join
from ..kinematics.chain.muscle import MuscleState
from ..mechanism.chain import limits
from ..mechanism.contact import Contact
from ..mechanism.mechanism import COORDINATES, Mechanism
from ..mechanism.vocabulary import words_of
from ..model.given import as_model
from ..model.model import Model
from ..motion import load_place
from ..motion.arrays import as_doubles
from ..results.contacts import joint_loads
from ..results.study_answer import StudyAnswer
from .map.axes import grid_of
from .map.load_capacity import largest_load

DOWN = (0.0, 0.0, -1.0)
OPENING = "opening"
MOST = 10_000  # poses
GAPE = 0.0201  # m: at their widest gape the incisor is down so much, Hannam et al. 2008,
BACK = 0.0058 / GAPE  # and goes back by this part of it


@dataclass(frozen=True, eq=False)
class Bite(StudyAnswer):
    """The largest force of every pose and direction, P poses and D directions.

    over:      what the poses are of, and its values (P,) [m or rad]; None: home alone.
    direction: of the force on the platform, in {S}, (D, 3), unit vectors.
    force:     (P, D) [N]; 0 where the pose alone is more than can be held, infinite where no limit
               is met, NaN where there is no such pose.
    effort:    (P, D, n) [N or N m], one of the ways to bite so;  contact: (P, D, k) [N].
    held:      (P, D, n), whether the bite would grow with this actuator's greatest effort.
    """

    mechanism: Mechanism
    point: str
    over: tuple[str, np.ndarray] | None
    direction: np.ndarray
    force: np.ndarray
    effort: np.ndarray
    contact: np.ndarray
    held: np.ndarray

    def saturated(self, pose: int = 0, direction: int = 0) -> list[str]:
        """Names of the actuators whose limits hold the bite there."""
        chains = self.mechanism.chain_names
        return [chains[i] for i in np.flatnonzero(self.held[pose, direction])]

    def __str__(self) -> str:
        lines = []
        for p in range(len(self.force)):
            where = ""
            if self.over is not None:
                name, values = self.over
                length = name in (OPENING, "X", "Y", "Z")
                size, unit = (1e3, "mm") if length else (180 / np.pi, "deg")
                where = f"{name} {size * values[p]:.4g} {unit}: "
            for d in range(len(self.direction)):
                towards = ", ".join(f"{x:.3g}" for x in self.direction[d])
                lines.append(f"{where}{self._words(p, d)} along ({towards})")
        return "\n".join(lines)

    def _words(self, p: int, d: int) -> str:
        force = self.force[p, d]
        if not np.isfinite(force):
            return "no such pose" if np.isnan(force) else "no limit"
        if not force:
            return "0 N: the pose itself cannot be held, or nothing pushes this way"
        names = self.mechanism.contact_names
        loads = joint_loads(self.mechanism, self.contact[p, d])
        borne = ", ".join(f"{name} {x:.4g} N" for name, x in zip(names, loads, strict=True))
        held = self.saturated(p, d)
        by = f"held by {join(held) if held else 'no limit'};"
        return "; ".join(filter(None, (f"{force:.4g} N", borne, by)))

    @property
    def data(self) -> dict[str, Any]:
        rows = [
            {
                "direction": self.direction[d].tolist(),
                **({} if self.over is None else {self.over[0]: float(self.over[1][p])}),
                "force": float(self.force[p, d]),
                "contacts": dict(
                    zip(self.mechanism.contact_names, self.contact[p, d].tolist(), strict=True)
                ),
                "saturated": self.saturated(p, d),
            }
            for p in range(len(self.force))
            for d in range(len(self.direction))
        ]
        return {"mechanism": self.mechanism.name, "point": self.point, "bites": rows}

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """A pose and direction per row."""
        P, D = self.force.shape
        columns: dict[str, np.ndarray] = {}
        if self.over is not None:
            columns[self.over[0]] = np.repeat(self.over[1], D)
        for i, axis in enumerate("xyz"):
            columns[f"direction_{axis}"] = np.tile(self.direction[:, i], P)
        columns["force"] = self.force.ravel()
        of_all = (
            ("contact", self.mechanism.contact_names, self.contact),
            ("tau", self.mechanism.chain_names, self.effort),
        )
        for prefix, of, a in of_all:
            columns |= {f"{prefix}_{n}": a[..., i].ravel() for i, n in enumerate(of)}
        return columns


def largest_bite(
    mechanism: Model | Mechanism | str | os.PathLike[str],
    point: str = "right_molar",
    direction: Any = DOWN,
    over: str | None = None,
) -> Bite:
    """The largest bite at a point of the platform, at rest, within all limits.

    Args:   mechanism: or a model, a file, a bundled name.
            point: a platform point by its name, or "x,y,z" [m] in {M}; several, separated by ";",
            share the bite in equal parts.
            direction: of the force on the platform in {S}, (3,), or several, (D, 3): an envelope.
            over: poses: "opening=0:40:9" or "opening=14" (downward displacement of the incisor
            [mm], 29 % of it backwards), or a coordinate as of maps, "beta=0:20:9 deg"; default:
            home.
    Raises: InputError: for an unknown point or coordinate, or chains without limits.
    """
    model = as_model(mechanism)
    machine = model.mechanism
    points = machine.platform.points
    if as_name(point, "point") not in points and not {*",;"} & {*point}:
        known = join(points) or "none: name one in platform.points"
        raise InputError(f"point: unknown point {brief(point)}; available: {known}")
    at = load_place(point, points)
    towards = _directions(direction)
    name, values, q = _poses(model, over)
    shape, n, k = (len(q), len(towards)), len(machine.chains), len(machine.contacts)
    force, held = np.full(shape, np.nan), np.zeros((*shape, n), dtype=bool)
    effort, contact = np.full((*shape, n), np.nan), np.full((*shape, k), np.nan)
    good = np.flatnonzero(np.isfinite(q).all(axis=1))
    found = model.inverse_kinematics(q[good])
    reached = found.status == 0
    rows, pose, joint = good[reached], found.pose[reached], found.joint[reached]
    low, high = _limits(machine, joint)
    ends = np.tile(np.reshape([_ends(c) for c in machine.contacts], (k, 2)), (len(rows), 1, 1))
    low, high = (np.hstack([own, ends[..., i]]) for i, own in enumerate((low, high)))
    with progress.step("linear programs", len(rows) * len(towards)) as advance:
        for d, one in enumerate(towards):
            A, needed, more = _balance(model, pose, at, one)
            for i, p in enumerate(rows):
                most = largest_load(A[i], needed[i], more[i], low[i], high[i])
                force[p, d] = 0.0 if most is None else most.s
                if most is not None:
                    effort[p, d], contact[p, d] = most.x[:n], most.x[n:]
                    held[p, d] = most.held[:n]
                advance(1)
    about = None if over is None else (name, values)
    return Bite(machine, point, about, towards, force, effort, contact, held)


def _ends(contact: Contact) -> tuple[float, float]:
    """Least and greatest force of a contact."""
    if not contact.one_sided:
        return -np.inf, np.inf
    return (0.0, np.inf) if contact.push > 0 else (-np.inf, 0.0)


def _directions(given: Any) -> np.ndarray:
    rows: np.ndarray = np.atleast_2d(as_doubles(given, "direction", "1", "xyz"))
    size = np.linalg.norm(rows, axis=-1, keepdims=True)
    if rows.ndim != 2 or rows.shape[1] != 3 or not np.isfinite(rows).all() or not size.all():
        raise InputError(
            'direction: expected x, y, z in {S}, such as "0,0,-1", (3,) or (D, 3), of a length '
            f"above 0, got {brief(given)}"
        )
    return np.asarray(rows / size)


def _poses(model: Model, over: str | None) -> tuple[str, np.ndarray, np.ndarray]:
    """What the poses are of, its values, and q, (P, m)."""
    m = len(model.independent)
    if over is None:
        return "", np.zeros(1), np.zeros((1, m))
    name, _, rest = str(over).partition("=")
    if name.strip() != OPENING:
        known = [*model.independent, OPENING]
        if name.strip() not in COORDINATES:
            where = f"over: expected a coordinate or {OPENING}, got {brief(name.strip())}."
            raise InputError(where + did_you_mean(name.strip(), known))
        grid = grid_of(model.mechanism, [over])
        if grid.size > MOST:
            raise InputError(f"over: expected at most {MOST} poses, got {grid.size}")
        return grid.axes[0].name, grid.axes[0].values, grid.block(0, grid.size)
    try:
        low, *more = (float(x) for x in rest.removesuffix("mm").split(":"))
        high, count = more or (low, 1.0)
    except ValueError:
        low, high, count = np.nan, np.nan, 0.0
    several = low < high and 2 <= count <= MOST and count == int(count)
    if not (0 <= low <= high < 1e3 and (several or not more)):
        raise InputError(
            "over: expected opening=FROM:TO:NUMBER or one opening in mm, such as opening=0:40:9 or "
            f"opening=14, got {brief(over)}"
        )
    if "incisor" not in model.mechanism.platform.points:
        raise InputError(
            "over: opening is the displacement of the point incisor, which this mechanism lacks"
        )
    values = np.linspace(low, high, int(count)) * 1e-3
    return OPENING, values, opened(model, values)


def opened(model: Model, openings: np.ndarray) -> np.ndarray:
    """q, (P, m), with the incisor `openings`, (P,) [m], below home and `BACK` of that behind."""
    place = np.column_stack([-BACK * openings, 0 * openings, -openings])
    still = np.zeros_like(place)
    q = model.poses.states(("x", "y", "z"), (place, still, still), landmark="incisor")[0]
    return np.asarray(q)


def _limits(machine: Mechanism, joint: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest efforts at rest, (P, n) each."""
    own = [limits(chain) for chain in machine.chains]
    low = np.tile([one.low for one in own], (len(joint), 1))
    high = np.tile([one.high for one in own], (len(joint), 1))
    state = MuscleState.of(machine.chains, joint, np.zeros_like(joint))
    mine = np.isfinite(state.passive).any(axis=0)
    low[:, mine] = state.passive[:, mine]
    high[:, mine] = state.passive[:, mine] + state.active[:, mine]
    if not np.isfinite(low).any() and not np.isfinite(high).any():
        why = words_of(machine)("no chain has an effort limit, so nothing limits the bite")
        raise InputError(f"{machine.name}: {why}")
    return low, high


def _balance(
    model: Model, pose: np.ndarray, at: np.ndarray, towards: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Columns of efforts and contacts, (P, 6, n + k), what they balance, (P, 6), and more by a
    force of 1 N."""
    still, sides = np.zeros_like(pose), []
    for force in (np.zeros(3), towards):
        ports = {"force": force, "moment": np.zeros(3), "point": at}
        given = {name: np.tile(value, (len(pose), 1)) for name, value in ports.items()}
        given |= {"pose": pose, "pose_rate": still, "pose_acceleration": still}
        sides.append(model.kernel("system").run(given).values)
    s = {name: np.moveaxis(value, -1, 0) for name, value in sides[0].items()}
    columns = np.concatenate([s["J"], s["normal"].transpose(0, 2, 1)], axis=2)
    return columns, s["Q"], np.moveaxis(sides[1]["Q"], -1, 0) - s["Q"]
