"""A parallel mechanism in a MuJoCo model as a mechanism of condyle, or a clear refusal.

The platform is the body to which most chains lead. Each limb from the world to it, through bodies
without other neighbours, is a chain; its joints, in turn, determine its kind:

    ball slide ball            SPS, two hinges at one point being as good as a ball
    slide ball ball            PSS
    hinge ball ball            RSS
    a spatial tendon           cable
    slide slide ball           a contact on a plane, and likewise for cylinder and sphere

What holds the platform to the world directly is a free joint or the joints of a contact.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UnsupportedError, join
from ..mechanism import Mechanism
from ..mechanism.bodies import Inertia
from ..mechanism.files import from_data
from .mjcf_graph import WORLD, BodyGraph, HomeJoint, read_graph, turned

PARALLEL = 1e-3  # sine
FEWEST = 3  # chains and contacts that make a body the platform
LINES = "ball slide ball (SPS), slide ball ball (PSS), hinge ball ball (RSS)"
PARALLEL_AXES = 1e-6  # sine, of a contact's joints
PLANE, SPHERE = 0, 2  # geoms of MuJoCo
OFF_LINE = 1e-3  # of a rod: what is nearer to its line is on it


@dataclass(frozen=True)
class ImportResult:
    """A mechanism, and notes of what it leaves out of the MuJoCo model."""

    mechanism: Mechanism
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Limb:
    """A way from the world to the platform: bodies between, elementary joints, and a name."""

    bodies: tuple[int, ...]
    steps: tuple[HomeJoint, ...]
    name: str


def from_mjcf(path: str | Path, name: str) -> ImportResult:
    """A mechanism called `name` from a file that MuJoCo reads.

    Raises: InputError, UnsupportedError: with what was found instead;  MechanismError: if it
            breaks the rules of the file format.
    """
    graph = read_graph(path)
    platform = _platform(graph, path)
    graph.origin = graph.body(platform).centre
    chains: list[dict[str, Any]] = []
    contacts = real_contacts(graph, platform)
    for edge in graph.at(platform):
        if edge.end == WORLD and edge.steps[0].index >= 0:  # it stands in the tree by itself
            contacts += seat(graph, platform, turned(edge.steps))
    for limb in _limbs(graph, platform):
        made = contact_of(graph, limb.steps, limb.name)
        if made is not None:
            contacts.append(made)
        else:
            chains.append(_chain(graph, limb))
    chains += _cables(graph, platform)
    _note_left_out(graph)
    if not chains:
        raise UnsupportedError(f"{path}: nothing drives its platform, {graph.name(platform)}")
    # As the actuators stand, so that controls are efforts in the same order.
    order = {graph.model.actuator(i).name: i for i in range(graph.model.nu)}
    data: dict[str, Any] = {
        "name": name,
        "gravity": [float(g) for g in graph.model.opt.gravity],
        "platform": _platform_table(graph, platform, chains, contacts),
        **({"contact": contacts} if contacts else {}),
        "chain": sorted(chains, key=lambda chain: order.get(chain["name"], len(order))),
    }
    return ImportResult(from_data(data, str(path)), tuple(graph.notes))


def _note_left_out(graph: BodyGraph) -> None:
    """Numbers of joints and laws of actuators that a mechanism has no place for, by name."""
    m = graph.model
    joints = range(m.njnt)
    passive = [j for j in joints if j not in graph.driven]

    def of_joints(what: str, among: Iterable[int], has: Callable[[int], bool]) -> None:
        if names := [m.joint(j).name or f"joint {j}" for j in among if has(j)]:
            graph.note(f"{what}: left out, at {join(names)}")

    for what, values in (
        ("damping of joints that no actuator drives", m.dof_damping),
        ("armature of joints that no actuator drives", m.dof_armature),
        ("friction of joints that no actuator drives", m.dof_frictionloss),
    ):
        owners = {int(j) for j in m.dof_jntid[np.asarray(values).reshape(m.nv, -1)[:, 0] > 0]}
        of_joints(what, passive, owners.__contains__)
    of_joints("springs of joints", joints, lambda j: np.ravel(m.jnt_stiffness[j])[0] > 0)
    of_joints("ranges of joints", joints, lambda j: bool(m.jnt_limited[j]))
    servos = [i for i in range(m.nu) if m.actuator_biastype[i] or m.actuator_gaintype[i]]
    if named := [m.actuator(i).name or f"actuator {i}" for i in servos]:
        graph.note(f"laws of actuators that are no plain motors: left out, at {join(named)}")


def _platform(graph: BodyGraph, path: str | Path) -> int:
    """The body that most connects, joints of others and tendons hold."""
    held = Counter(body for edge in graph.edges for body in (edge.start, edge.end))
    for _, sites in graph.tendons():
        if len(sites) == 2:
            held.update(graph.group(int(graph.model.site_bodyid[site])) for site in sites)
    del held[WORLD]
    best = max(held, key=lambda g: (held[g], graph.body(g).mass), default=WORLD)
    if held[best] < FEWEST:
        raise UnsupportedError(
            f"{path}: no body is held by {FEWEST} chains or more, so there is no platform; the "
            f"most is {held[best]} joints and connects"
            + (f" at {graph.name(best)}" if held else "")
            + ". A mechanism file is for parallel mechanisms, whose loops `connect` closes"
        )
    return best


def _limbs(graph: BodyGraph, platform: int) -> Iterator[Limb]:
    for first in graph.at(platform):
        if first.end == WORLD and first.steps[0].index >= 0:
            continue
        edge, name = first, first.name
        path: list[tuple[int, tuple[HomeJoint, ...]]] = [(platform, first.steps)]
        while edge.end != WORLD:
            here = edge.end
            onward = [e for e in graph.at(here) if e.number != edge.number]
            if len(onward) != 1:
                raise UnsupportedError(
                    f"{graph.name(here)} has {len(onward) + 1} neighbours; a chain goes from the "
                    "world to the platform without branches"
                )
            edge = onward[0]
            path.append((here, edge.steps))
            name = edge.name or name
        steps, bodies = _merged(graph, [(body, turned(s)) for body, s in reversed(path)])
        yield Limb(bodies, steps, _named(graph, steps, name, bodies))


def _merged(
    graph: BodyGraph, path: list[tuple[int, tuple[HomeJoint, ...]]]
) -> tuple[tuple[HomeJoint, ...], tuple[int, ...]]:
    """Joints, and the bodies between them; hinges at one point are a ball, their cross is none.

    Args: path: from the world: joints, and the body behind them.
    """
    turning = ("hinge", "ball")
    joints, bodies = list[HomeJoint](), list[int]()
    waiting: int | None = None
    for body, steps in path:
        for step in steps:
            last = joints[-1] if joints else step
            both = bool(joints) and last.kind in turning and step.kind in turning
            if both and np.linalg.norm(last.point - step.point) < graph.near:
                joints[-1] = HomeJoint("ball", last.point)
                if waiting is not None:
                    graph.note(f"{graph.name(waiting)}: the cross of a universal joint has no mass")
            else:
                joints.append(step)
                bodies += [] if waiting is None else [waiting]
            waiting = None
        waiting = body
    return tuple(joints), tuple(bodies)


def _named(
    graph: BodyGraph, steps: tuple[HomeJoint, ...], connect: str, bodies: tuple[int, ...]
) -> str:
    """A limb's name: of the driven joint, else of one that slides, the connect, or a body."""
    m = graph.model
    driven = {int(m.actuator_trnid[i, 0]) for i in range(m.nu) if m.actuator_trntype[i] in (0, 1)}
    joints = [step for step in steps if step.index >= 0]
    joints.sort(key=lambda step: (step.index not in driven, step.kind != "slide"))
    named = [m.joint(step.index).name for step in joints]
    return next(filter(None, [*named, connect, *map(graph.name, bodies)]), "chain")


