"""A compiled model of MuJoCo as a graph: rigid bodies, and the joints and connects between them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError, UnsupportedError
from ..extras import require

OPEN = 1e-3  # of the model's extent: loops that are this far open at home are not closed
WORLD = 0


@dataclass(frozen=True)
class Step:
    """One elementary joint at home, in the world's frame.

    kind: "slide", "hinge", "ball" or "free";  axis (3,), of slides and hinges;  index: in the
    model, -1 for a connect;  up: +1 where the joint is counted away from the world.
    """

    kind: str
    point: np.ndarray
    axis: np.ndarray
    index: int = -1
    up: int = 1

    def reversed(self) -> Step:
        return Step(self.kind, self.point, self.axis, self.index, -self.up)


@dataclass(frozen=True)
class Edge:
    """Steps that lead from one rigid body to another."""

    start: int
    end: int
    steps: tuple[Step, ...]
    name: str = ""

    def leaving(self, body: int) -> Edge:
        """The same edge, seen from one of its bodies."""
        if self.start == body:
            return self
        steps = tuple(step.reversed() for step in reversed(self.steps))
        return Edge(self.end, self.start, steps, self.name)


@dataclass(frozen=True)
class Body:
    """Rigidly joined bodies: mass [kg], centre (3,) [m] and inertia about it (3, 3), in {world}."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray


@dataclass
class Graph:
    """model: of MuJoCo;  data: at home;  edges: between rigid bodies, 0 is the world."""

    model: Any
    data: Any
    edges: list[Edge] = field(default_factory=list)

    def at(self, body: int) -> list[Edge]:
        """The edges that leave a body."""
        return [e.leaving(body) for e in self.edges if body in (e.start, e.end)]

    def group(self, body: int) -> int:
        """The rigid body that a body of the model belongs to."""
        return int(self.model.body_weldid[body])

    def name(self, group: int) -> str:
        return self.model.body(group).name or f"body {group}"

    def body(self, group: int) -> Body:
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
        return Body(mass, centre, (inertia + inertia.T) / 2)


def read_graph(path: str | Path) -> Graph:
    """A file of MuJoCo (MJCF, or URDF that it reads), at `qpos0` or the first keyframe that closes.

    Raises: InputError: if MuJoCo cannot read it;  UnsupportedError: for loops that stay open, or
            equations other than `connect`;  MissingExtraError: without MuJoCo.
    """
    require("mujoco", "mujoco")
    import mujoco

    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise InputError(f"{path}: MuJoCo cannot read it: {str(error).strip()}") from None
    others = {int(t) for t in model.eq_type} - {int(mujoco.mjtEq.mjEQ_CONNECT)}
    if others:
        kinds = ", ".join(sorted(mujoco.mjtEq(t).name[5:].lower() for t in others))
        raise UnsupportedError(
            f"{path}: it has equality constraints of kind {kinds}; a mechanism file has loops "
            "that `connect` closes, and nothing that stands for these"
        )
    data = mujoco.MjData(model)
    gaps = []
    for key in range(-1, model.nkey):
        if key < 0:
            mujoco.mj_resetData(model, data)
        else:
            mujoco.mj_resetDataKeyframe(model, data, key)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        ends = [_ends(model, data, i, mujoco) for i in range(model.neq)]
        gaps.append(max((float(np.linalg.norm(a - b)) for *_, a, b in ends), default=0.0))
        if gaps[-1] <= OPEN * model.stat.extent:
            graph = Graph(model, data)
            graph.edges = [*_tree(graph, mujoco), *_connects(graph, ends)]
            return graph
    raise UnsupportedError(
        f"{path}: its loops are open at home, by {min(gaps) * 1e3:.3g} mm at least; let qpos0 or a "
        "keyframe close them"
    )


def _ends(model: Any, data: Any, i: int, mujoco: Any) -> tuple[int, int, np.ndarray, np.ndarray]:
    """The bodies that a connect holds together, and where each is held."""
    ids = int(model.eq_obj1id[i]), int(model.eq_obj2id[i])
    if int(model.eq_objtype[i]) == int(mujoco.mjtObj.mjOBJ_SITE):
        a, b = (data.site_xpos[k] for k in ids)
        return int(model.site_bodyid[ids[0]]), int(model.site_bodyid[ids[1]]), a.copy(), b.copy()
    anchors = model.eq_data[i, :3], model.eq_data[i, 3:6]
    a, b = (
        data.xpos[k] + data.xmat[k].reshape(3, 3) @ at for k, at in zip(ids, anchors, strict=True)
    )
    return *ids, a, b


def _tree(graph: Graph, mujoco: Any) -> Iterator[Edge]:
    m, d = graph.model, graph.data
    for body in range(1, m.nbody):
        first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
        if not count:
            continue
        steps = tuple(
            Step(
                mujoco.mjtJoint(int(m.jnt_type[j])).name[6:].lower(),
                d.xanchor[j].copy(),
                d.xaxis[j].copy(),
                j,
            )
            for j in range(first, first + count)
        )
        yield Edge(graph.group(int(m.body_parentid[body])), body, steps)


def _connects(graph: Graph, ends: list[tuple[int, int, np.ndarray, np.ndarray]]) -> Iterator[Edge]:
    for i, (first, second, at, _) in enumerate(ends):
        if graph.model.eq_active0[i]:
            step = Step("ball", at, np.zeros(3))
            name = graph.model.equality(i).name
            yield Edge(graph.group(first), graph.group(second), (step,), name)
