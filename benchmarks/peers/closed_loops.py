"""Forward in time with all loops closed by constraints: what simulators do with the mechanism.

Six cranks, six couplers and the platform are bodies of one tree, cut at both ends of the couplers
and closed there by point constraints. An engine has no contact that keeps a point on a plane, so a
shoe of next to no mass slides in each plane and is tied to the platform. Springs and dampers act on
X, Y, alpha and beta, the efforts are zero.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from .closure import Closure
from .mechanism import Array, Contact, Mechanism, read

SHOE = 1e-6  # kg
SLIDES = ("1 0 0", "0 1 0", "0 0 1")
INDEPENDENT = [0, 1, 3, 4]
# Of MuJoCo's constraints: the shortest time constant that it allows, in steps, and how hard.
SOFTNESS, HARDNESS = 2, "0.9999 0.9999 0.001"


@dataclass(frozen=True)
class Task:
    """stiffness, damping: (4,) on X, Y, alpha, beta [N/m, N m; N s/m, N m s]; start: q at rest."""

    mechanism: dict[str, Any]
    stiffness: Array
    damping: Array
    start: Array
    duration: float = 1.0


@dataclass(frozen=True)
class Run:
    """q at the end, (4,), largest gap of the loops there [m], seconds, and steps."""

    q: Array
    gap: float
    seconds: float
    steps: int


def simulate_mujoco(task: Task, step: float) -> Run:
    """By mj_step, which calls mj_forward once, with semi-implicit Euler; a loop in C."""
    import mujoco

    m = read(task.mechanism)
    model = mujoco.MjModel.from_xml_string(_mjcf(m, task, step))
    data = mujoco.MjData(model)
    data.qpos[:] = _coordinates(m, task.start)
    steps = round(task.duration / step)
    begin = time.perf_counter()
    mujoco.mj_step(model, data, nstep=steps)
    seconds = time.perf_counter() - begin
    mujoco.mj_forward(model, data)
    gap = float(np.abs(data.efc_pos).max())
    return Run(data.qpos[INDEPENDENT].copy(), gap, seconds, steps)


def simulate_pinocchio(task: Task, step: float) -> Run:
    """By constraintDynamics, with semi-implicit Euler and Baumgarte's correction; from Python."""
    import pinocchio as pin

    m = read(task.mechanism)
    model, ties = _tree(pin, m)
    constraints, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for tie in ties:
        gains = tie.m_baumgarte_parameters  # as of Pinocchio 4
        gains.Kp, gains.Kd = 0.1 / step**2, 2 * np.sqrt(0.1) / step
        tie.m_baumgarte_parameters = gains
        constraints.append(tie)
        datas.append(tie.createData())
    data = model.createData()
    settings = pin.ProximalSettings(1e-12, 1e-12, 10)
    pin.initConstraintDynamics(model, data, constraints, datas)
    q, v, tau = _coordinates(m, task.start), np.zeros(model.nv), np.zeros(model.nv)
    steps = round(task.duration / step)
    begin = time.perf_counter()
    for _ in range(steps):
        tau[INDEPENDENT] = -task.stiffness * q[INDEPENDENT] - task.damping * v[INDEPENDENT]
        v = v + step * pin.constraintDynamics(model, data, q, v, tau, constraints, datas, settings)
        q = q + step * v
    seconds = time.perf_counter() - begin
    pin.constraintDynamics(model, data, q, v, tau, constraints, datas, settings)
    gap = max(float(np.abs(d.c1Mc2.translation).max()) for d in datas)
    return Run(q[INDEPENDENT], gap, seconds, steps)


def _coordinates(m: Mechanism, q: Array) -> Array:
    """Of the tree, where all loops are closed: platform, then crank and coupler, then shoes."""
    closure, still = Closure(m), np.zeros(4)
    b = closure.place(q, still, still)
    c = closure.move(b)
    found = [b.p, _angles(b.R)]
    for i, chain in enumerate(m.chains):
        away = c.motion.reshape(6, 3, 3)[i, 0] - chain.joint
        theta = np.arctan2(c.sin_theta[i], c.cos_theta[i])
        found += [[theta], chain.N.T @ away, c.turns[0].T[i]]
    for contact in m.contacts:
        away = b.p + b.R @ contact.point - contact.point
        found.append(_plane(contact)[:, :2].T @ away)
    return np.concatenate(found)


def _angles(R: Array) -> Array:
    """alpha, beta, gamma of R = Rx Ry Rz."""
    alpha, gamma = np.arctan2(-R[1, 2], R[2, 2]), np.arctan2(-R[0, 1], R[0, 0])
    return np.array([alpha, np.arcsin(R[0, 2]), gamma])


def _plane(contact: Contact) -> Array:
    """Axes as columns, (3, 3): two in the plane, and its normal."""
    n = contact.normal / np.linalg.norm(contact.normal)
    a = np.cross(n, [0.0, 1.0, 0.0])
    a /= np.linalg.norm(a)
    return np.column_stack([a, np.cross(n, a), n])


def _row(values: Any) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _joints(kind: str, axes: tuple[str, ...]) -> str:
    return "".join(f'<joint type="{kind}" axis="{axis}"/>' for axis in axes)


