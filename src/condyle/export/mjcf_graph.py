"""A compiled model of MuJoCo as a graph: rigid bodies, and the joints and connects between them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from ..errors import InputError, UnsupportedError
from ..extras import require
from ..files.reading import require_file

OPEN = 1e-3  # of the model's extent: loops that are this far open at home are not closed
SAME = 1e-6  # of the model's extent: points this near are one
DIGITS = 12  # of coordinates in a file [m]: below this MuJoCo's own rounding begins
WORLD = 0


@dataclass(frozen=True)
class HomeJoint:
    """One elementary joint at home, in the world's frame.

    kind: "slide", "hinge", "ball" or "free";  axis (3,), of slides and hinges;  index: in the
    model, -1 for a connect;  up: +1 where the joint is counted away from the world.
    """

    kind: str
    point: np.ndarray
    axis: np.ndarray = field(default_factory=lambda: np.zeros(3))
    index: int = -1
    up: int = 1


def turned(steps: tuple[HomeJoint, ...]) -> tuple[HomeJoint, ...]:
    """The same joints from the other end."""
    return tuple(replace(step, up=-step.up) for step in reversed(steps))


@dataclass(frozen=True)
class Edge:
    """Steps that lead from one rigid body to another; `number`: of the edge, whichever way."""

    number: int
    start: int
    end: int
    steps: tuple[HomeJoint, ...]
    name: str = ""


@dataclass(frozen=True)
class RigidBody:
    """Rigidly joined bodies: mass [kg], centre (3,) [m] and inertia about it (3, 3), in {world}.

    weight: their mass, but 0 for a body that is there because MuJoCo has none without mass.
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    weight: float


@dataclass
class BodyGraph:
    """model: of MuJoCo;  data: at home;  edges: between rigid bodies, 0 is the world.

    origin: of {S}, (3,);  driven: joints that chains' actuators turn or move.
    notes: what a mechanism does not have of it.
    """

    model: Any
    data: Any
    edges: list[Edge] = field(default_factory=list)
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    driven: set[int] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)

    @property
    def near(self) -> float:
        """Points within this are one [m]."""
        return SAME * float(self.model.stat.extent)

    def at(self, body: int) -> Iterator[Edge]:
        """The edges that leave a body."""
        for e in self.edges:
            if e.start == body:
                yield e
            elif e.end == body:
                yield replace(e, start=e.end, end=e.start, steps=turned(e.steps))

    def group(self, body: int) -> int:
        """The rigid body that a body of the model belongs to."""
        return int(self.model.body_weldid[body])

    def name(self, group: int) -> str:
        return self.model.body(group).name or f"body {group}"

    def body(self, group: int) -> RigidBody:
        """The mass of all bodies that are one."""
        m, d = self.model, self.data
        parts = [i for i in range(m.nbody) if self.group(i) == group]
        mass = float(m.body_mass[parts].sum())
        centre = (m.body_mass[parts, None] * d.xipos[parts]).sum(axis=0) / (mass or 1.0)
        inertia = np.zeros((3, 3))
        for i in parts:
            R, r = d.ximat[i].reshape(3, 3), d.xipos[i] - centre
            inertia += R @ np.diag(m.body_inertia[i]) @ R.T
            inertia += m.body_mass[i] * (r @ r * np.eye(3) - np.outer(r, r))
        weight = 0.0 if float(m.body_gravcomp[group]) == 1.0 else mass
        return RigidBody(mass, centre, (inertia + inertia.T) / 2, weight)

    def sites(self, group: int | None = None) -> Iterator[tuple[str, np.ndarray]]:
        """Names and places of sites, of one rigid body or of all, in {world}."""
        for s in range(self.model.nsite):
            if group is None or self.group(int(self.model.site_bodyid[s])) == group:
                yield self.model.site(s).name, self.data.site_xpos[s]

    def tendons(self) -> Iterator[tuple[int, list[int]]]:
        """Spatial tendons, and the sites that they run by, if they run by sites alone."""
        m = self.model
        for t in range(m.ntendon):
            span = slice(int(m.tendon_adr[t]), int(m.tendon_adr[t] + m.tendon_num[t]))
            sites = [int(s) for s in m.wrap_objid[span]]
            yield t, sites if (m.wrap_type[span] == 3).all() else []

    def point(self, at: np.ndarray) -> list[float]:
        """A point of the world in {S}."""
        return [round(float(v), DIGITS) + 0.0 for v in at - self.origin]

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def read_graph(path: str | Path) -> BodyGraph:
    """A file of MuJoCo (MJCF, or URDF that it reads), at `qpos0` or the first keyframe that closes.

    Raises: InputError: if MuJoCo cannot read it;  UnsupportedError: for loops that stay open, or
            equations other than `connect`;  MissingExtraError: without MuJoCo.
    """
    require_file(path)
    require("mujoco", "mujoco")
    import mujoco

    model = _compiled(path, mujoco)
    others = {int(t) for t in model.eq_type} - {int(mujoco.mjtEq.mjEQ_CONNECT)}
    if others:
        kinds = ", ".join(sorted(mujoco.mjtEq(t).name[5:].lower() for t in others))
        raise UnsupportedError(
            f"{path}: it has equality constraints of kind {kinds}; a mechanism file has loops "
            "that `connect` closes, and nothing that stands for these. If condyle exported it, "
            "take the mechanism's own file: only planes, cylinders and spheres come back"
        )
    data = mujoco.MjData(model)
    gaps = []
    for key in range(-1, model.nkey):
        if key >= 0:
            mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        ends = [_ends(model, data, i, mujoco) for i in range(model.neq)]
        gaps.append(max((float(np.linalg.norm(a - b)) for *_, a, b in ends), default=0.0))
        if gaps[-1] <= OPEN * model.stat.extent:
            return _with_edges(BodyGraph(model, data), ends, mujoco)
    raise UnsupportedError(
        f"{path}: its loops are open at home, by {min(gaps) * 1e3:.3g} mm at least; let qpos0 or a "
        "keyframe close them"
    )


