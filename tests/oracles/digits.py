"""Inverse and forward dynamics of one state in 60 digits, from the doubles of the file.

Kane's equations on second-order jets of numbers of many digits: a body's velocity and acceleration
are derivatives of its position, its partial velocities those of motions along one pose coordinate
each. Contacts are closed by Newton's method from a pose nearby, in jets as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mpmath import mp, mpf

from .description import single_contacts

Raw = dict[str, Any]
Number = Any  # of mpmath
mp.dps = 60
COORDINATES = ("X", "Y", "Z", "alpha", "beta", "gamma")
TINY = mpf(10) ** -50
LARGE = 2**30


class Jet:
    """x, x', x''."""

    __slots__ = ("a", "v", "x")
    __array_ufunc__ = None  # arithmetic with arrays of numbers is that of jets

    def __init__(self, x: Any, v: Any = 0, a: Any = 0) -> None:
        self.x, self.v, self.a = mpf(x), mpf(v), mpf(a)

    def __add__(self, o: Any) -> Jet:
        o = jet(o)
        return Jet(self.x + o.x, self.v + o.v, self.a + o.a)

    def __sub__(self, o: Any) -> Jet:
        o = jet(o)
        return Jet(self.x - o.x, self.v - o.v, self.a - o.a)

    def __neg__(self) -> Jet:
        return Jet(-self.x, -self.v, -self.a)

    def __mul__(self, o: Any) -> Jet:
        o = jet(o)
        a = self.a * o.x + 2 * self.v * o.v + self.x * o.a
        return Jet(self.x * o.x, self.v * o.x + self.x * o.v, a)

    def __truediv__(self, o: Any) -> Jet:
        return self * jet(o).map(lambda x: (1 / x, -1 / x**2, 2 / x**3))

    def __rtruediv__(self, o: Any) -> Jet:
        return jet(o) / self

    __radd__, __rmul__ = __add__, __mul__

    def __rsub__(self, o: Any) -> Jet:
        return jet(o) - self

    def map(self, f: Any) -> Jet:
        """A function from its value and two derivatives."""
        y, first, second = f(self.x)
        return Jet(y, first * self.v, second * self.v**2 + first * self.a)

    def sqrt(self) -> Jet:
        r = mp.sqrt(self.x)
        return Jet(r, self.v / (2 * r), self.a / (2 * r) - self.v**2 / (4 * r**3))


Vector = list[Any]  # of Jets or numbers


def jet(x: Any) -> Jet:
    return x if isinstance(x, Jet) else Jet(x)


def sin(t: Jet) -> Jet:
    return t.map(lambda x: (mp.sin(x), mp.cos(x), -mp.sin(x)))


def cos(t: Jet) -> Jet:
    return t.map(lambda x: (mp.cos(x), -mp.sin(x), -mp.cos(x)))


def add(a: Vector, b: Vector, factor: Any = 1) -> Vector:
    return [x + factor * y for x, y in zip(a, b, strict=True)]


def times(s: Any, a: Vector) -> Vector:
    return [s * x for x in a]


def dot(a: Vector, b: Vector) -> Any:
    found = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        found = found + x * y
    return found


def cross(a: Vector, b: Vector) -> Vector:
    return [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]


def product(A: list[Vector], B: list[Vector]) -> list[Vector]:
    return [[dot(row, [r[j] for r in B]) for j in range(len(B[0]))] for row in A]


def turned(A: list[Vector], v: Vector) -> Vector:
    return [dot(row, v) for row in A]


def transposed(A: list[Vector]) -> list[Vector]:
    return [list(column) for column in zip(*A, strict=True)]


def unit(a: Vector) -> Vector:
    size = dot(a, a)
    size = size.sqrt() if isinstance(size, Jet) else mp.sqrt(size)
    return [x / size for x in a]