def _chain(graph: BodyGraph, limb: Limb) -> dict[str, Any]:
    kinds = " ".join(step.kind for step in limb.steps)
    makers = {"ball slide ball": _sps, "slide ball ball": _pss, "hinge ball ball": _rss}
    if kinds not in makers:
        raise UnsupportedError(
            f'chain "{limb.name}": from the world to the platform it has {kinds or "no joint"}; '
            f"expected {LINES}, where two or three hinges at one point count as a ball"
        )
    platform = graph.point(limb.steps[-1].point)
    return {"name": limb.name, "platform": platform, **makers[kinds](graph, limb)}


def _sps(graph: BodyGraph, limb: Limb) -> dict[str, Any]:
    base, slide, top = limb.steps
    leg = top.point - base.point
    n = leg / np.linalg.norm(leg)
    if np.linalg.norm(np.cross(slide.axis, n)) > PARALLEL:
        raise UnsupportedError(f'chain "{limb.name}": its slide is not along the leg')
    lower, upper = limb.bodies
    return {
        "kind": "SPS",
        "base": graph.point(base.point),
        "cylinder": part(graph, f"cylinder of {limb.name}", lower, base.point, n),
        "piston": part(graph, f"piston of {limb.name}", upper, top.point, -n),
        **actuator_of(graph, slide, slide.up * float(np.sign(slide.axis @ n)), limb.name),
    }