# A few lines of XML can stand for millions of bodies, and MuJoCo hears no signal while it reads.
SECONDS, BYTES, BODIES = 30, 4 << 30, 2000
_READ = f"""
import sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, ({BYTES}, {BYTES}))
    resource.setrlimit(resource.RLIMIT_FSIZE, ({BYTES >> 4}, {BYTES >> 4}))
except (ImportError, ValueError):
    pass
import mujoco
try:
    model = mujoco.MjModel.from_xml_path(sys.argv[1])
except (ValueError, MemoryError) as error:
    sys.exit(str(error) or "it needs too much memory")
if model.nbody > {BODIES}:
    sys.exit(f"it has {{model.nbody}} bodies, expected at most {BODIES}")
mujoco.mj_saveModel(model, sys.argv[2])
"""


def _compiled(path: str | Path, mujoco: Any) -> Any:
    """The model in a file, read by another process, with limits of time and memory.

    Raises: InputError: if MuJoCo cannot read it within them.
    """
    with TemporaryDirectory() as folder:
        binary = Path(folder) / "model.mjb"
        try:
            done = subprocess.run(
                [sys.executable, "-c", _READ, os.path.abspath(path), str(binary)],
                capture_output=True, text=True, errors="replace", timeout=SECONDS, cwd=folder,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise InputError(f"{path}: MuJoCo has not read it after {SECONDS} s") from None
        if done.returncode:
            why = done.stderr.strip() or f"it ended with status {done.returncode}"
            raise InputError(f"{path}: MuJoCo cannot read it: {why[-1000:]}")
        return mujoco.MjModel.from_binary_path(str(binary))


def _ends(model: Any, data: Any, i: int, mujoco: Any) -> tuple[int, int, np.ndarray, np.ndarray]:
    """The bodies that a connect holds together, and where each is held."""
    ids = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    if int(model.eq_objtype[i]) == int(mujoco.mjtObj.mjOBJ_SITE):
        a, b = (data.site_xpos[k].copy() for k in ids)
        return int(model.site_bodyid[ids[0]]), int(model.site_bodyid[ids[1]]), a, b
    anchors = zip(ids, (model.eq_data[i, :3], model.eq_data[i, 3:6]), strict=True)
    a, b = (data.xpos[k] + data.xmat[k].reshape(3, 3) @ at for k, at in anchors)
    return *ids, a, b


def _with_edges(
    graph: BodyGraph, ends: list[tuple[int, int, np.ndarray, np.ndarray]], mujoco: Any
) -> BodyGraph:
    """Joints of the tree, then connects."""
    m, d = graph.model, graph.data

    def add(first: int, second: int, steps: tuple[HomeJoint, ...], name: str = "") -> None:
        bodies = graph.group(first), graph.group(second)
        graph.edges.append(Edge(len(graph.edges), *bodies, steps, name))

    for body in range(1, m.nbody):
        first = int(m.body_jntadr[body])
        joints = range(first, first + int(m.body_jntnum[body]))
        kinds = [mujoco.mjtJoint(int(m.jnt_type[j])).name[6:].lower() for j in joints]
        steps = tuple(
            HomeJoint(kind, d.xanchor[j].copy(), d.xaxis[j].copy(), j)
            for j, kind in zip(joints, kinds, strict=True)
        )
        if steps:
            add(int(m.body_parentid[body]), body, steps)
    for i, (one, other, at, _) in enumerate(ends):
        if m.eq_active0[i]:
            add(one, other, (HomeJoint("ball", at),), m.equality(i).name)
    return graph