def solved(A: list[Vector], b: Vector) -> Vector:
    """A^-1 b by elimination with pivots, of jets or numbers."""
    n = len(b)
    rows = [[*row, y] for row, y in zip(A, b, strict=True)]
    for k in range(n):
        best = max(range(k, n), key=lambda i: abs(jet(rows[i][k]).x))
        rows[k], rows[best] = rows[best], rows[k]
        for i in range(k + 1, n):
            ratio = rows[i][k] / rows[k][k]
            rows[i] = [x - ratio * y for x, y in zip(rows[i], rows[k], strict=True)]
    x: Vector = [0] * n
    for k in reversed(range(n)):
        left = rows[k][n]
        for j in range(k + 1, n):
            left = left - rows[k][j] * x[j]
        x[k] = left / rows[k][k]
    return x


def largest(values: Vector) -> Number:
    return max(abs(x) for x in values)


def rotation(axis: int, c: Any, s: Any) -> list[Vector]:
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R: list[Vector] = [[mpf(int(r == k)) for k in range(3)] for r in range(3)]
    R[i][i], R[i][j], R[j][i], R[j][j] = c, -s, s, c
    return R


def spin(R: list[Vector]) -> tuple[Vector, Vector]:
    """omega and its rate, from R' R^T."""
    x, v, a = ([[getattr(jet(e), k) for e in row] for row in R] for k in "xva")
    W = product(v, transposed(x))
    U, V = product(a, transposed(x)), product(v, transposed(v))
    dW = [add(p, q) for p, q in zip(U, V, strict=True)]
    return tuple([M[2][1], M[0][2], M[1][0]] for M in (W, dW))  # type: ignore[return-value]


def plain(v: Vector, part: str = "x") -> Vector:
    return [getattr(jet(x), part) for x in v]


# -- surfaces --------------------------------------------------------------------------------


def surface(table: Raw, scale: Number) -> Any:
    """g(p), its gradient and Hessian, at numbers or jets; zero on the surface."""
    kind = table["kind"]
    if kind in ("plane", "quadratic"):
        sx, sy = (mpf(v) for v in table.get("slope", (0, 0)))
        offset = mpf(table.get("offset", 0)) * scale
        xx, xy, yy = (mpf(table.get(n, 0)) / scale for n in ("xx", "xy", "yy"))

        def graph(p: Vector) -> tuple[Any, Vector, list[Vector]]:
            x, y, z = p
            g = z - offset - sx * x - sy * y - xx * x * x - xy * x * y - yy * y * y
            slope = [-sx - 2 * xx * x - xy * y, -sy - xy * x - 2 * yy * y, mpf(1)]
            return g, slope, [[-2 * xx, -xy, 0], [-xy, -2 * yy, 0], [0, 0, 0]]

        return graph
    if kind == "profile":
        return _profile(table, scale)
    if kind == "held":
        axis = table["axis"]
        zero = [[mpf(0)] * 3 for _ in range(3)]
        return lambda p: (p[axis] - mpf(table["at"]) * scale, identity()[axis], zero)
    centre = [mpf(v) * scale for v in table.get("centre", table.get("point", ()))]
    if kind == "ellipsoid":
        axes = [mpf(v) * scale for v in table["semi_axes"]]
        R = identity()
        for i, angle in enumerate(table.get("rotation", (0, 0, 0))):
            R = product(R, rotation(i, mp.cos(mpf(angle)), mp.sin(mpf(angle))))
        D = [[row[j] / axes[j] ** 2 for j in range(3)] for row in R]
        A = product(D, transposed(R))
    else:
        radius = mpf(table["radius"]) * scale
        A = identity()
        if kind == "cylinder":
            axis = unit([mpf(v) for v in table["axis"]])
            A = [[A[i][j] - axis[i] * axis[j] for j in range(3)] for i in range(3)]
        A = [times(1 / radius**2, row) for row in A]

    def quadric(p: Vector) -> tuple[Any, Vector, list[Vector]]:
        r = add(p, centre, -1)
        turn = turned(A, r)
        return (dot(r, turn) - 1) / 2, turn, A

    return quadric


def identity() -> list[Vector]:
    return [[mpf(int(i == j)) for j in range(3)] for i in range(3)]


