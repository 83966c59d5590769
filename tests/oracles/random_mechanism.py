"""Random mechanisms and states, well conditioned, as raw dictionaries of the mechanism format.

A mechanism is a perturbation of the reference robot's geometry (masticatory.toml, here), in mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from .closure import complete_state, contact_rows, dependent_coordinates, independent_coordinates
from .description import COORDINATES, Description, Raw, joint, load, read, rod_angles
from .rotations import X, bryant, platform_motion, unit

__all__ = [
    "dependent_coordinates",
    "independent_coordinates",
    "random_mechanism",
    "random_state",
    "toml_text",
]

Array = np.ndarray
Rng = np.random.Generator
SURFACES = ("plane", "quadratic", "sphere", "cylinder", "ellipsoid", "profile")
MIRROR = np.array([1, -1, 1])
# points [mm] and slopes in x and y: the two condyles, a guided incisor, two cheek guides
CONTACTS = (
    ("left_condyle", [-26.65, 72, 42.53], [-1.1, 0]),
    ("right_condyle", [-26.65, -72, 42.53], [-1.1, 0]),
    ("incisal_guide", [52.75, 0, 4.63], [0.3, 0]),
    ("left_guide", [15, 48, -12], [0.2, 1.6]),
    ("right_guide", [-5, -50, -20], [1.8, 0.4]),
)


def _list(values: Array) -> list[float]:
    return [float(v) for v in values]


def _tangents(n: Array) -> tuple[Array, Array]:
    t = unit(np.cross(n, [0.0, 1.0, 0.0]))
    return t, np.cross(n, t)


def random_surface(rng: Rng, kind: str, p: Array, slope: Array) -> Raw:
    """Table of a surface through the wall point p [mm] with dz/dx, dz/dy = slope there."""
    n = unit(np.array([-slope[0], -slope[1], 1.0]))
    outward = n * rng.choice([-1.0, 1.0])
    radius = rng.uniform(25, 60)
    if kind == "plane":
        return {"kind": kind, "slope": _list(slope), "offset": float(p[2] - slope @ p[:2])}
    if kind == "quadratic":
        xx, xy, yy = rng.uniform(-0.012, 0.012, 3)
        H = np.array([[2 * xx, xy], [xy, 2 * yy]])
        s = slope - H @ p[:2]
        offset = p[2] - s @ p[:2] - p[:2] @ H @ p[:2] / 2
        second = {"xx": float(xx), "xy": float(xy), "yy": float(yy)}
        return {"kind": kind, "offset": float(offset), "slope": _list(s)} | second
    if kind == "sphere":
        return {"kind": kind, "centre": _list(p - radius * outward), "radius": float(radius)}
    if kind == "cylinder":
        a, b = _tangents(n)
        angle = rng.uniform(0, np.pi)
        axis = a * np.cos(angle) + b * np.sin(angle)
        point = p - radius * outward + axis * rng.normal(0, 20)
        return {"kind": kind, "point": _list(point), "axis": _list(axis), "radius": float(radius)}
    if kind == "ellipsoid":
        semi_axes, rotation = rng.uniform(25, 60, 3), rng.uniform(-0.6, 0.6, 3)
        A = bryant(rotation) @ np.diag(semi_axes**2) @ bryant(rotation).T
        centre = p - A @ outward / np.sqrt(outward @ A @ outward)
        shape = {"semi_axes": _list(semi_axes), "rotation": _list(rotation)}
        return {"kind": kind, "centre": _list(centre)} | shape
    if kind == "profile":  # the same all across: only the slope along `direction` is kept
        angle = np.arctan2(slope[1], slope[0]) + rng.normal(0, 0.2)
        direction = np.array([np.cos(angle), np.sin(angle)])
        away = np.array([-12.5, -7, -3, 1.5, 4.5, 8, 12])
        z = (slope @ direction) * away + rng.uniform(-0.012, 0.012) * away**2
        z += p[2] - CubicSpline(away, z, bc_type="natural")(0)
        points = [_list(row) for row in np.stack([away + direction @ p[:2], z], axis=1)]
        return {"kind": kind, "direction": _list(direction), "points": points}
    raise ValueError(f'surface "{kind}" is not one of {", ".join(SURFACES)}')


def _contact(rng: Rng, i: int, kind: str, spread: float, ball: float) -> Raw:
    name, point, slope = CONTACTS[i]
    p = np.array(point, float) + rng.normal(0, 3 * spread, 3)
    tilt = np.array(slope) + rng.normal(0, 0.15 * spread, 2)
    table: Raw = {"name": name, "point": _list(p)}
    if kind == "ball":
        return table | {"kind": kind}
    if ball and kind != "profile":
        n = unit(np.array([-tilt[0], -tilt[1], 1.0]))
        above = bool(rng.integers(2))
        wall = random_surface(rng, kind, p - (ball if above else -ball) * n, tilt)
        if kind in ("sphere", "cylinder", "ellipsoid"):
            reached = read(_shell([table | {"surface": wall}])).contacts[0].surface
            up = reached.gradient(1e-3 * p) @ n > 0
            side = "outside" if up == above else "inside"
        else:
            side = "above" if above else "below"
        return table | {"ball_radius": ball, "side": side, "surface": wall}
    return table | {"surface": random_surface(rng, kind, p, tilt)}


def _shell(contacts: list[Raw]) -> Raw:
    inertia = {"xx": 1.0, "yy": 1.0, "zz": 1.0}
    platform = {"mass": 1.0, "inertia": inertia}
    return {"name": "", "length_unit": "mm", "platform": platform, "contact": contacts, "chain": []}


def _rod(rng: Rng, mass: float, length: float) -> Raw:
    """A rod's mass and central moments; length in metres."""
    transverse = mass * length**2 / 12 * rng.uniform(0.8, 1.3)
    axial = transverse * rng.uniform(0.005, 0.6)
    return {"mass": float(mass), "com": 0.0, "transverse": float(transverse), "axial": float(axial)}


