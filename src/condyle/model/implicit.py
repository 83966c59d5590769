"""Derivatives of solutions by the implicit function theorem, with the active set that holds.

What is asked for changes with the terms of the equations that hold at a solution by a linear map,

    d result = map . d rows,

rows being results of the questions `linear` and `places` with the solution's unknowns held.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import UnsupportedError
from ..kinematics.singularities import ratio
from ..questions.derivative import PREFIX
from .distributing import Distributor
from .system import System

Array = np.ndarray
Arrays = dict[str, Array]
CLOSE = 10.0  # errors from a switch within which a sample is a kink
ALIKE_MODES = 1e-6  # relative distance of squares of two frequencies that count as equal
ALIKE = 1e-9  # relative distance of two singular values within which they count as equal


@dataclass(frozen=True)
class SolvedSamples:
    """N solutions, as far as derivatives need them.

    system, question: whose results are the rows;  ports: what it is given.
    rows:     results of the question, in the order of the columns of `maps`.
    maps:     of each result asked for, (N, its size, rows); none: the rows are the result.
    kink:     where the active set is about to change, (N,).
    ends:     of each result its derivatives by the least and by the greatest effort of every
              chain, (N, its size, 2, n), where efforts are within limits;  length: by the
              characteristic length beside the rows, (N, its size), where the objective has it.
    """

    system: System
    question: str
    ports: Arrays
    rows: tuple[str, ...]
    maps: Arrays
    kink: Array
    ends: Arrays = field(default_factory=dict)
    length: Arrays = field(default_factory=dict)

    def applied(self, name: str, rows: Array) -> Array:
        """Changes of a result, (N, size, c), from those of the rows, (N, rows, c)."""
        return self.maps[name] @ rows if self.maps else rows

    def pulled(self, name: str, weights: Array) -> Array:
        """Weights of the rows, (N, rows), from those of a result, (N, size)."""
        return (weights[:, None] @ self.maps[name])[:, 0] if self.maps else weights


def samples_first(a: Array) -> Array:
    """Results (.., N) as (N, ..)."""
    return np.moveaxis(a, -1, 0)


def directional_rows(held: SolvedSamples, directions: Arrays) -> Array:
    """Derivatives of the rows along directions of ports and numbers, (N, rows)."""
    kernel = held.system.derivative("directional", held.question, tuple(directions), held.rows)
    values = kernel.run(held.ports | {PREFIX + n: a for n, a in directions.items()}).values
    return np.concatenate([flat(values[PREFIX + row]) for row in held.rows], axis=1)


def flat(a: Array) -> Array:
    """Results (.., N) as (N, all)."""
    return np.ascontiguousarray(samples_first(a).reshape(a.shape[-1], -1))


def solved(K: Array, right: Array) -> tuple[Array, Array]:
    """K^-1 right, (N, s, c), and where K has none: there of least norm."""
    regular = np.ones(len(K), dtype=bool)
    size = np.abs(K).max(axis=2, initial=0.0)
    size[size == 0] = 1.0
    K, right = K / size[..., None], right / size[..., None]
    try:
        return np.linalg.solve(K, right), regular
    except np.linalg.LinAlgError:
        x = np.empty_like(right)
        for i, (A, b) in enumerate(zip(K, right, strict=True)):
            try:
                x[i] = np.linalg.solve(A, b)
            except np.linalg.LinAlgError:
                x[i], regular[i] = np.linalg.pinv(A) @ b, False
        return x, regular


# -- accelerations -------------------------------------------------------------------------


def accelerated(system: System, ports: Arrays, friction: Array, error: Array) -> SolvedSamples:
    """Accelerations and contact forces of efforts: r(q'', lambda) = 0, six equations.

    Args: ports: of `linear` but the multiplier;  friction: which contacts have some, (k,).
          error: of the contact forces, relative to the largest, (N,).
    """
    count, m = ports["q"].shape
    ports = ports | {"multiplier": np.zeros((count, 6))}
    by = system.derivative("slopes", "linear", ("q2",), ("residual",)).run(ports).values
    s = system.kernel("linear").run(ports).values
    N, T = samples_first(s["N"]), samples_first(s["T"])
    D = N - np.sign(ports["contact_force"])[..., None] * T
    K = np.concatenate([samples_first(by["residual/q2"]), -D.transpose(0, 2, 1)], axis=2)
    inverse, regular = solved(K, np.broadcast_to(np.eye(6), (count, 6, 6)))
    force = np.abs(ports["contact_force"])
    small = force <= (CLOSE * error * force.max(axis=1, initial=0.0))[:, None]
    maps = {"acceleration": -inverse[:, :m], "contact_force": -inverse[:, m:]}
    return SolvedSamples(
        system, "linear", ports, ("residual",), maps, ~regular | (small & friction).any(axis=1)
    )


# -- efforts -------------------------------------------------------------------------------


def balanced(
    system: System,
    ports: Arrays,
    distributor: Distributor,
    error: Array,
    question: str = "linear",
) -> SolvedSamples:
    """Efforts and contact forces of a motion, of the objective's least value.

    With multipliers y of the balance, an effort or contact force within its bounds has
    f'(tau) = J y or W lambda = D^T y; the others stay at theirs.

    Args: ports: of the question but the multiplier;  error: relative to the largest, (N,).
          question: or `yielding`.
    """
    count = len(ports["q"])
    tau, force = ports["effort"], ports["contact_force"]
    s = system.kernel(question).run(ports | {"multiplier": np.zeros((count, 6))}).values
    J, T = s["J"].transpose(2, 1, 0), samples_first(s["T"])
    a = _Active.of(distributor, tau, force, error)
    ports = ports | {"contact_force": a.force}
    D = samples_first(s["N"]) - np.sign(a.force)[..., None] * T
    n, k = J.shape[1], D.shape[1]

    # The multipliers, from all that is within bounds.
    M = np.concatenate([J * a.free[..., None], D * a.loose[..., None]], axis=1)
    top = a.level[:, None] @ J  # of t, (N, 1, 6)
    y = _multipliers(
        M, np.concatenate([a.slope * a.free, a.weight * a.force * a.loose], axis=1), system
    )
    kink = a.close
    if a.levels:  # t comes first, and the sum of squares second
        one = np.repeat([0.0, 1.0], [n + k, 1])
        of_t = _multipliers(np.concatenate([M, top], axis=1), np.tile(one, (count, 1)), system)
        kink = kink | a.unsettled(J, D, T, of_t, np.zeros_like(tau), error)
    else:
        kink = kink | a.unsettled(J, D, T, y, a.slope, error)

    # (tau, lambda, y, t), t the largest activation, where it is minimised.
    size = n + k + 6 + a.levels
    K = np.zeros((count, size, size))
    at, on, up = np.arange(n), np.arange(n, n + k), slice(n + k, n + k + 6)
    K[:, at, at] = np.where(a.free, a.curvature, 1.0)
    K[:, on, on] = np.where(a.loose, a.weight, 1.0)
    K[:, :n, up] = -J * a.free[..., None]
    K[:, n : n + k, up] = -D * a.loose[..., None]
    K[:, up, :n], K[:, up, n : n + k] = J.transpose(0, 2, 1), D.transpose(0, 2, 1)
    if a.levels:
        K[:, :n, -1] = -a.level
        K[:, -1, up] = top[:, 0]
    wanted = np.zeros((count, size, n + k))
    wanted[:, np.arange(n + k), np.arange(n + k)] = 1.0
    found, regular = solved(K.transpose(0, 2, 1), wanted)
    to = found.transpose(0, 2, 1)  # of (tau, lambda): (N, n + k, size)
    ends = -to[:, :, None, :n] * a.by_ends(tau)[:, None]
    by_reference = -(to[..., n : n + k] @ (a.by_reference * a.force * a.loose)[..., None])[..., 0]
    if a.by_reference:
        ends = ends + by_reference[..., None, None] * a.reference_by_ends
    to = np.concatenate(
        [to[..., up], to[..., :n] * a.free[:, None], to[..., n : n + k] * a.loose[:, None]], axis=2
    )
    maps = {"effort": to[:, :n], "contact_force": to[:, n:]}
    rows = ("residual", "along", "across")
    own = ports | {"multiplier": y}
    more = {"effort": ends[:, :n], "contact_force": ends[:, n:]} if a.limited else {}
    length = {}
    if a.by_reference:
        along = by_reference * a.reference_by_length
        length = {"effort": along[:, :n], "contact_force": along[:, n:]}
    return SolvedSamples(system, question, own, rows, maps, kink | ~regular, more, length)


def _multipliers(M: Array, right: Array, system: System) -> Array:
    """y, (N, 6), of least norm with M y ~ right; NaN where M is not finite."""
    unit = np.repeat([1.0, 1.0 / system.length], 3)
    good = np.isfinite(M).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    y = np.full((len(M), 6), np.nan)
    y[good] = (np.linalg.pinv(M[good] * unit) @ right[good, :, None])[..., 0] * unit
    return y


@dataclass(frozen=True)
class _Active:
    """Which efforts (N, n) and contact forces (N, k) are within their bounds, and the objective.

    slope, curvature: f' and f'' of the efforts;  weight: W of the contact forces.
    force:  with those that are held exactly at their bound;  bound: that of held ones.
    low, high: whether an effort is at its lower or upper bound, (N, n).
    level:  d effort / d t of those at the largest activation, if that is minimised;  levels: 1 if.
    close:  where more or less is at a bound than the rest can balance, (N,).
    limited: whether limits apply;  by_scale: d f' / d scale of what is free, and of the largest
    activations their d tau / d scale, less, (N, n);  scale_by_ends: d scale by the least and the
    greatest effort, (2, n).
    by_reference: d W / d N_ref;  reference_by_ends (2, n), reference_by_length: of N_ref.
    """

    free: Array
    loose: Array
    slope: Array
    curvature: Array
    weight: float
    force: Array
    low: Array
    high: Array
    rubs: Array
    push: Array
    level: Array
    levels: int
    close: Array
    limited: bool
    by_scale: Array
    scale_by_ends: Array
    by_reference: float
    reference_by_ends: Array
    reference_by_length: float

    @staticmethod
    def of(distributor: Distributor, tau: Array, force: Array, error: Array) -> _Active:
        objective, p = distributor.distribution.objective, distributor.problem
        count, n = tau.shape
        near = (CLOSE * error * np.abs(tau).max(axis=1, initial=0.0))[:, None]
        low, high = np.zeros((count, n), dtype=bool), np.zeros((count, n), dtype=bool)
        if objective.limits:
            low, high = tau - p.low <= near, p.high - tau <= near
        scale, level = objective.scale(p), np.zeros((count, n))
        slope, curvature, by_scale = objective.derivatives(tau, scale)
        if objective.peaks:
            x = tau / scale
            most = np.abs(x).max(axis=1, keepdims=True)
            top = np.abs(x) >= most * (1 - CLOSE * error[:, None])
            level = np.where(top & ~low & ~high, np.sign(tau) * scale, 0.0)
            by_scale = np.where(level != 0, by_scale, 0.0)
        of_high = np.abs(p.high) >= np.abs(p.low)
        by_ends = np.stack([-1.0 * ~of_high, 1.0 * of_high]) * bool(objective.mixes_units)
        # Where a contact force may be held: at a unilateral one's least, or where friction turns.
        size = np.abs(np.concatenate([force, tau], axis=1)).max(axis=1, initial=0.0)[:, None]
        least = p.preload if objective.limits else 0.0
        sided = (p.push != 0) & objective.limits
        bound = np.where(sided, p.push * least, np.sign(force) * least)
        held = (np.abs(force - bound) <= CLOSE * error[:, None] * size) & (sided | p.rubs)
        free, loose = ~low & ~high & (level == 0), ~held
        enough = free.sum(axis=1) + loose.sum(axis=1) + (level != 0).any(axis=1) >= 6
        return _Active(
            free, loose, slope, curvature, objective.weight(p), np.where(held, bound, force),
            low, high, p.rubs, np.where(sided, p.push, 0.0), level, int(level.any()), ~enough,
            objective.limits, by_scale, by_ends, *distributor.weight_by_reference(),
        )  # fmt: skip

    def by_ends(self, tau: Array) -> Array:
        """Derivatives of the efforts' rows by their least and greatest, (N, 2, n)."""
        moved = np.where(self.free | (self.level != 0), self.by_scale, 0.0)
        found = moved[:, None] * self.scale_by_ends
        found[:, 0] -= self.low & ~self.high
        found[:, 1] -= self.high
        return found

    def unsettled(
        self, J: Array, D: Array, T: Array, y: Array, slope: Array, error: Array
    ) -> Array:
        """Where a multiplier is within its error of 0, or of the wrong sign, (N,)."""
        pulled, close = (J @ y[..., None])[..., 0], CLOSE * error[:, None]
        both = np.concatenate([pulled, slope], axis=1)
        near = close * np.abs(both).max(axis=1, initial=0.0, keepdims=True)
        excess = pulled - slope  # what an effort would gain by growing
        excess = np.where(self.level != 0, np.sign(self.level) * excess, excess)
        bad = (self.high | (self.level != 0)) & ~(excess > near) | self.low & ~(excess < -near)
        result: Array = (bad & ~(self.low & self.high)).any(axis=1)
        N = D + np.sign(self.force)[..., None] * T
        for sign in (1.0, -1.0):
            gain = ((N - sign * T) @ y[..., None])[..., 0] - self.weight * self.force
            size = np.abs(N * y[:, None]).sum(axis=2)
            # Held there, growth in this direction must not pay.
            may = ~self.loose & ((self.push * sign > 0) | ((self.push == 0) & self._may(sign)))
            result |= (may & ~(sign * gain < -close * size)).any(axis=1)
        return result

    def _may(self, sign: float) -> Array:
        """Whether a held force of a bilateral contact may grow this way."""
        return (self.force == 0) | (np.sign(self.force) == sign)


