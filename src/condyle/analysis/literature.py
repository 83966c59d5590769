"""Published numbers of the human jaw beside what the bundled jaws give.

Ratios and directions where there are any: nobody has measured a force on a human condyle. Joint
load is the force along the normal of the fossa's surface; recruitment is `cubic`. A further row is
an entry of `ROWS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr

from ..errors import CondyleError
from ..kinematics.chain.muscle import MuscleState, muscles
from ..model.model import Model, derive
from ..motion import Motion, bundled_reference, reference_load
from ..results.study_answer import StudyAnswer
from ..simulation.plan import OpenLoop
from ..simulation.running import run
from ..simulation.simulated import solved
from ..simulation.simulating import planned
from .bite import GAPE, largest_bite, opened

CABLES, CURVED, NURBS = "human-jaw", "human-jaw-curved", "human-jaw-nurbs"
MUSCLES = "human-jaw-muscles"
JAWS = (CABLES, CURVED, NURBS, MUSCLES)
BITE = 100.0  # N
SLOPES = (20, 30, 40, 50)  # of the eminence [deg]
BEFORE_RELEASE = 0.020  # opening before a bite is released [m], assumed
AFTER_RELEASE = 0.012  # s, in Slager et al. 1997
HELD, STIFFNESS = 1e-3, 1e6  # of what is bitten on: s, N/m
NEAR = 0.2  # of a single published number, within which a computed one is like it
ROUNDED = 0.01  # of the ends of a range, which publications round

Computed = dict[str, float]


@dataclass(frozen=True)
class Row:
    """A published number, and how the model is asked for it.

    low, high: range of what was published, or a direction; equal for a single number, from which a
               computed one may differ by `NEAR` of it.
    published:    in words.   computed: numbers by what they are of.
    """

    what: str
    unit: str
    low: float
    high: float
    published: str
    source: str
    computed: Callable[[], Computed]


@dataclass(frozen=True)
class Compared:
    """A row with the numbers of the model."""

    row: Row
    computed: Computed

    @property
    def outside(self) -> list[str]:
        """What is not within the published range, or not near the one number published."""
        low, high = self.row.low, self.row.high
        room = NEAR if low == high else ROUNDED
        low, high = low - room * abs(low), high + room * abs(high)
        return [n for n, x in self.computed.items() if not low <= x <= high]

    @property
    def computed_text(self) -> str:
        """'human-jaw 0.44, human-jaw-curved 0.55 (outside)'."""
        return ", ".join(
            f"{name} {x:.3g}{' (outside)' * (name in self.outside)}"
            for name, x in self.computed.items()
        )


@dataclass(frozen=True)
class Literature(StudyAnswer):
    """All rows, for people, for programs and for the documentation."""

    rows: tuple[Compared, ...]

    def __str__(self) -> str:
        return "\n\n".join(
            f"{what}\n  computed:  {computed}\n  published: {published}\n  source: {source}"
            for what, computed, published, source in zip(*self.columns.values(), strict=True)
        )

    @property
    def columns(self) -> dict[str, list[str]]:
        return {
            "what": [c.row.what + (f" [{c.row.unit}]" if c.row.unit else "") for c in self.rows],
            "ours": [c.computed_text for c in self.rows],
            "published": [c.row.published for c in self.rows],
            "source": [c.row.source for c in self.rows],
        }

    @property
    def markdown(self) -> str:
        """A table for the documentation."""
        rows = zip(*self.columns.values(), strict=True)
        lines = [self.columns, ["---"] * len(self.columns), *rows]
        return "".join(f"| {' | '.join(line)} |\n" for line in lines)

    @property
    def data(self) -> dict[str, Any]:
        names = ("what", "unit", "low", "high", "source")
        return {
            "rows": [
                {name: getattr(c.row, name) for name in names}
                | {"theirs": c.row.published, "ours": c.computed, "outside": c.outside}
                for c in self.rows
            ]
        }


def literature() -> Literature:
    """Published numbers of the human jaw, and the bundled jaws' own.

    A number is *outside* where it is not within what was published, or more than 20 % away from a
    single published number.
    """
    return Literature(tuple(Compared(row, row.computed()) for row in ROWS))


# -- how the model is asked


@cache
def _model(name: str, slope: int | None = None) -> Model:
    """A bundled jaw; slope: of its planar eminences [deg]."""
    model = derive(name, distribution="cubic", backend="numpy")
    if slope is None:
        return model
    fall = [-float(np.tan(np.radians(slope))), 0.0]
    sides = {f"contact.{c}.surface.slope": fall for c in ("left_condyle", "right_condyle")}
    changed = model.mechanism.set(sides, keep="home")
    return derive(changed, distribution="cubic", backend="numpy")


def _static(model: Model, point: str, opening: float = 0.0) -> Any:
    """A static bite of `BITE` down at a point."""
    q = opened(model, np.array([opening]))[0]
    wrench = [0.0, 0.0, -BITE, 0.0, 0.0, 0.0]
    found = model.inverse_dynamics(q, 0 * q, 0 * q, wrench, point)
    if found.status != 0:
        raise CondyleError(f"{model.mechanism.name} cannot hold {BITE:g} N on {point}")
    return found


def _largest() -> Computed:
    return {
        name: float(largest_bite(_model(name), over="opening=14:15:2").force[0, 0])
        for name in (CABLES, MUSCLES)
    }


def _incisor_to_molar() -> Computed:
    def ratio(name: str) -> float:
        front, back = (
            largest_bite(_model(name), p).force[0, 0] for p in ("incisor", "right_molar")
        )
        return float(front / back)

    return {name: ratio(name) for name in JAWS}


def _premolar() -> Computed:
    """The bite at the middle of canine and first molar, on the left."""
    bites = {}
    for name in (CABLES, MUSCLES):
        machine = _model(name).mechanism
        ends = [np.array(machine.platform.points[p]) for p in ("left_canine", "left_molar")]
        middle = tuple(np.mean(ends, axis=0).tolist())
        points = {**machine.platform.points, "left_premolar": middle}
        changed = machine.set("platform.points", points)
        bites[name] = float(largest_bite(changed, "left_premolar").force[0, 0])
    return bites


def _widest() -> Computed:
    """Opening of the largest bite on the incisors [mm]."""
    bite = largest_bite(_model(MUSCLES), "incisor", over="opening=0:40:41")
    assert bite.over is not None
    return {MUSCLES: float(1e3 * bite.over[1][bite.force[:, 0].argmax()])}


def _incisor_joint() -> Computed:
    """Larger joint load of a bite on the incisors over that of the same on a molar."""
    points = ("incisor", "right_molar")
    loads = {
        name: [float(np.abs(_static(_model(name), p).contact_force).max()) for p in points]
        for name in JAWS
    }
    return {name: front / back for name, (front, back) in loads.items()}


def _balancing(point: str) -> Callable[[], Computed]:
    """Share of the left, balancing joint in the load of both, of a bite at a point on the right."""

    def computed() -> Computed:
        models = {f"{slope} degrees": _model(CABLES, slope) for slope in SLOPES}
        loads = {n: _static(m, point).contact_force for n, m in models.items()}
        loads["curved"] = _static(_model(CURVED), point).contact_force
        loads["nurbs"] = _static(_model(NURBS), point).contact_force
        return {name: float(left / (left + right)) for name, (left, right) in loads.items()}

    return computed


def _over_bite(which: Callable[[Any], float]) -> Callable[[], Computed]:
    return lambda: {name: which(_static(_model(name), "right_molar")) / BITE for name in JAWS}


def _way(name: str, opening: float) -> np.ndarray:
    """How far a condyle goes forward and down at an opening, (2,) [m]."""
    model = _model(name)
    pose = model.inverse_kinematics(opened(model, np.array([opening]))[0]).pose
    ball = np.array(model.mechanism.contacts[0].point)[[0, 2]]
    return (_moved(pose, ball) - ball) * [1, -1]


def _moved(pose: np.ndarray, point: np.ndarray) -> np.ndarray:
    """x and z of a point (x, z) of the platform, where the pose is symmetrical: about Y alone."""
    cos, sin = np.cos(pose[4]), np.sin(pose[4])
    return np.asarray(pose[[0, 2]] + np.array([[cos, sin], [-sin, cos]]) @ point)


@cache
def _chewing(name: str) -> tuple[float, float]:
    """The bundled chewing: the balancing joint's share at the largest bite, and the mean load
    of both joints while the jaw opens freely over that at the largest bite."""
    motion = Motion.from_csv(bundled_reference()[0], rate=50)
    found = _model(name).solve(motion, reference_load())
    joints = np.abs(found["contact_force"].values)
    bite = np.linalg.norm(found["load"].values[:, :3], axis=1)
    turning = found["pose_rate"].sel(coordinate="beta").values
    most, opening = joints[bite.argmax()], joints[(bite == 0) & (turning > 0)]
    share = most[0] / most.sum()
    return float(share), float(opening.sum(axis=1).mean() / most.sum())


def _while_chewing(which: int) -> Callable[[], Computed]:
    return lambda: {name: _chewing(name)[which] for name in JAWS}


def _inclination() -> Computed:
    ways = {name: _way(name, 1e-6) for name in (CABLES, CURVED, NURBS)}
    return {name: float(np.degrees(np.arctan2(*way[::-1]))) for name, way in ways.items()}


def _travel(axis: int) -> Callable[[], Computed]:
    return lambda: {name: float(1e3 * _way(name, GAPE)[axis]) for name in (CABLES, CURVED, NURBS)}


@cache
def unloading(name: str) -> xr.Dataset:
    """The unloading test: a bundled jaw bites `BITE` at rest on a spring between the incisors,
    `BEFORE_RELEASE` open, which breaks after `HELD`; the run goes on for `AFTER_RELEASE`.

    Excitations of muscles, or tensions of cables, stay as they were.
    """
    model = _model(name)
    chains, point = model.mechanism.chains, "incisor"
    start = opened(model, np.array([BEFORE_RELEASE]))[0]
    effort = np.asarray(_static(model, point, BEFORE_RELEASE).effort)
    if driven := muscles(chains):
        at = model.kernel("instant").run({"q": start[None], "q1": 0 * start[None]}).values
        state = MuscleState.of(chains, at["joint"].T, at["joint_rate"].T)
        effort = np.clip((effort - state.passive[0]) / state.active[0], 0, 1)
    tip = np.array(model.mechanism.platform.points[point])[[0, 2]]
    height = _moved(model.inverse_kinematics(start).pose, tip)[1] - tip[1]
    spring = {"kind": "unloading", "point": point, "stiffness": STIFFNESS, "break_time": HELD}
    tables = {
        "duration": HELD + AFTER_RELEASE,
        "rate": 2000.0,
        "rtol": 1e-6,
        "start": dict(zip(model.independent, start.tolist(), strict=True)),
        "load": [spring | {"rest": float(height) - BITE / STIFFNESS}],
    }
    began, plan = perf_counter(), planned(model, [tables])[0]
    drive = OpenLoop(np.zeros(1), effort[None], bool(driven))
    plan = replace(plan, drive=drive, activation=effort if driven else np.zeros(0))
    return solved(plan, run(plan), began)


@cache
def _unloading(name: str) -> tuple[float, float]:
    """Travel of the incisors [mm] `AFTER_RELEASE` a bite at the incisors is let go, and the
    jaw's angular acceleration then over that at once."""
    solution = unloading(name)
    let_go = int(np.flatnonzero(solution.load_mode.values[:, 0])[0])
    tip = np.array(_model(name).mechanism.platform.points["incisor"])[[0, 2]]
    ends = [_moved(pose, tip) for pose in solution.pose.values[[let_go, -1]]]
    model, q = _model(name), opened(_model(name), np.array([BEFORE_RELEASE]))[0]
    at_once = model.forward_dynamics(q, 0 * q, solution.effort.values[0]).acceleration
    last = solution.pose_acceleration.sel(coordinate="beta").values[-1]
    ratio = last / at_once[model.independent.index("beta")]
    return float(1e3 * np.linalg.norm(ends[1] - ends[0])), float(ratio)