def _profile(table: Raw, scale: Number) -> Any:
    direction = unit([mpf(v) for v in table["direction"]][:2])
    x, z = ([mpf(p[k]) * scale for p in table["points"]] for k in (0, 1))
    n = len(x)
    A = [[mpf(int(i == j)) for j in range(n)] for i in range(n)]
    b: Vector = [mpf(0)] * n
    for i in range(1, n - 1):
        h, k = x[i] - x[i - 1], x[i + 1] - x[i]
        A[i][i - 1 : i + 2] = [h / 6, (h + k) / 3, k / 6]
        b[i] = (z[i + 1] - z[i]) / k - (z[i] - z[i - 1]) / h
    M = solved(A, b)

    def graph(p: Vector) -> tuple[Any, Vector, list[Vector]]:
        s = direction[0] * p[0] + direction[1] * p[1]
        at = jet(s).x
        i = max(0, min(n - 2, next((k for k in range(n - 1) if at <= x[k + 1]), n - 2)))
        inside = s if x[0] <= at <= x[-1] else (x[0] if at < x[0] else x[-1])
        h, u, w = x[i + 1] - x[i], inside - x[i], x[i + 1] - inside
        rise = (z[i + 1] - z[i]) / h - (M[i + 1] - M[i]) * h / 6
        height = M[i] * w * w * w / (6 * h) + M[i + 1] * u * u * u / (6 * h)
        height = height + (z[i] - M[i] * h * h / 6) + rise * u
        slope = M[i + 1] * u * u / (2 * h) - M[i] * w * w / (2 * h) + rise
        curve = (M[i] * w + M[i + 1] * u) / h
        if inside is not s:
            height, curve = height + slope * (s - inside), mpf(0)
        a, b = direction
        flat = [-a * slope, -b * slope, mpf(1)]
        H = [[-a * a * curve, -a * b * curve, 0], [-a * b * curve, -b * b * curve, 0], [0, 0, 0]]
        return height * -1 + p[2], flat, H

    return graph


@dataclass
class Contact:
    """phi(p) of a ball's centre, and its unit normal; `foot` of the last one, where it touches."""

    point: Vector
    wall: Any
    ball: Number
    friction: Number
    smooth: Number

    def at(self, p: Vector) -> tuple[Any, Vector, Vector]:
        """phi, unit normal and the point on the wall, at numbers or jets."""
        if not self.ball:
            g, slope, _ = self.wall(p)
            return g, unit(slope), p
        w, d = self._foot(plain(p))
        if isinstance(p[0], Jet):
            w, d = [jet(x) for x in w], jet(d)
            for _ in range(3):
                w, d, _ = self._step(w, d, p)
        return d - self.ball, unit(self.wall(w)[1]), w

    def distance(self, p: Vector) -> Any:
        """Of a ball's centre, from where it touches."""
        return self._foot(p)[1] - self.ball

    def _foot(self, p: Vector) -> tuple[Vector, Any]:
        w, d = p, mpf(0)
        for _ in range(100):
            w, d, step = self._step(w, d, p)
            if step < TINY:
                break
        return w, d

    def _step(self, w: Vector, d: Any, p: Vector) -> tuple[Vector, Any, Number]:
        """Newton's on w + d n(w) = p, g(w) = 0."""
        g, slope, H = self.wall(w)
        n = unit(slope)
        size = dot(slope, n)
        across = [[int(i == j) - n[i] * n[j] for j in range(3)] for i in range(3)]
        turn = product(product(across, H), across)
        A = [[int(i == j) + d * turn[i][j] / size for j in range(3)] + [n[i]] for i in range(3)] + [
            [*slope, mpf(0)]
        ]
        right = [p[i] - w[i] - d * n[i] for i in range(3)] + [-g]
        step = solved(A, right)
        return add(w, step[:3]), d + step[3], largest(plain(step))


# -- the mechanism ---------------------------------------------------------------------------