def _chain(rng: Rng, kind: str, muscle: Raw, spread: float) -> Raw:
    """A chain near the place of one of the reference robot's."""
    base, tip, M = (
        np.array(muscle[key], float) + rng.normal(0, 2.5 * spread, 3)
        for key in ("base", "crank_tip", "platform")
    )
    crank = tip - base
    axis = np.array(muscle["axis"], float) + rng.normal(0, 0.1 * spread, 3)
    axis = unit(axis - crank * (axis @ crank) / (crank @ crank))
    table: Raw = {"name": muscle["name"], "kind": kind}
    length = float(np.linalg.norm(M - tip))
    rod = _rod(rng, rng.uniform(0.002, 0.02), length * 1e-3)
    rod["com"] = float(rng.uniform(0.3, 0.7))
    if kind == "RSS":
        crank_inertia = {"inertia": float(rng.uniform(3e-5, 1e-4))}
        places = {"base": _list(base), "axis": _list(axis), "crank_tip": _list(tip)}
        return table | places | {"platform": _list(M), "crank": crank_inertia, "coupler": rod}
    if kind == "PSS":
        rail = unit(np.cross(axis, crank)) * rng.choice([-1, 1])
        places = {"base": _list(tip), "axis": _list(rail), "platform": _list(M)}
        return table | places | {"slider": {"mass": float(rng.uniform(0.02, 0.1))}, "rod": rod}
    if kind == "SPS":
        base = tip + 0.5 * (tip - M)
        length = float(np.linalg.norm(M - base))
        table |= {"base": _list(base), "platform": _list(M)}
        for body in ("cylinder", "piston"):
            table[body] = _rod(rng, rng.uniform(0.004, 0.04), 0.6e-3 * length)
            table[body]["com"] = float(length * rng.uniform(0.2, 0.4))
        return table
    if kind == "cable":
        return table | {"base": _list(tip + 0.5 * (tip - M)), "platform": _list(M)}
    if kind == "muscle":
        base, length = tip + 0.5 * (tip - M), 1.5 * float(np.linalg.norm(tip - M))
        own = {"max_force": 100.0, "optimal_length": 0.4 * length, "tendon_length": 0.5 * length}
        return table | {"base": _list(base), "platform": _list(M), "muscle": own}
    raise ValueError(f'chain kind "{kind}" is not one of RSS, PSS, SPS, cable, muscle')