# -- vibrations ----------------------------------------------------------------------------

BALANCE, MATRICES = ("residual", "along", "across"), ("K", "M")
VIBRATING = ("elastic_held", (*BALANCE, *MATRICES))  # question and rows


def vibrating(
    system: System, ports: Arrays, modes: tuple[Array, Array, Array], efforts: SolvedSamples | None
) -> SolvedSamples:
    """Natural frequencies: d omega^2 = y (dK - omega^2 dM) x, with y K = omega^2 y M, y M x = 1.

    Where two are equal each is of a shape of its own, any of their plane: a kink. Their sum's
    derivative is right.

    Args: ports: of `elastic`;  modes: omega^2 (N, m), shapes (N, m, m) as rows, and M;
          efforts: what is held where they balance the pose; None: efforts are given.
    """
    square, shape, M = modes
    count, m = square.shape
    if not np.isfinite(square).all():
        raise UnsupportedError(
            "frequency: chains without a stiffness are rigid, and the frequencies that they leave "
            "have no derivatives yet: state a stiffness of every chain"
        )
    left = np.linalg.inv(M @ shape.transpose(0, 2, 1))  # y as rows
    by_K = np.einsum("nji,njk->njik", left, shape).reshape(count, m, m * m)
    by_K /= (4 * np.pi * np.sqrt(square))[..., None]
    by_M = -square[..., None] * by_K
    gap = np.diff(square, axis=1)
    kink = np.asarray((gap <= ALIKE_MODES * square[:, 1:]).any(axis=1))
    if efforts is None:
        maps = {"frequency": np.concatenate([by_K, by_M], axis=2)}
        return SolvedSamples(system, "elastic", ports, MATRICES, maps, kink)
    slopes = system.derivative("slopes", "elastic", ("effort",), MATRICES).run(ports).values
    K_tau, M_tau = (
        samples_first(slopes[f"{name}/effort"][:, :, 0].reshape(m * m, -1, count))
        for name in MATRICES
    )
    by_effort = by_K @ K_tau + by_M @ M_tau  # of rods that give, inertia depends on it too
    moved = by_effort @ efforts.maps["effort"]
    maps = {"frequency": np.concatenate([moved, by_K, by_M], axis=2)}
    length = {}
    if "effort" in efforts.length:
        length = {"frequency": (by_effort @ efforts.length["effort"][..., None])[..., 0]}
    question, rows = VIBRATING
    own = efforts.ports | ports
    near: Array = np.asarray(kink) | efforts.kink
    return SolvedSamples(system, question, own, rows, maps, near, length=length)