class Machine:
    """A mechanism file's dictionary, and its dynamics state by state."""

    def __init__(self, raw: Raw, independent: Sequence[str]) -> None:
        scale = {"m": mpf(1), "mm": mpf(1) / 1000}[raw.get("length_unit", "m")]
        self.raw, self.scale = raw, scale
        self.free = [COORDINATES.index(name) for name in independent]
        self.held = [i for i in range(6) if i not in self.free]
        self.gravity = [mpf(v) for v in raw.get("gravity", (0, 0, -9.81))]
        platform = raw["platform"]
        self.mass = mpf(platform["mass"])
        self.com = [mpf(v) * scale for v in platform.get("com", (0, 0, 0))]
        i = {k: mpf(platform["inertia"].get(k, 0)) for k in ("xx", "yy", "zz", "xy", "xz", "yz")}
        self.inertia = [
            [i["xx"], i["xy"], i["xz"]],
            [i["xy"], i["yy"], i["yz"]],
            [i["xz"], i["yz"], i["zz"]],
        ]
        self.contacts = []
        for c in single_contacts(raw):
            table = c["surface"]
            options = table | c
            ball = mpf(options.get("ball_radius", 0)) * scale
            ball *= -1 if options.get("side") in ("below", "inside") else 1
            f = c.get("friction", {})
            rubbed = mpf(f.get("coefficient", 0)), mpf(f.get("smoothing_speed", 1e-3))
            point = [mpf(v) * scale for v in c["point"]]
            self.contacts.append(Contact(point, surface(table, scale), ball, *rubbed))
        self.chains = [self._chain(c) for c in raw["chain"]]

    def _chain(self, c: Raw) -> Raw:
        s = self.scale
        M, base = ([mpf(v) * s for v in c[k]] for k in ("platform", "base"))
        # A muscle's line is a cable's.
        kind = "cable" if c["kind"] == "muscle" else c["kind"]
        own: Raw = {"kind": kind, "M": M, "base": base, "raw": c}
        S = [mpf(v) * s for v in c["crank_tip"]] if c["kind"] == "RSS" else base
        line = add(M, S, -1)
        x = unit(line)
        near = mp.sqrt(x[1] ** 2 + x[2] ** 2) < mp.sin(mp.radians(5))
        y = unit(cross(x, [mpf(0), mpf(int(near)), mpf(0)] if near else [mpf(1), mpf(0), mpf(0)]))
        own |= {"S": S, "N": transposed([x, y, cross(x, y)]), "L": mp.sqrt(dot(line, line))}
        if c["kind"] in ("RSS", "PSS"):
            own["axis"] = unit([mpf(v) for v in c["axis"]])
        if c["kind"] == "RSS":
            crank = add(S, base, -1)
            u = unit(crank)
            axis = unit(add(own["axis"], u, -dot(own["axis"], u)))
            w = cross(axis, u)
            own |= {"l": mp.sqrt(dot(crank, crank)), "u": u, "w": w, "axis": axis}
            own["sign"] = -mp.sign(dot(add(M, base, -1), w))
        if c["kind"] == "PSS":
            own["sign"] = -mp.sign(dot(line, own["axis"]))
        return own

    def _legs(self, c: Raw, P: Vector) -> tuple[Jet, list[tuple[Any, ...]]]:
        """Joint coordinate (a constant more or less) and bodies: mass, centre, R, inertia."""
        raw, kind, axis, S = c["raw"], c["kind"], c.get("axis"), c["S"]
        if kind in ("SPS", "cable"):
            e = add(P, S, -1)
            length = dot(e, e).sqrt()
            if kind == "cable":
                return c["L"] - length, []
            R, x = self._rod(c, e)
            bodies = []
            for name, start, sign in (("cylinder", [jet(v) for v in S], 1), ("piston", P, -1)):
                b = raw[name]
                centre = add(start, x, sign * mpf(b["com"]) * self.scale)
                bodies.append((mpf(b["mass"]), centre, R, (mpf(b["axial"]), mpf(b["transverse"]))))
            return length - c["L"], bodies
        if kind == "PSS":
            d = add(P, S, -1)
            along = dot(d, axis)
            travel = along + c["sign"] * (along * along - dot(d, d) + c["L"] ** 2).sqrt()
            tip, joint = add([jet(v) for v in S], axis, travel), travel
            bodies = [(mpf(raw["slider"]["mass"]), tip, None, None)]
            rod = raw["rod"]
        else:
            d = add(P, c["base"], -1)
            a, b = dot(d, c["u"]), dot(d, c["w"])
            k = (dot(d, d) + c["l"] ** 2 - c["L"] ** 2) / (2 * c["l"])
            h = a * a + b * b
            side = c["sign"] * (h - k * k).sqrt()
            cosine, sine = (a * k - b * side) / h, (b * k + a * side) / h
            rate = cosine.x * sine.v - sine.x * cosine.v
            second = cosine.x * sine.a - sine.x * cosine.a
            joint = Jet(mp.atan2(sine.x, cosine.x), rate, second)
            tip = [
                c["base"][i] + c["l"] * (cosine * c["u"][i] + sine * c["w"][i]) for i in range(3)
            ]
            own = raw["crank"]
            m, com = mpf(own.get("mass", 0)), mpf(own.get("com", 0)) * self.scale
            centre = [
                c["base"][i] + com * (cosine * c["u"][i] + sine * c["w"][i]) for i in range(3)
            ]
            bodies = [
                ("crank", mpf(own["inertia"]) - m * com**2, joint, None),
                (m, centre, None, None),
            ]
            rod = raw["coupler"]
        e = add(P, tip, -1)
        R, x = self._rod(c, e)
        centre = add(tip, x, mpf(rod["com"]) * c["L"])
        return joint, [
            *bodies,
            (mpf(rod["mass"]), centre, R, (mpf(rod["axial"]), mpf(rod["transverse"]))),
        ]

    @staticmethod
    def _rod(c: Raw, e: Vector) -> tuple[list[Vector], Vector]:
        """N_i0 Ry(beta) Rz(gamma) with its first axis along e, and that axis."""
        x = unit(e)
        n = turned(transposed(c["N"]), x)
        cg = (n[0] * n[0] + n[2] * n[2]).sqrt()
        Ry, Rz = rotation(1, n[0] / cg, -n[2] / cg), rotation(2, cg, n[1])
        return product(c["N"], product(Ry, Rz)), x

    def _kinetics(self, pose: Vector) -> tuple[list[Any], list[tuple[Any, ...]]]:
        """Joints, and bodies as (mass, centre, R, inertia along x and across), of jets."""
        R, joints, bodies = self.rotation(pose), [], []
        for c in self.chains:
            joint, more = self._legs(c, add(pose[:3], turned(R, c["M"])))
            joints.append(joint)
            bodies += more
        centre = add(pose[:3], turned(R, self.com))
        return joints, [(self.mass, centre, R, self.inertia), *bodies]

    @staticmethod
    def rotation(pose: Vector) -> list[Vector]:
        R = identity()
        for i in range(3):
            R = product(R, rotation(i, cos(pose[3 + i]), sin(pose[3 + i])))
        return R

    def phi(self, pose: Vector) -> list[tuple[Any, Vector, Vector]]:
        R = self.rotation(pose)
        return [c.at(add(pose[:3], turned(R, c.point))) for c in self.contacts]

    def closed(
        self, near: Sequence[float], q: Any, q1: Any, *accelerations: Any
    ) -> tuple[list[Vector], list[Vector]]:
        """The pose as jets, of each acceleration, from a pose nearby, and M_J (6, m)."""
        pose = [mpf(v) for v in near]
        for i, x in zip(self.free, q, strict=True):
            pose[i] = mpf(x)
        C: list[Vector] = self._slopes(pose) if self.held else []
        for _ in range(60 if self.held else 0):
            phi = [p.x for p, *_ in self.phi([jet(x) for x in pose])]
            step = solved([[row[i] for i in self.held] for row in C], [-p for p in phi])
            for i, x in zip(self.held, step, strict=True):
                pose[i] += x
            C = self._slopes(pose)
            if largest(step) < TINY:
                break
        dep = [[row[i] for i in self.held] for row in C]
        M_J: list[Vector] = [[mpf(0)] * len(self.free) for _ in range(6)]
        for j, i in enumerate(self.free):
            M_J[i][j] = mpf(1)
            if self.held:
                for h, x in zip(self.held, solved(dep, [-row[i] for row in C]), strict=True):
                    M_J[h][j] = x
        rate = turned(M_J, [mpf(v) for v in q1])
        found = []
        bias: Vector = []
        if self.held:
            jets = [Jet(*p) for p in zip(pose, rate, [0] * 6, strict=True)]
            bias = solved(dep, [-p.a for p, *_ in self.phi(jets)])
        for q2 in accelerations:
            second = turned(M_J, [mpf(v) for v in q2])
            for h, x in zip(self.held, bias, strict=True):
                second[h] += x
            found.append([Jet(*p) for p in zip(pose, rate, second, strict=True)])
        return found, M_J

    def _slopes(self, pose: Vector) -> list[Vector]:
        columns = []
        for j in range(6):
            jets = [Jet(x, int(i == j)) for i, x in enumerate(pose)]
            columns.append([p.v for p, *_ in self.phi(jets)])
        return transposed(columns)

    def forces(
        self, poses: Sequence[Vector], wrench: Any, point: Any
    ) -> tuple[list[Vector], list[Vector], list[Vector], list[Vector]]:
        """Q (6,) of each pose, alike but for X_EE'', J (n, 6), N and T (k, 6), dual to X_EE'."""
        pose = poses[0]
        at, whole = plain(pose), self.rotation(pose)
        R, (omega, _) = [plain(row) for row in whole], spin(whole)
        moving = [self._kinetics(p)[1] for p in poses]
        arm = turned(R, [mpf(v) for v in point])
        F, couple = [mpf(v) for v in wrench[:3]], [mpf(v) for v in wrench[3:]]
        fixed = []
        for c, (_, n, w) in zip(self.contacts, self.phi(pose), strict=True):
            own = add(plain(w), at[:3], -1)  # where it touches, from O_M
            v = add(plain(pose[:3], "v"), cross(omega, own))
            u = times(c.friction / mp.sqrt(dot(v, v) + c.smooth**2), v)
            fixed.append((plain(n), turned(R, c.point), u, own))
        Q: list[Vector] = [[] for _ in poses]
        losses = [
            [self._loss(*p) for p in zip(self.chains, self._kinetics(x)[0], strict=True)]
            for x in poses
        ]
        J, N, T = [], [], []
        for j in range(6):
            along = [Jet(x, int(i == j)) for i, x in enumerate(at)]
            joints, unitary = self._kinetics(along)
            turning, _ = spin(self.rotation(along))
            V = [mpf(int(i == j)) for i in range(3)]
            load = dot(F, add(V, cross(turning, arm))) + dot(couple, turning)
            J.append([x.v for x in joints])
            for one, bodies, loss in zip(Q, moving, losses, strict=True):
                pairs = zip(bodies, unitary, strict=True)
                own = sum((self._power(*pair) for pair in pairs), mpf(0)) - load
                one.append(own + dot(J[-1], loss))
            N.append([dot(n, add(V, cross(turning, r))) for n, r, _, _ in fixed])
            T.append([dot(u, add(V, cross(turning, c))) for _, _, u, c in fixed])
        return Q, transposed(J), transposed(N) if fixed else [], transposed(T) if fixed else []

    def _loss(self, chain: Raw, joint: Jet) -> Number:
        """What an actuator needs for its own rotor and friction."""
        raw = chain["raw"].get("actuator", {})
        inertia, gear, viscous, coulomb, smooth = (
            mpf(raw.get(key, usual))
            for key, usual in (
                ("rotor_inertia", 0), ("gear", 1), ("viscous", 0), ("coulomb", 0),
                ("smoothing_speed", 1e-3),
            )
        )  # fmt: skip
        rate = joint.v
        rubbed = coulomb * rate / mp.sqrt(rate**2 + smooth**2)
        return inertia * gear**2 * joint.a + viscous * rate + rubbed

    def _power(self, body: tuple[Any, ...], partial: tuple[Any, ...]) -> Number:
        """(m (a - g)) . v_j + (I omega' + omega x I omega) . omega_j."""
        if body[0] == "crank":
            return body[1] * body[2].a * partial[2].v
        mass, centre, R, inertia = body
        a = plain(centre, "a")
        found = mass * dot(add(a, self.gravity, -1), plain(partial[1], "v"))
        if R is None:
            return found
        omega, second = spin(R)
        turning, _ = spin(partial[2])
        x = [plain(row) for row in R]
        I = inertia
        if isinstance(inertia, tuple):
            along, across = inertia
            I = [[mpf(0)] * 3 for _ in range(3)]
            I[0][0], I[1][1], I[2][2] = along, across, across
        whole = product(product(x, I), transposed(x))
        moment = add(turned(whole, second), cross(omega, turned(whole, omega)))
        return found + dot(moment, turning)

    def inverse(
        self,
        near: Any,
        q: Any,
        q1: Any,
        q2: Any,
        wrench: Any,
        point: Any,
        force: Sequence[float] = (),
    ) -> tuple[Vector, Vector]:
        """Minimum-norm efforts (n,) and contact forces (k,).

        Args: near: a pose nearby;  force: contact forces whose signs decide the pattern of
              friction; one of 0 is held at 0.
        """
        (Q,), J, N, T = self.forces(self.closed(near, q, q1, q2)[0], wrench, point)
        D, off = self._along(N, T, force)
        # J^T tau + D^T lambda = Q with least |tau|: small tau = J y, D y = 0. Rows of J^T are
        # pivots before small ones are: those would make J^T J, whose condition is squared.
        k, n, JT = len(D), len(J), transposed(J)
        zero, small = mpf(0), mpf(2) ** -40
        A = [
            *([*(small if i == j else zero for j in range(n)), *times(-1, J[i]), *([zero] * k)]
              for i in range(n)),
            *([*JT[i], *([zero] * 6), *(d[i] for d in D)] for i in range(6)),
            *([*([zero] * n), *d, *([zero] * k)] for d in D),
        ]  # fmt: skip
        x = solved(A, [*([zero] * n), *Q, *([zero] * k)])
        kept = iter(x[n + 6 :])
        return x[:n], [zero if i in off else next(kept) for i in range(len(N))]

    def forward(
        self,
        near: Any,
        q: Any,
        q1: Any,
        effort: Any,
        wrench: Any,
        point: Any,
        force: Sequence[float] = (),
    ) -> tuple[Vector, Vector]:
        """q'' (m,) and contact forces (k,), in the pattern of given ones' signs."""
        m = len(self.free)
        # So large that what the columns of H have in common with F leaves their digits alone.
        units = [[LARGE * int(i == j) for i in range(m)] for j in range(m)]
        poses, _ = self.closed(near, q, q1, [0] * m, *units)
        (Q, *more), J, N, T = self.forces(poses, wrench, point)
        D, off = self._along(N, T, force)
        assert not off
        A = [[(row[i] - Q[i]) / LARGE for row in more] + [-d[i] for d in D] for i in range(6)]
        pulled = turned(transposed(J), [mpf(v) for v in effort])
        x = solved(A, add(pulled, Q, -1))
        return x[:m], x[m:]

    def _along(
        self, N: list[Vector], T: list[Vector], force: Sequence[float]
    ) -> tuple[list[Vector], list[int]]:
        """Rows along which the contacts act, and those that friction holds at 0."""
        signs = [mp.sign(mpf(f)) for f in force] or [0] * len(N)
        off = [i for i, c in enumerate(self.contacts) if c.friction and not largest([signs[i]])]
        rows = zip(N, T, signs, strict=True)
        D = [add(n, t, -sign) for i, (n, t, sign) in enumerate(rows) if i not in off]
        return D, off