def _mjcf(m: Mechanism, task: Task, step: float) -> str:
    springs, dampers = np.zeros((2, 6))
    springs[INDEPENDENT], dampers[INDEPENDENT] = task.stiffness, task.damping
    sprung = "".join(
        f'<joint type="{"slide" if i < 3 else "hinge"}" axis="{SLIDES[i % 3]}" '
        f'stiffness="{float(springs[i])!r}" damping="{float(dampers[i])!r}"/>'
        for i in range(6)
    )
    sites = "".join(f'<site name="M{i}" pos="{_row(c.joint)}"/>' for i, c in enumerate(m.chains))
    sites += "".join(f'<site name="C{i}" pos="{_row(c.point)}"/>' for i, c in enumerate(m.contacts))
    entries = m.inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    bodies = [
        f'<body>{sprung}<inertial pos="0 0 0" mass="{m.mass!r}" fullinertia="{_row(entries)}"/>'
        f"{sites}</body>"
    ]
    ties = []
    for i, c in enumerate(m.chains):
        moments = _row([c.axial, c.transverse, c.transverse])
        bodies.append(
            f'<body pos="{_row(c.base)}" xyaxes="{_row([c.u, c.w])}">{_joints("hinge", SLIDES[2:])}'
            f'<inertial pos="0 0 0" mass="1e-9" diaginertia="{_row([c.crank_inertia] * 3)}"/>'
            f'<site name="T{i}" pos="{c.crank!r} 0 0"/></body>'
            f'<body pos="{_row(c.joint)}" xyaxes="{_row(c.N.T[:2])}">{_joints("slide", SLIDES)}'
            f"{_joints('hinge', SLIDES[1:])}"
            f'<inertial pos="{(c.com - 1) * c.coupler!r} 0 0" mass="{c.mass!r}" '
            f'diaginertia="{moments}"/>'
            f'<site name="E{i}"/><site name="S{i}" pos="{-c.coupler!r} 0 0"/></body>'
        )
        ties += [(f"M{i}", f"E{i}"), (f"T{i}", f"S{i}")]
    for i, contact in enumerate(m.contacts):
        axes = _row(_plane(contact).T[:2])
        bodies.append(
            f'<body pos="{_row(contact.point)}" xyaxes="{axes}">{_joints("slide", SLIDES[:2])}'
            f'<inertial pos="0 0 0" mass="{SHOE}" diaginertia="1e-9 1e-9 1e-9"/>'
            f'<site name="P{i}"/></body>'
        )
        ties.append((f"C{i}", f"P{i}"))
    held = "".join(
        f'<connect site1="{a}" site2="{b}" solref="{SOFTNESS * step!r} 1" solimp="{HARDNESS}"/>'
        for a, b in ties
    )
    return (
        '<mujoco><compiler angle="radian" inertiafromgeom="false"/>'
        f'<option timestep="{step!r}" gravity="{_row(m.gravity)}" tolerance="1e-12">'
        '<flag contact="disable"/></option>'
        f"<worldbody>{''.join(bodies)}</worldbody><equality>{held}</equality></mujoco>"
    )


def _tree(pin: Any, m: Mechanism) -> tuple[Any, list[Any]]:
    """The same tree, and its point constraints."""
    model, here = pin.Model(), pin.SE3.Identity()
    model.gravity.linear = m.gravity
    kinds = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ
    turns = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ

    def added(joints: Any, place: Any, body: Any) -> int:
        at = 0
        for i, joint in enumerate(joints):
            name = f"joint {model.njoints}"
            at = model.addJoint(at, joint(), here if i else place, name)
        model.appendBodyToJoint(at, body, here)
        return at

    def tied(a: int, at_a: Array, b: int, at_b: Array) -> Any:
        return pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            model,
            a,
            pin.SE3(np.eye(3), at_a),
            b,
            pin.SE3(np.eye(3), at_b),
            pin.ReferenceFrame.LOCAL,
        )

    zero, ties = np.zeros(3), []
    platform = added((*kinds, *turns), here, pin.Inertia(m.mass, zero, m.inertia))
    for c in m.chains:
        frame = pin.SE3(np.column_stack([c.u, c.w, np.cross(c.u, c.w)]), c.base)
        crank = added(turns[2:], frame, pin.Inertia(0.0, zero, c.crank_inertia * np.eye(3)))
        lever = np.array([(c.com - 1) * c.coupler, 0.0, 0.0])
        body = pin.Inertia(c.mass, lever, np.diag([c.axial, c.transverse, c.transverse]))
        coupler = added((*kinds, *turns[1:]), pin.SE3(c.N, c.joint), body)
        ties.append((platform, c.joint, coupler, zero))
        ties.append((crank, np.array([c.crank, 0, 0]), coupler, np.array([-c.coupler, 0, 0])))
    for contact in m.contacts:
        body = pin.Inertia(SHOE, zero, 1e-9 * np.eye(3))
        shoe = added(kinds[:2], pin.SE3(_plane(contact), contact.point), body)
        ties.append((platform, contact.point, shoe, zero))
    return model, [tied(*tie) for tie in ties]


SIMULATORS = {"mujoco": simulate_mujoco, "pinocchio": simulate_pinocchio}