def _mirrored(table: Raw) -> Raw:
    """The right-hand twin of a left-hand chain or contact; a shaft is an axial vector."""
    other = {**table, "name": table["name"].replace("left", "right")}
    for key in ("base", "crank_tip", "platform", "point"):
        if key in table:
            other[key] = _list(MIRROR * np.array(table[key]))
    if "axis" in table:
        sign = -1 if table["kind"] == "RSS" else 1
        other["axis"] = _list(sign * MIRROR * np.array(table["axis"]))
    if "surface" in table:
        s = other["surface"] = dict(table["surface"])
        if s["kind"] not in ("plane", "quadratic", "sphere"):
            raise ValueError("symmetric contacts are planes, quadratics or spheres")
        if "centre" in s:
            s["centre"] = _list(MIRROR * np.array(s["centre"]))
        else:
            s["slope"] = [s["slope"][0], -s["slope"][1]]
        if "xy" in s:
            s["xy"] = -s["xy"]
    return other


def _inertia(rng: Rng) -> Raw:
    """A full tensor with positive principal moments that obey the triangle inequality."""
    second = np.diag(rng.uniform(2e-5, 1.4e-4, 3))  # integral of x x' dm
    R = bryant(rng.normal(0, 0.3, 3))
    J = R @ second @ R.T
    inertia = np.trace(J) * np.eye(3) - J
    names = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
    return {name: float(inertia[i]) for name, i in names.items()}


def random_mechanism(
    rng: Rng,
    families: Sequence[str] = ("RSS",),
    chains: int = 6,
    contacts: int = 2,
    surface: str | Sequence[str] = "plane",
    symmetric: bool = False,
    spread: float = 1.0,
    ball_radius: float = 0.0,
    tilted_gravity: bool = False,
    rod_along_x: bool = False,
    condition: float = 300.0,
) -> Raw:
    """A well conditioned mechanism as a raw dictionary that obeys formats.md, home on the contacts.

    Args:    families: chain kinds, given to the chains in turn, then shuffled;
             chains: number n, at least 6 - contacts; contacts: number k, 0 to 5;
             surface: a kind, several given in turn, or "mixed"; "ball" is a ball joint;
             symmetric: left and right are mirror images (n even, one family);
             spread: 1 moves points by about 3 mm, slopes by 0.15; 0 leaves the reference geometry;
             ball_radius: [mm]; surfaces but profiles are then walls, on a random side of the ball;
             rod_along_x: first chain's rod within 5 degrees of X_S (the other branch of N_i0);
             condition: accept only if the scaled Jacobians at home are better than this.
    """
    reference = load(Path(__file__).with_name("masticatory.toml"))
    kinds = (surface,) if isinstance(surface, str) else tuple(surface)
    if surface == "mixed":
        kinds = tuple(rng.permutation(SURFACES))
    for _ in range(1000):
        order = [families[i % len(families)] for i in range(chains)]
        rng.shuffle(order)
        draft = _draft(rng, reference, order, contacts, kinds, symmetric, spread, ball_radius)
        if tilted_gravity:
            draft["gravity"] = _list(bryant(rng.normal(0, 0.4, 3)) @ np.array([0, 0, -9.81]))
        if rod_along_x:
            _lay_along_x(rng, draft["chain"][0])
        d = read(draft)
        if np.all(np.isfinite(_home(d))) and conditions(d, np.zeros(6)) < condition:
            return draft
    raise ValueError("no well conditioned mechanism found")