def _pss(graph: BodyGraph, limb: Limb) -> dict[str, Any]:
    slide, ball, top = limb.steps
    slider, rod = limb.bodies
    return {
        "kind": "PSS",
        "base": graph.point(ball.point),
        "axis": [float(v) for v in slide.up * slide.axis],
        "slider": {"mass": graph.body(slider).weight},
        "rod": part(graph, f"rod of {limb.name}", rod, ball.point, top.point - ball.point, True),
        **actuator_of(graph, slide, 1.0, limb.name),
    }


def _rss(graph: BodyGraph, limb: Limb) -> dict[str, Any]:
    shaft, ball, top = limb.steps
    crank, coupler = graph.body(limb.bodies[0]), limb.bodies[1]
    axis = shaft.up * shaft.axis
    pivot = shaft.point + axis * (axis @ (ball.point - shaft.point))
    arm = crank.centre - pivot
    off = arm - axis * (axis @ arm)
    inertia = axis @ crank.inertia @ axis + crank.mass * (off @ off)
    line, length = top.point - ball.point, float(np.linalg.norm(ball.point - pivot))
    table, along = {"inertia": float(inertia)}, (ball.point - pivot) / length
    com = float(off @ along)
    side = float(np.linalg.norm(off - com * along))
    if crank.weight and max(abs(com), side) > 1e-9 * length:
        table |= {"mass": crank.weight, "com": com}
    if side > 1e-3 * length:
        graph.note(
            f"crank of {limb.name}: its mass centre is {side * 1e3:.3g} mm off the line to its "
            "tip; moved onto it"
        )
    return {
        "kind": "RSS",
        "base": graph.point(pivot),
        "axis": [float(v) for v in axis],
        "crank_tip": graph.point(ball.point),
        "crank": table,
        "coupler": part(graph, f"coupler of {limb.name}", coupler, ball.point, line, True),
        **actuator_of(graph, shaft, 1.0, limb.name),
    }


def _cables(graph: BodyGraph, platform: int) -> Iterator[dict[str, Any]]:
    for t, sites in graph.tendons():
        name = graph.model.tendon(t).name or f"cable {t + 1}"
        bodies = [graph.group(int(graph.model.site_bodyid[s])) for s in sites]
        if sorted(bodies) != sorted((WORLD, platform)):
            raise UnsupportedError(
                f'tendon "{name}": a cable runs straight from a site of the world to one of the '
                "platform"
            )
        base, end = (graph.data.site_xpos[sites[bodies.index(b)]] for b in (WORLD, platform))
        ends = {"base": graph.point(base), "platform": graph.point(end)}
        yield {"name": name, "kind": "cable", **ends, **cable_actuator(graph, t)}


def _platform_table(
    graph: BodyGraph, platform: int, chains: list[dict[str, Any]], contacts: list[dict[str, Any]]
) -> dict[str, Any]:
    body = graph.body(platform)
    scale = 1e-12 * float(np.trace(body.inertia))
    entries = Inertia.entries_of(body.inertia).items()
    inertia = {key: value for key, value in entries if abs(value) > scale}
    taken = [c["platform"] for c in chains] + [c["point"] for c in contacts]
    named = [(name, graph.point(at)) for name, at in graph.sites(platform) if name]
    points = {
        name: at
        for name, at in named
        if all(np.linalg.norm(np.subtract(at, p)) > 1e-9 for p in taken)
    }
    return {"mass": body.mass, "inertia": inertia, **({"points": points} if points else {})}


def contact_of(graph: BodyGraph, steps: tuple[HomeJoint, ...], name: str) -> dict[str, Any] | None:
    """The contact that joints from the world to a ball joint are, if they are one."""
    kinds, at = [step.kind for step in steps], steps[-1].point
    named = (n for n, place in graph.sites() if np.linalg.norm(place - at) < graph.near)
    name = next((n.removesuffix("_contact") for n in named if n.endswith("_contact")), name)
    surface: dict[str, Any]
    if kinds == ["slide", "slide", "ball"]:
        n = np.cross(steps[0].axis, steps[1].axis)
        if abs(n[2]) < 1e-6:
            raise UnsupportedError(
                f'contact "{name}": its plane is upright, which z = f(x, y) cannot be; turn the '
                "model"
            )
        surface = _plane(graph, n, at)
    elif sorted(kinds[:2]) == ["hinge", "slide"] and kinds[2:] == ["ball"]:
        hinge, slide = sorted(steps[:2], key=lambda step: step.kind)
        axis, arm = hinge.axis, at - hinge.point
        if np.linalg.norm(np.cross(slide.axis, axis)) > PARALLEL_AXES:
            return None
        radius = float(np.linalg.norm(arm - axis * (axis @ arm)))
        surface = {"kind": "cylinder", "point": graph.point(hinge.point)}
        surface |= {"axis": [float(v) for v in axis], "radius": radius}
    elif kinds == ["ball", "ball"]:
        radius = float(np.linalg.norm(at - steps[0].point))
        surface = {"kind": "sphere", "centre": graph.point(steps[0].point), "radius": radius}
    else:
        return None
    return _contact(graph, name, at, surface)