def _released(which: int) -> Callable[[], Computed]:
    """Travel of those whose teeth have not met by then, or acceleration."""

    def computed() -> Computed:
        found = {name: _unloading(name) for name in (CABLES, MUSCLES)}
        apart = 1e3 * BEFORE_RELEASE
        return {name: x[which] for name, x in found.items() if which or x[0] < apart}

    return computed


HANNAM_RUN = (
    "chewing run stored with ArtiSynth's jaw model, dynjaw, commit bcda2050, of the kind of Hannam "
    "et al. 2008; its numbers computed from its files"
)
SLAGER = "Slager et al. 1997, J. Neurophysiol. 78, 3222-3233, abstract"
SKULLS = "PMC8734448, abstract"
SIDES = (
    "Korioth and Hannam 1994, J. Orofac. Pain 8, 178-189; Ferrario and Sforza 1994, "
    "PMID 7932264; abstracts"
)
LARGER = "above 0.5 (finite elements); not always (by muscle asymmetry)"

ROWS = (
    Row("Largest bite on one molar, incisors 14 mm apart", "N", 597, 847,
        "847 men, 597 women, 14 mm", "Scand. J. Dent. Res. 1993, 101, 171, PMID 8322012, abstract",
        _largest),
    Row("Largest bite on the incisors over that on one molar", "", 0.40, 0.48, "0.40 to 0.48",
        "Ferrario et al. 2004, J. Oral Rehabil. 31, 18-22, abstract", _incisor_to_molar),
    Row("Largest bite on one first premolar", "N", 441, 847,
        "at least 441 (submaximal clench of one man); less than on a molar",
        "AnyBody/ammr, commit ef387217, ForceFirstPreMolarLeftSubMax5.txt, of de Zee et al. 2007, "
        "J. Biomech. 40, 1192-1201", _premolar),
    Row("Opening of the largest bite on the incisors", "mm", 14, 28, "14 to 28 (a plateau)",
        "Paphangkorakit and Osborn 1997, J. Dent. Res., PMID 9042078, abstract", _widest),
    Row("Balancing joint's share of the joint loads, bite on one molar, by the eminence", "",
        0.5, 1, LARGER, SIDES, _balancing("right_molar")),
    Row("Balancing joint's share of the joint loads, bite on one canine, by the eminence", "",
        0.5, 1, LARGER, SIDES, _balancing("right_canine")),
    Row("Balancing joint's share at the largest bite, chewing, eminences alone", "",
        0.55, 0.55, "0.55 (24 of 44 N); by resultants with the walls 0.41", HANNAM_RUN,
        _while_chewing(0)),
    Row("Joint load in opening over that at the largest bite, chewing", "", 0, 1,
        "low in opening, highest at tooth contact",
        "Hannam et al. 2008, J. Biomech. 41, 1069-1076, abstract", _while_chewing(1)),
    Row("Load of both joints over a bite on one molar, eminences alone", "", 1.43, 1.43,
        "1.43 (44 N of the eminences; 1.9 by resultants with walls, which the model lacks)",
        HANNAM_RUN,
        _over_bite(lambda found: float(np.abs(found.contact_force).sum()))),
    Row("Muscle forces over a bite on one molar", "", 3.4, 3.4, "3.4 (with co-contraction)",
        HANNAM_RUN, _over_bite(lambda found: float(found.effort.sum()))),
    Row("Joint load of a bite on the incisors over that of the same on a molar", "", 1.0, 4.1,
        "1.0 to 4.1 (13 to 18 N in incision over 4.4 to 13 N in chewing; one macaque)",
        "Direct Measurement of Loads at the TMJ in Macaca arctoides (1981), abstract",
        _incisor_joint),
    Row("Incisors' travel 12 ms after a 100 N bite on them is let go", "mm", 4.5, 4.5, "4.5",
        SLAGER + "; 20 mm apart before: assumed", _released(0)),
    Row("Acceleration 12 ms after it is let go, over that at once", "", -0.05, 0.05,
        "about 0: constant velocity, by the closers' force-velocity property", SLAGER,
        _released(1)),
    Row("Inclination of the eminence at home, by the method of the smaller angles", "deg", 31.6,
        38.7, "31.6 to 38.7; 120 dry skulls", SKULLS, _inclination),
    Row("Inclination of the eminence at home, by the method of the larger angles", "deg", 44.1,
        58.4, "44.1 to 58.4; 120 dry skulls", SKULLS, _inclination),
    Row("Condyle's travel forward, incisors 20.1 mm down and 5.8 mm back", "mm", 4.9, 6.7,
        "4.9 right, 6.7 left", HANNAM_RUN, _travel(0)),
    Row("Condyle's travel down, there", "mm", 2.8, 3.6, "2.8 right, 3.6 left", HANNAM_RUN,
        _travel(1)),
)  # fmt: skip