def _draft(
    rng: Rng,
    reference: Raw,
    order: list[str],
    contacts: int,
    kinds: Sequence[str],
    symmetric: bool,
    spread: float,
    ball: float,
) -> Raw:
    muscles = [dict(chain) for chain in reference["chain"]]
    while len(muscles) < len(order):  # extra pairs: between two muscles of the same side
        left, other = (muscles[2 * i] for i in rng.choice(3, 2, replace=False))
        extra = {"name": f"extra{len(muscles) // 2 - 2}_left", "axis": left["axis"]}
        for key in ("base", "crank_tip", "platform"):
            between = np.array(left[key]) * 0.65 + np.array(other[key]) * 0.35
            extra[key] = _list(between + rng.normal(0, 3, 3))
        muscles += [extra, _mirrored(extra | {"kind": "RSS"})]
    table: list[Raw] = [_chain(rng, k, m, spread) for k, m in zip(order, muscles, strict=False)]
    touching = [_contact(rng, i, kinds[i % len(kinds)], spread, ball) for i in range(contacts)]
    if symmetric:
        for i in range(1, len(table), 2):
            table[i] = _mirrored(table[i - 1])
        if contacts > 1:
            touching[1] = _mirrored(touching[0])
    shift = np.zeros(3) if symmetric else rng.normal(0, 2 * spread, 3)
    landmarks = reference["platform"]["points"]
    points = {name: _list(np.array(p) + shift) for name, p in landmarks.items()}
    inertia = reference["platform"]["inertia"] if symmetric else _inertia(rng)
    platform = {"mass": float(rng.uniform(0.1, 0.4)), "inertia": inertia, "points": points}
    head = {"name": "random", "length_unit": "mm", "gravity": [0.0, 0.0, -9.81]}
    held = {"contact": touching} if touching else {}
    return head | {"platform": platform} | held | {"chain": table}


def _lay_along_x(rng: Rng, chain: Raw) -> None:
    """Move crank tip, slider or leg base so that the rod lies along X_S within 4 degrees."""
    key = "crank_tip" if chain["kind"] == "RSS" else "base"
    M, tip = np.array(chain["platform"]), np.array(chain[key])
    rod = unit(X + np.append(0.0, rng.uniform(-0.04, 0.04, 2))) * np.linalg.norm(M - tip)
    chain[key] = _list(M - rod)
    if chain["kind"] == "RSS":
        crank = unit(np.cross(rod, rng.normal(size=3))) * 22
        chain["base"] = _list(M - rod - crank)
        chain["axis"] = _list(unit(np.cross(crank, rod)))
    elif chain["kind"] == "PSS":
        chain["axis"] = _list(unit(rod + rng.normal(0, 10, 3)))


def _home(d: Description) -> Array:
    return np.array([joint(chain, chain.M)[0] for chain in d.chains])


def conditions(d: Description, pose: Array) -> float:
    """How badly placed a pose is; inf if out of reach, lengths scaled by the characteristic length.

    The worst of: condition of the actuator Jacobian on the free directions; 10 / smallest singular
    value of C in the dependent coordinates; 6 / |cos(rod, drive)|; 10 / cos(gamma_i).
    """
    motion, worst, rows = platform_motion(pose), 1.0, []
    scale = np.array([1, 1, 1, d.size, d.size, d.size])
    for chain in d.chains:
        P = motion.point(chain.M)[0]
        x, S = joint(chain, P)
        if not np.isfinite(x):
            return np.inf
        e = unit(P - S)
        drive = chain.axis
        if chain.kind == "RSS":
            drive = unit(np.cross(chain.axis, S - chain.G))
        grip = 1.0 if chain.kind in ("SPS", "cable") else e @ drive
        worst = max(worst, 6 / abs(grip), 10 / np.cos(rod_angles(chain, P - S)[1]))
        rows.append(e @ motion.jacobian(chain.M) / scale)  # rows of J, up to their sizes
    J = np.array(rows)
    if d.contacts:
        C = contact_rows(d, motion) / scale
        C /= np.linalg.norm(C, axis=1)[:, None]
        held = [COORDINATES.index(name) for name in dependent_coordinates(d)]
        singular = np.linalg.svd(C[:, held])[1]
        worst = max(worst, 10 / singular[-1])
        J = J @ np.linalg.svd(C)[2][len(C) :].T
    singular = np.linalg.svd(J)[1]
    return max(worst, singular[0] / singular[-1]) if len(J) >= J.shape[1] else np.inf