def _contact(
    graph: BodyGraph, name: str, at: np.ndarray, surface: dict[str, Any]
) -> dict[str, Any]:
    return {"name": name, "point": graph.point(at), "surface": surface}


def seat(graph: BodyGraph, platform: int, steps: tuple[HomeJoint, ...]) -> list[dict[str, Any]]:
    """Contacts that the platform's own joints stand for; a free joint stands for none.

    Raises: UnsupportedError: for other joints.
    """
    kinds = [step.kind for step in steps]
    turns = [k for k in kinds if k != "slide"]
    free = kinds.count("slide") == 3 and turns in (["ball"], ["hinge"] * 3)
    if kinds == ["free"] or free:
        return []
    if kinds == ["slide", "slide", "hinge", "hinge"]:
        if pair := _pair(graph, platform, steps):
            return pair
    elif turns:
        merged = steps
        if kinds[-3:] == ["hinge"] * 3 and len(kinds) > 3:
            merged = (*steps[:-3], HomeJoint("ball", steps[-1].point))
        if [s.kind for s in merged] == ["hinge", "hinge", "ball"]:
            merged = (HomeJoint("ball", merged[0].point), merged[2])
        if (made := contact_of(graph, merged, "contact")) is not None:
            return [made]
    raise UnsupportedError(
        f"the platform {graph.name(platform)} has the joints {' '.join(kinds)}; expected a "
        "free joint, or slides, hinges and a ball joint that keep a point on a plane, cylinder or "
        "sphere"
    )


def real_contacts(graph: BodyGraph, platform: int) -> list[dict[str, Any]]:
    """Pairs of a ball of the platform and a plane of the world: unilateral contacts."""
    m, d = graph.model, graph.data
    contacts = []
    for i in range(m.npair):
        kinds = {int(m.geom_type[g]): int(g) for g in (m.pair_geom1[i], m.pair_geom2[i])}
        if set(kinds) != {PLANE, SPHERE}:
            graph.note(f"contact pair {i + 1} is not a sphere on a plane; it is left out")
            continue
        wall, ball = kinds[PLANE], kinds[SPHERE]
        if [graph.group(int(m.geom_bodyid[g])) for g in (wall, ball)] != [WORLD, platform]:
            continue
        up, centre = d.geom_xmat[wall].reshape(3, 3)[:, 2], d.geom_xpos[ball]
        name = m.pair(i).name or f"contact_{i + 1}"
        if abs(up[2]) < 1e-6:
            graph.note(f"contact {name}: upright planes have no equivalent; left out")
            continue
        table = _contact(graph, name, centre, _plane(graph, up, centre))
        table |= {"side": "above" if up[2] > 0 else "below", "one_sided": True}
        if m.pair_dim[i] > 1 and m.pair_friction[i, 0] > 0:
            table["friction"] = {"coefficient": float(m.pair_friction[i, 0])}
        contacts.append(table)
    return contacts


def _pair(graph: BodyGraph, platform: int, steps: tuple[HomeJoint, ...]) -> list[dict[str, Any]]:
    """Two contacts on parallel planes: a hinge along their normal, and one along their line.

    The second may be anywhere on that line: a site of the platform whose name ends in _contact.
    """
    u, v, yaw, roll = steps
    n = np.cross(u.axis, v.axis)
    if np.linalg.norm(np.cross(n, yaw.axis)) > PARALLEL_AXES:
        return []
    contacts = [
        _contact(graph, name.removesuffix("_contact"), at, _plane(graph, n, at))
        for name, at in graph.sites(platform)
        if name.endswith("_contact")
        and np.linalg.norm(np.cross(at - roll.point, roll.axis)) < graph.near
    ]
    return contacts if len(contacts) == 2 else []