# -- kinematics ----------------------------------------------------------------------------


def read_back(system: System, ports: Arrays) -> SolvedSamples:
    """q from readings of the joints: where the gradient of their least squares vanishes."""
    by = system.derivative("slopes", "places", ("q",), ("pull",)).run(ports).values["pull/q"]
    H = samples_first(by)
    inverse, regular = solved(H, np.broadcast_to(np.eye(H.shape[1]), H.shape))
    return SolvedSamples(system, "places", ports, ("pull",), {"q": -inverse}, ~regular)


def solved_places(system: System, ports: Arrays, of: tuple[str, ...]) -> SolvedSamples:
    """Pose, joint, contact_point as they are, and singularity_ratio through singular values."""
    s = system.kernel("places").run(ports).values
    count = len(ports["q"])
    rows = tuple(name for name in ("pose", "joint", "contact_point") if name in of)
    kink, maps = np.zeros(count, dtype=bool), Arrays()
    sizes = {name: s[name].reshape(-1, count).shape[0] for name in s}
    with_ratio = "singularity_ratio" in of
    names = (*rows, "transmission", "J_W") if with_ratio else rows
    starts = dict(zip(names, np.cumsum([0, *(sizes[n] for n in names)]), strict=False))
    width = sum(sizes[name] for name in names)
    for name in rows:
        own = slice(starts[name], starts[name] + sizes[name])
        maps[name] = np.zeros((count, sizes[name], width))
        maps[name][:, :, own] = np.eye(sizes[name])
    if with_ratio:
        t, J = s["transmission"].T, s["J_W"].transpose(2, 1, 0)  # (N, n), (N, n, m)
        size, rank, every = np.abs(t), np.argsort(np.abs(t), axis=1), np.arange(count)
        U, sigma, Vt = np.linalg.svd(J, full_matrices=False)
        low, high = size[every, rank[:, 0]], size[every, rank[:, -1]]
        inverse, direct = ratio(low, high), ratio(sigma[:, -1], sigma[:, 0])
        by_t, by_J = np.zeros_like(t), np.zeros_like(J)
        by_t[every, rank[:, -1]] -= inverse / high * np.sign(t[every, rank[:, -1]])
        by_t[every, rank[:, 0]] += np.sign(t[every, rank[:, 0]]) / high
        for i, factor in ((-1, 1 / sigma[:, 0]), (0, -direct / sigma[:, 0])):
            by_J = by_J + factor[:, None, None] * U[:, :, i, None] * Vt[:, i, None, :]
        chosen = (inverse <= direct)[:, None]
        both = np.concatenate(
            [by_t * chosen, (by_J * ~chosen[..., None]).transpose(0, 2, 1).reshape(count, -1)],
            axis=1,
        )
        maps["singularity_ratio"] = np.zeros((count, 1, width))
        maps["singularity_ratio"][:, 0, starts["transmission"] :] = both
        kink = np.abs(inverse - direct) <= ALIKE * direct
        if t.shape[1] > 2:
            ranked = np.take_along_axis(size, rank, axis=1)
            apart = np.minimum(ranked[:, 1] - ranked[:, 0], ranked[:, -1] - ranked[:, -2])
            kink |= chosen[:, 0] & (apart <= ALIKE * high)
        if sigma.shape[1] > 2:
            apart = np.minimum(sigma[:, 0] - sigma[:, 1], sigma[:, -2] - sigma[:, -1])
            kink |= ~chosen[:, 0] & (apart <= ALIKE * sigma[:, 0])
    return SolvedSamples(system, "places", ports, names, maps, kink)
