"""The way back: a parallel mechanism of MuJoCo's world as a mechanism of ours, or a clear no.

The platform is the body that most chains hold. Each way from the world to it, through bodies that
have no other neighbours, is a chain; its joints, one after another, say which:

    ball slide ball            SPS, two hinges at one point being as good as a ball
    slide ball ball            PSS
    hinge ball ball            RSS
    a spatial tendon           cable
    slide slide ball           a contact on a plane, and likewise for cylinder and sphere

What holds the platform to the world directly is a free joint or the joints of a contact.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import UnsupportedError
from ..mechanism import Mechanism
from ..mechanism.files import from_data
from .mjcf_contacts import contact_of, real_contacts, seat
from .mjcf_graph import WORLD, Body, Edge, Graph, Step, read_graph
from .mjcf_parts import Parts, across, actuator_of, cable_actuator

SAME = 1e-6  # of the model's extent: points this near are one
PARALLEL = 1e-3  # sine
FEWEST = 3  # chains and contacts that make a body the platform
LINES = "ball slide ball (SPS), slide ball ball (PSS), hinge ball ball (RSS)"


@dataclass(frozen=True)
class Found:
    """mechanism, and notes: what of the model it does not have."""

    mechanism: Mechanism
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Way:
    """From the world to the platform: bodies between, elementary joints, and a name."""

    bodies: tuple[int, ...]
    steps: tuple[Step, ...]
    name: str

    @property
    def kinds(self) -> str:
        return " ".join(step.kind for step in self.steps)


def from_mjcf(path: str | Path, name: str) -> Found:
    """A mechanism called `name` from a file that MuJoCo reads.

    Raises: InputError, UnsupportedError: with what was found instead;  MechanismError: if it
            breaks the rules of the file format.
    """
    graph = read_graph(path)
    platform = _platform(graph, path)
    parts = Parts(graph, graph.body(platform).centre)
    chains: list[dict[str, Any]] = []
    contacts = real_contacts(parts, platform)
    if (held := _held(graph, platform)) is not None:
        contacts += seat(parts, platform, held)
    for way in _ways(parts, platform):
        made = contact_of(parts, way.steps, way.name)
        if made is not None:
            contacts.append(made)
        else:
            chains.append(_chain(parts, way))
    chains += _cables(parts, platform)
    if not chains:
        raise UnsupportedError(f"{path}: nothing drives its platform, {graph.name(platform)}")
    data = {
        "name": name,
        "gravity": [float(g) for g in graph.model.opt.gravity],
        "platform": _platform_table(parts, platform, chains, contacts),
        "contact": contacts,
        "chain": _in_order(graph, chains),
    }
    if not contacts:
        del data["contact"]
    return Found(from_data(data, str(path)), tuple(parts.notes))


def _platform(graph: Graph, path: str | Path) -> int:
    """The body that most connects, joints of others and tendons hold."""
    held: Counter[int] = Counter()
    for edge in graph.edges:
        for body in (edge.start, edge.end):
            held[body] += 1
    for ends in _tendons(graph):
        held.update(graph.group(int(graph.model.site_bodyid[site])) for site in ends)
    del held[WORLD]
    best = sorted(held, key=lambda g: (-held[g], -graph.body(g).mass))
    if not best or held[best[0]] < FEWEST:
        raise UnsupportedError(
            f"{path}: no body is held by {FEWEST} chains or more, so there is no platform; the "
            f"most is {held[best[0]] if best else 0} joints and connects"
            + (f" at {graph.name(best[0])}" if best else "")
            + ". A mechanism file is for parallel mechanisms, whose loops `connect` closes"
        )
    return best[0]


def _held(graph: Graph, platform: int) -> tuple[Step, ...] | None:
    """The joints between world and platform, if it stands in the tree by itself."""
    for edge in graph.at(platform):
        if edge.end == WORLD and edge.steps[0].index >= 0:
            steps = edge.leaving(platform).steps
            return tuple(step.reversed() for step in reversed(steps))
    return None


def _ways(parts: Parts, platform: int) -> Iterator[Way]:
    graph = parts.graph
    for first in graph.at(platform):
        if first.end == WORLD and first.steps[0].index >= 0:
            continue
        path: list[Step | int] = list(first.steps)
        edge, name = first, first.name
        while edge.end != WORLD:
            here = edge.end
            onward = [e for e in graph.at(here) if not _same(e, edge.leaving(here))]
            if len(onward) != 1:
                raise UnsupportedError(
                    f"{graph.name(here)} has {len(onward) + 1} neighbours; a chain goes from the "
                    "world to the platform without branches"
                )
            edge = onward[0]
            path += [here, *edge.steps]
            name = edge.name or name
        upward = [s if isinstance(s, int) else s.reversed() for s in reversed(path)]
        steps, bodies = _merged(parts, upward)
        yield Way(bodies, steps, _named(graph, steps, name, bodies))


def _same(a: Edge, b: Edge) -> bool:
    pairs = zip(a.steps, b.steps, strict=False)
    return (a.end, len(a.steps)) == (b.end, len(b.steps)) and all(
        s.index == t.index and np.array_equal(s.point, t.point) for s, t in pairs
    )


def _merged(parts: Parts, path: list[Step | int]) -> tuple[tuple[Step, ...], tuple[int, ...]]:
    """Joints, and the bodies between them; hinges at one point are a ball, their cross is none."""
    graph = parts.graph
    near, turning = SAME * graph.model.stat.extent, ("hinge", "ball")
    steps, bodies = list[Step](), list[int]()
    waiting: int | None = None
    for item in path:
        if isinstance(item, int):
            waiting = item
            continue
        last = steps[-1] if steps else item
        both = bool(steps) and last.kind in turning and item.kind in turning
        if both and np.linalg.norm(last.point - item.point) < near:
            steps[-1] = Step("ball", last.point, np.zeros(3))
            if waiting is not None:
                parts.note(f"{graph.name(waiting)}: the cross of a universal joint has no mass")
        else:
            steps.append(item)
            bodies += [] if waiting is None else [waiting]
        waiting = None
    return tuple(steps), tuple(bodies)


def _named(graph: Graph, steps: tuple[Step, ...], connect: str, bodies: tuple[int, ...]) -> str:
    """As the joint that an actuator drives, else one that slides, the connect, or a body."""
    m = graph.model
    driven = {int(m.actuator_trnid[i, 0]) for i in range(m.nu) if m.actuator_trntype[i] in (0, 1)}
    joints = [step for step in steps if step.index >= 0]
    joints.sort(key=lambda step: (step.index not in driven, step.kind != "slide"))
    named = [m.joint(step.index).name for step in joints]
    return next(filter(None, [*named, connect, *map(graph.name, bodies)]), "chain")


def _chain(parts: Parts, way: Way) -> dict[str, Any]:
    makers = {"ball slide ball": _sps, "slide ball ball": _pss, "hinge ball ball": _rss}
    if way.kinds not in makers:
        raise UnsupportedError(
            f'chain "{way.name}": from the world to the platform it has {way.kinds or "no joint"}; '
            f"expected {LINES}, where two or three hinges at one point count as a ball"
        )
    return {"name": way.name, **makers[way.kinds](parts, way)}


def _sps(parts: Parts, way: Way) -> dict[str, Any]:
    base, slide, top = way.steps
    leg = top.point - base.point
    n = leg / np.linalg.norm(leg)
    if np.linalg.norm(np.cross(slide.axis, n)) > PARALLEL:
        raise UnsupportedError(f'chain "{way.name}": its slide is not along the leg')
    cylinder, piston = (parts.graph.body(b) for b in way.bodies)
    return {
        "kind": "SPS",
        "base": parts.point(base.point),
        "platform": parts.point(top.point),
        "cylinder": _leg(parts, f"cylinder of {way.name}", cylinder, base.point, n),
        "piston": _leg(parts, f"piston of {way.name}", piston, top.point, -n),
        **actuator_of(parts, slide, slide.up * float(np.sign(slide.axis @ n)), way.name),
    }


def _pss(parts: Parts, way: Way) -> dict[str, Any]:
    slide, ball, top = way.steps
    slider, rod = (parts.graph.body(b) for b in way.bodies)
    return {
        "kind": "PSS",
        "base": parts.point(ball.point),
        "axis": [float(v) for v in slide.up * slide.axis],
        "platform": parts.point(top.point),
        "slider": {"mass": parts.mass(way.bodies[0], slider)},
        "rod": _rod(parts, f"rod of {way.name}", way.bodies[1], rod, ball.point, top.point),
        **actuator_of(parts, slide, 1.0, way.name),
    }


def _rss(parts: Parts, way: Way) -> dict[str, Any]:
    shaft, ball, top = way.steps
    crank, coupler = (parts.graph.body(b) for b in way.bodies)
    axis = shaft.up * shaft.axis
    pivot = shaft.point + axis * (axis @ (ball.point - shaft.point))
    arm = crank.centre - pivot
    off = arm - axis * (axis @ arm)
    inertia = axis @ crank.inertia @ axis + crank.mass * (off @ off)
    if np.linalg.norm(off) > 1e-3 * np.linalg.norm(ball.point - pivot):
        parts.note(
            f"crank of {way.name}: its mass centre is {np.linalg.norm(off) * 1e3:.3g} mm off the "
            "shaft; its weight is left out"
        )
    return {
        "kind": "RSS",
        "base": parts.point(pivot),
        "axis": [float(v) for v in axis],
        "crank_tip": parts.point(ball.point),
        "platform": parts.point(top.point),
        "crank": {"inertia": float(inertia)},
        "coupler": _rod(
            parts, f"coupler of {way.name}", way.bodies[1], coupler, ball.point, top.point
        ),
        **actuator_of(parts, shaft, 1.0, way.name),
    }


def _rod(
    parts: Parts, what: str, index: int, body: Body, start: np.ndarray, end: np.ndarray
) -> dict[str, float]:
    length = float(np.linalg.norm(end - start))
    made = across(parts, what, body, start, (end - start) / length)
    com = min(max(made.pop("com") / length, 0.0), 1.0)
    return {"mass": parts.mass(index, body), "com": com, **made}


def _leg(parts: Parts, what: str, body: Body, start: np.ndarray, n: np.ndarray) -> dict[str, float]:
    made = across(parts, what, body, start, n)
    return {"mass": body.mass, "com": max(made.pop("com"), 0.0), **made}


def _tendons(graph: Graph) -> Iterator[tuple[int, int]]:
    """Sites of spatial tendons between two of them."""
    m = graph.model
    for t in range(m.ntendon):
        first, count = int(m.tendon_adr[t]), int(m.tendon_num[t])
        if count == 2 and int(m.wrap_type[first]) == 3:  # a site
            yield int(m.wrap_objid[first]), int(m.wrap_objid[first + 1])


def _cables(parts: Parts, platform: int) -> Iterator[dict[str, Any]]:
    graph = parts.graph
    m, d = graph.model, graph.data
    for t in range(m.ntendon):
        first = int(m.tendon_adr[t])
        sites = [int(s) for s in m.wrap_objid[first : first + int(m.tendon_num[t])]]
        name = m.tendon(t).name or f"cable {t + 1}"
        bodies = [graph.group(int(m.site_bodyid[s])) for s in sites]
        if sorted(bodies) != sorted((WORLD, platform)) or int(m.wrap_type[first]) != 3:
            raise UnsupportedError(
                f'tendon "{name}": a cable runs straight from a site of the world to one of the '
                "platform"
            )
        base, end = (d.site_xpos[sites[bodies.index(b)]] for b in (WORLD, platform))
        yield {
            "name": name,
            "kind": "cable",
            "base": parts.point(base),
            "platform": parts.point(end),
            **cable_actuator(parts, t),
        }


def _platform_table(
    parts: Parts, platform: int, chains: list[dict[str, Any]], contacts: list[dict[str, Any]]
) -> dict[str, Any]:
    graph = parts.graph
    body = graph.body(platform)
    I = body.inertia
    inertia = {"xx": I[0, 0], "yy": I[1, 1], "zz": I[2, 2]}
    inertia |= {"xy": I[0, 1], "xz": I[0, 2], "yz": I[1, 2]}
    scale = float(np.trace(I))
    inertia = {k: float(v) for k, v in inertia.items() if abs(v) > 1e-12 * scale}
    taken = [c["platform"] for c in chains] + [c["point"] for c in contacts]
    points = {}
    m, d = graph.model, graph.data
    for s in range(m.nsite):
        at = parts.point(d.site_xpos[s])
        mine = graph.group(int(m.site_bodyid[s])) == platform and m.site(s).name
        if mine and all(np.linalg.norm(np.subtract(at, p)) > 1e-9 for p in taken):
            points[m.site(s).name] = at
    table = {"mass": body.mass, "inertia": inertia}
    return table | ({"points": points} if points else {})


def _in_order(graph: Graph, chains: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """As the actuators stand, so that controls are efforts in the same order."""
    order = {graph.model.actuator(i).name: i for i in range(graph.model.nu)}
    return sorted(chains, key=lambda c: order.get(c["name"], len(order)))
