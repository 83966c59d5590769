"""Energy of a machine at rest whose drives and rods are springs, in 60 digits, and its curvature.

At a pose all lengths are those of the file and the drives deliver given efforts; springs and loads
follow from there. Joints behind rods that give are where the energy is least.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from mpmath import mp, mpf

from .description import COORDINATES, Raw
from .digits import Machine, add, dot, jet, plain, spin, transposed, turned

Vector = list[Any]
STEP = mpf(10) ** -14
RODS = {"RSS": "coupler", "PSS": "rod", "SPS": "leg"}


class SprungMachine(Machine):
    """Held at a pose by efforts, (n,), under a wrench in {S} at a point in {M}."""

    def __init__(
        self, raw: Raw, independent: Sequence[str], pose: Any, effort: Any, wrench: Any, point: Any
    ) -> None:
        super().__init__(raw, independent)
        self.near, self.q = list(pose), [mpf(pose[i]) for i in self.free]
        self.effort, self.wrench = [mpf(x) for x in effort], [mpf(x) for x in wrench]
        self.point = [mpf(x) for x in point]
        self.joints: dict[int, Any] = {}  # of the last energy, of chains whose rods and drives give
        at = self.at(self.q)[0]
        self.rest = [self._joint(c, self._end(c, at)) for c in self.chains]

    def at(self, q: Vector) -> tuple[Vector, list[Vector]]:
        (pose,), M_J = self.closed(self.near, q, [0] * len(q), [0] * len(q))
        return plain(pose), M_J

    def _end(self, c: Raw, pose: Vector) -> Vector:
        R = [plain(row) for row in self.rotation([jet(x) for x in pose])]
        return add(pose[:3], turned(R, c["M"]))

    def _joint(self, c: Raw, P: Vector) -> Any:
        return self._legs(c, [jet(x) for x in P])[0].x

    def _tip(self, c: Raw, joint: Any) -> Vector:
        if c["kind"] == "PSS":
            return add(c["S"], c["axis"], joint)
        u, w = c["u"], c["w"]
        arm = add([mp.cos(joint) * x for x in u], w, mp.sin(joint))
        return add(c["base"], arm, c["l"])

    def _chain_energy(self, i: int, P: Vector) -> Any:
        c, tau, rest = self.chains[i], self.effort[i], self.rest[i]
        raw, kind = c["raw"], c["kind"]
        drive = raw.get("actuator", {}).get("stiffness")
        axial = raw.get(RODS.get(kind, ""), {}).get("stiffness")
        joint, bodies = self._legs(c, [jet(x) for x in P])
        if kind in ("SPS", "cable") or axial is None:
            soft = sum(1 / mpf(k) for k in (drive, axial) if k is not None)
            moved = joint.x - rest
            weights = sum(-b[0] * dot(self.gravity, plain(b[1])) for b in bodies if b[0] != "crank")
            return -tau * moved + moved**2 / soft / 2 + weights
        rod, own = (raw["coupler"], raw["crank"]) if kind == "RSS" else (raw["rod"], raw["slider"])
        m, com = mpf(rod["mass"]), mpf(rod["com"])
        driven = mpf(own.get("mass", 0))
        arm = mpf(own.get("com", 0)) * self.scale / c["l"] if kind == "RSS" else mpf(1)

        def parts(x: Any) -> tuple[Any, Any]:
            """Stretch and weight."""
            S = self._tip(c, x)
            e = add(P, S, -1)
            pivot = c["base"] if kind == "RSS" else [mpf(0)] * 3
            centre = add(pivot, add(S, pivot, -1), arm)
            weight = -m * dot(self.gravity, add(S, e, com)) - driven * dot(self.gravity, centre)
            return mp.sqrt(dot(e, e)) - c["L"], weight

        def slopes(x: Any) -> tuple[Any, Any]:
            pairs = parts(x + STEP), parts(x - STEP)
            return tuple((a - b) / (2 * STEP) for a, b in zip(*pairs, strict=True))  # type: ignore[return-value]

        if not hasattr(self, "tension"):
            self.tension: dict[int, Any] = {}
        if i not in self.tension:  # the first call is at the pose itself
            by, weight = slopes(rest)
            self.tension[i] = (tau - weight) / by

        def energy(x: Any) -> Any:
            stretch, weight = parts(x)
            spring = 0 if drive is None else mpf(drive) * (x - rest) ** 2 / 2
            return (
                -tau * (x - rest) + spring + weight
                + self.tension[i] * stretch + mpf(axial) * stretch**2 / 2
            )  # fmt: skip

        if drive is None:
            return energy(rest)
        # One step of Newton's method: the energy is flat there, and the pose hardly moved.
        h = mpf(10) ** -12
        e = [energy(rest + s * h) for s in (-1, 0, 1)]
        self.joints[i] = rest - (e[2] - e[0]) / 2 / (e[0] - 2 * e[1] + e[2]) * h
        return energy(self.joints[i])

    def energy(self, q: Vector) -> Any:
        """Without moments."""
        pose, _ = self.at(q)
        R = [plain(row) for row in self.rotation([jet(x) for x in pose])]
        centre = add(pose[:3], turned(R, self.com))
        found = -self.mass * dot(self.gravity, centre)
        found -= dot(self.wrench[:3], add(pose[:3], turned(R, self.point)))
        for i, c in enumerate(self.chains):
            found += self._chain_energy(i, add(pose[:3], turned(R, c["M"])))
        for one in self.raw.get("ligament", []):
            ends = ([mpf(x) * self.scale for x in one[key]] for key in ("platform", "base"))
            insertion, base = ends
            line = add(add(pose[:3], turned(R, insertion)), base, -1)
            beyond = mp.sqrt(dot(line, line)) - mpf(one["slack_length"]) * self.scale
            found += mpf(one["stiffness"]) * max(beyond, mpf(0)) ** 2 / 2
        return found

    def _moment(self, q: Vector) -> Vector:
        """Generalized force of the moment, (m,)."""
        pose, M_J = self.at(q)
        turning = []
        for j in range(6):
            along = [jet(x) for x in pose]
            along[j].v = mpf(1)
            turning.append(dot(self.wrench[3:], spin(self.rotation(along))[0]))
        return [dot(column, turning) for column in transposed(M_J)]

    def curvature(self, u: Any, v: Any) -> Any:
        """u^T K v."""
        h = mpf(10) ** -10
        self.energy(self.q)

        def moved(a: int, b: int) -> Vector:
            return [x + h * (a * mpf(y) + b * mpf(z)) for x, y, z in zip(self.q, u, v, strict=True)]

        corners = [a * b * self.energy(moved(a, b)) for a in (1, -1) for b in (1, -1)]
        turned = [self._moment(moved(0, b)) for b in (1, -1)]
        work = sum(mpf(y) * (f - g) for y, f, g in zip(u, *turned, strict=True))
        return sum(corners) / (4 * h * h) - work / (2 * h)


POWERS = {"linear": mpf(1), "hertz": mpf(3) / 2, "foundation": mpf(2)}


class YieldingMachine(SprungMachine):
    """In all six coordinates of the pose, with contacts as springs that bear given forces there.

    Of surfaces whose curvature is the same everywhere: N is a power of the depth.
    """

    def __init__(
        self, raw: Raw, pose: Any, effort: Any, wrench: Any, point: Any, force: Any
    ) -> None:
        super().__init__(raw, COORDINATES, pose, effort, wrench, point)
        self.force = [mpf(x) for x in force]
        self.depth = self._depths(self.q)

    def _depths(self, pose: Vector) -> Vector:
        R = [plain(row) for row in self.rotation([jet(x) for x in pose])]
        pairs = zip(self.force, self.contacts, strict=True)
        return [-mp.sign(f) * c.distance(add(pose[:3], turned(R, c.point))) for f, c in pairs]

    def energy(self, q: Vector) -> Any:
        found = super().energy(q)
        for c, f, start, now in zip(
            self.raw["contact"], self.force, self.depth, self._depths(q), strict=True
        ):
            power = POWERS[c["compliance"]["kind"]]
            found += abs(f) * start / (power + 1) * (now / start) ** (power + 1)
        return found

    def slope(self, u: Any) -> Any:
        """Work of all forces but the moment's along u, negative."""
        h = mpf(10) ** -20
        ends = ([x + s * h * mpf(y) for x, y in zip(self.q, u, strict=True)] for s in (1, -1))
        return (self.energy(next(ends)) - self.energy(next(ends))) / (2 * h)