def _plane(graph: BodyGraph, n: np.ndarray, at: np.ndarray) -> dict[str, Any]:
    """The plane through a point with a normal."""
    a, b = (round(float(v), 12) + 0.0 for v in -n[:2] / n[2])
    x, y, z = graph.point(at)
    return {"kind": "plane", "slope": [a, b], "offset": z - a * x - b * y}


def part(
    graph: BodyGraph, what: str, group: int, start: np.ndarray, line: np.ndarray, rod: bool = False
) -> dict[str, float]:
    """Mass, mass centre along a line and moments, of a body taken as symmetric about it.

    rod: the centre is a part of the line's length, and the body may have no mass.
    """
    body = graph.body(group)
    length = float(np.linalg.norm(line))
    n, arm = line / length, body.centre - start
    com = float(arm @ n)
    off = float(np.linalg.norm(arm - com * n))
    axial = float(n @ body.inertia @ n)
    transverse = float((np.trace(body.inertia) - axial) / 2)
    across = np.linalg.svd(n[None])[2][1:]
    uneven = np.linalg.eigvalsh(across @ body.inertia @ across.T) - transverse
    side = body.inertia @ n - axial * n
    if off > OFF_LINE * max(abs(com), 1e-3):
        graph.note(f"{what}: its mass centre is {off * 1e3:.3g} mm off its line; moved onto it")
    if max(np.abs(uneven).max(), np.linalg.norm(side)) > 1e-3 * max(transverse, 1e-30):
        graph.note(f"{what}: it is not symmetric about its line; its inertia is averaged")
    return {
        "mass": body.weight if rod else body.mass,
        "com": min(max(com / length, 0.0), 1.0) if rod else max(com, 0.0),
        "transverse": transverse,
        "axial": min(axial, 2 * transverse),
    }


def actuator_of(graph: BodyGraph, step: HomeJoint, sign: float, name: str) -> dict[str, Any]:
    """The actuator of a driven joint; `sign`: of its coordinate against ours."""
    m = graph.model
    dof = int(m.jnt_dofadr[step.index])
    graph.driven.add(step.index)
    table = _losses(m.dof_armature[dof], m.dof_damping[dof], m.dof_frictionloss[dof])
    drives = _drives(m, step.index, joint=True)
    if not drives:
        graph.note(f"joint {name} has no actuator; it is taken as driven")
    if (limit := _limit(m, drives, sign)) is not None:
        low, high = limit
        key = "force_limit" if step.kind == "slide" else "torque_limit"
        table[key] = high if low == -high else limit
    speed = f"speed_limit_{name}"
    if any(m.numeric(i).name == speed for i in range(m.nnumeric)):
        table["speed_limit"] = float(m.numeric(speed).data[0])
    return {"actuator": table} if table else {}


def cable_actuator(graph: BodyGraph, tendon: int) -> dict[str, Any]:
    """The actuator of a tendon, which can only pull."""
    m = graph.model
    armature = getattr(m, "tendon_armature", np.zeros(m.ntendon))[tendon]
    table = _losses(armature, m.tendon_damping[tendon], m.tendon_frictionloss[tendon])
    limit = _limit(m, _drives(m, tendon, joint=False), -1.0)
    if limit is not None and limit[1] > 0:
        table["force_limit"] = [max(limit[0], 0.0), limit[1]]
    return {"actuator": table} if table else {}


def _losses(armature: float, damping: Any, friction: float) -> dict[str, Any]:
    values = {"rotor_inertia": armature, "viscous": np.ravel(damping)[0], "coulomb": friction}
    return {key: float(value) for key, value in values.items() if value > 0}


def _drives(m: Any, index: int, joint: bool) -> list[int]:
    """Actuators of a joint or a tendon."""
    of = [i for i in range(m.nu) if m.actuator_trnid[i, 0] == index]
    return [i for i in of if (int(m.actuator_trntype[i]) in (0, 1)) == joint]  # or jointinparent


def _limit(m: Any, drives: list[int], sign: float) -> list[float] | None:
    """Limits of force, or of a plain motor's control, through the gear; None without any."""
    for i in drives:
        gear = sign * float(m.actuator_gear[i, 0])
        motor = m.actuator_biastype[i] == 0 and m.actuator_gaintype[i] == 0
        ends = None
        if m.actuator_forcelimited[i]:
            ends = m.actuator_forcerange[i]
        elif m.actuator_ctrllimited[i] and motor:
            ends = m.actuator_ctrlrange[i] * m.actuator_gainprm[i, 0]
        if ends is not None and ends[0] < ends[1]:
            return sorted(float(gear * end) for end in ends)
    return None