def random_state(
    rng: Rng,
    description: Raw | Description,
    size: int = 1,
    scale: float = 1.0,
    condition: float = 300.0,
) -> dict[str, Any]:
    """Reachable independent states with rates, accelerations and a wrench at the load point.

    Up to 0.05 characteristic lengths (3 mm on the reference robot) and 0.08 rad, times `scale`; the
    wrench is some five times the platform's weight. scale = 0: home, yet with rates.
    Returns: names; q, qd, qdd, (size, 6 - k); wrench, (size, 6);
             load_point: right_molar, else the first point, else None (the mass centre);
             pose, pose_rate, pose_acceleration, (size, 6).
    """
    d = read(description)
    names, weight = independent_coordinates(d), 9.81 * d.mass
    length = np.array([d.size if name in "XYZ" else 1.6 for name in names])
    rows: list[tuple[Array, ...]] = []
    for _ in range(200 * size):
        q = rng.uniform(-0.05, 0.05, len(names)) * length * scale
        qd, qdd = rng.normal(0, 0.5, len(names)) * length, rng.normal(0, 10, len(names)) * length
        wrench = rng.normal(0, 3 * weight, 6) * np.repeat([1, d.size], 3)
        try:
            state = complete_state(d, names, q, qd, qdd)
        except (ValueError, np.linalg.LinAlgError):
            continue
        if np.abs(state[0][3:]).max() < 0.7 and conditions(d, state[0]) < condition:
            rows.append((q, qd, qdd, wrench, *state))
        if len(rows) == size:
            keys = ("q", "qd", "qdd", "wrench", "pose", "pose_rate", "pose_acceleration")
            columns = (np.array(column) for column in zip(*rows, strict=True))
            where = "right_molar" if "right_molar" in d.points else next(iter(d.points), None)
            return {"names": names, "load_point": where} | dict(zip(keys, columns, strict=True))
    raise ValueError("too few reachable, well conditioned states")


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return f'"{value}"' if isinstance(value, str) else repr(value).lower()


def off_centre(rng: Rng, raw: Raw) -> Raw:
    """The same with a platform and cranks whose mass centres are anywhere."""
    found = {**raw, "platform": {**raw["platform"], "com": _list(rng.normal(0, 10, 3))}}
    found["chain"] = [dict(chain) for chain in raw["chain"]]
    for chain in found["chain"]:
        if chain["kind"] == "RSS":
            mass, com = float(rng.uniform(0.01, 0.05)), float(rng.normal(0, 8))
            unit = {"m": 1.0, "mm": 1e-3}[raw.get("length_unit", "m")]
            inertia = chain["crank"]["inertia"] + mass * (com * unit) ** 2
            chain["crank"] = {"inertia": inertia, "mass": mass, "com": com}
    return found


def toml_text(description: Raw) -> str:
    """The dictionary as a mechanism file."""
    lines = []
    for key, value in description.items():
        if key not in ("platform", "contact", "chain"):
            lines.append(f"{key} = {_value(value)}")
    tables = [("[platform]", description["platform"])]
    tables += [(f"[[{key}]]", t) for key in ("contact", "chain") for t in description.get(key, [])]
    for head, table in tables:
        lines += ["", head, *(f"{key} = {_value(value)}" for key, value in table.items())]
    return "\n".join(lines) + "\n"
