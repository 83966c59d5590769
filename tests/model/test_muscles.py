"""Muscles: limits at the sample's length and speed, and recruitment within them.

Geometry by central differences of the line's own length, curves by SymPy, recruitment by quadprog
and HiGHS.
"""

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog, minimize, root

import condyle
from condyle.analysis.map.load_capacity import LoadCapacity
from condyle.export import export
from condyle.kinematics.chain.muscle import force_length, force_velocity, passive_force
from condyle.mechanism.coordinates import rotations
from condyle.results.derived import Derived
from condyle.results.variables import VARIABLES
from condyle.status import Status

JAW = "human-jaw-muscles"
STEP = 1e-6  # s, of central differences


@cache
def curves():
    """f_L, f_V and f_P of SymPy, before they are cut off."""
    sympy = pytest.importorskip("sympy", reason="sympy is in the `bench` extra")
    from sympy.physics.biomechanics import (
        FiberForceLengthActiveDeGroote2016,
        FiberForceLengthPassiveDeGroote2016,
        FiberForceVelocityDeGroote2016,
    )

    x = sympy.Symbol("x")
    families = (
        FiberForceLengthActiveDeGroote2016,
        FiberForceVelocityDeGroote2016,
        FiberForceLengthPassiveDeGroote2016,
    )
    return [sympy.lambdify(x, f.with_defaults(x).doit(deep=True), "numpy") for f in families]


def test_curves_are_those_of_sympy():
    own = force_length, force_velocity, lambda x: passive_force(x, np.array(0.6))
    l, v = np.linspace(0.2, 1.9, 401), np.linspace(-1.2, 1.2, 401)
    for mine, theirs, x in zip(own, curves(), (l, v, l), strict=True):
        expected = np.maximum(theirs(x), 0.0)
        np.testing.assert_allclose(mine(x), expected, rtol=1e-12, atol=1e-13)
    assert force_velocity(np.array(-1.1)) == 0
    assert passive_force(np.array(0.9), np.array(0.6)) == 0
    assert passive_force(np.array(1.5), np.array(0.0)) == 0


def states(count, seed=5):
    """Poses of a jaw that moves: X, Y, alpha, beta with rates and accelerations."""
    rng = np.random.default_rng(seed)
    q = rng.uniform([0, -0.001, -0.02, 0.0], [0.004, 0.001, 0.02, 0.25], (count, 4))
    v = rng.normal(size=(count, 4)) * [0.02, 0.01, 0.2, 2.0]
    return q, v, rng.normal(size=(count, 4)) * [0.2, 0.1, 2.0, 10.0]


def lines(mechanism, pose):
    """Lengths of the lines, (N, n), from the points of the file."""
    R = rotations(pose[:, 3:])
    found = []
    for chain in mechanism.chains:
        fixed = [chain.base, *chain.via]
        M = pose[:, :3] + R @ np.array(chain.platform)
        legs = np.linalg.norm(np.diff(fixed, axis=0), axis=1).sum()
        found.append(np.linalg.norm(M - fixed[-1], axis=1) + legs)
    return np.stack(found, axis=1)


def tensions(mechanism, pose, rate):
    """Passive and greatest active tension, (N, n) each, and the lines' speeds."""
    f_L, f_V, f_P = curves()
    L = lines(mechanism, pose)
    ahead, before = (lines(mechanism, pose + s * STEP * rate) for s in (1, -1))
    speed = (ahead - before) / (2 * STEP)
    m = [chain.muscle for chain in mechanism.chains]
    force, optimal, tendon, alpha, fastest = (
        np.array([getattr(one, name) for one in m])
        for name in ("max_force", "optimal_length", "tendon_length", "pennation", "max_speed")
    )
    along = L - tendon
    fibre = np.sqrt(along**2 + (optimal * np.sin(alpha)) ** 2)
    cos = along / fibre
    l, v = fibre / optimal, speed * cos / optimal / fastest
    pull = np.where(along > 0, force * cos, 0.0)
    with np.errstate(over="ignore"):
        passive = np.maximum(f_P(l), 0) * pull
    return passive, f_L(l) * np.maximum(f_V(v), 0) * pull, l, v, speed


def solved(mechanism, count, distribution=None, load=(0, 0, -60.0, 0, 0, 0), **choice):
    model = condyle.derive(mechanism, distribution=distribution, backend="numpy", **choice)
    q, v, a = states(count)
    found = model.inverse_dynamics(q, v, a, load, at="right_molar", outputs="all")
    ports = {name: getattr(found, name) for name in ("pose", "pose_rate", "pose_acceleration")}
    force = np.broadcast_to(np.array(load[:3], dtype=float), (count, 3))
    point = np.broadcast_to(model.mechanism.platform.points["right_molar"], (count, 3))
    ports |= {"force": force, "moment": np.zeros((count, 3)), "point": point}
    s = {k: np.moveaxis(x, -1, 0) for k, x in model.kernel("balance").run(ports).values.items()}
    return model.mechanism, found, s


def other(mechanism):
    """With pennation, via points, and other curves, so that nothing is 0."""
    for i, name in enumerate(mechanism.chain_names):
        mechanism = mechanism.set(f"chain.{name}.muscle.pennation", 0.05 + 0.02 * (i // 2))
    chain = mechanism.chains[6]
    middle = 0.7 * np.array(chain.base) + 0.3 * np.array(chain.platform) + [0.0, 0.004, 0.0]
    return mechanism.set(f"chain.{chain.name}.via", [tuple(middle.tolist())])


NAMES = "bounded", "weighted", "cubic", "minimax"
EXHAUSTIVE = [pytest.param(name, 500, False, marks=pytest.mark.ci) for name in NAMES]


@pytest.mark.parametrize(
    ("name", "count", "changed"), [*((name, 25, True) for name in NAMES), *EXHAUSTIVE]
)
def test_recruitment_is_that_of_another_solver(name, count, changed):
    """HiGHS, quadprog and SciPy's SLSQP, on the whole balance: efforts to 1e-7 N."""
    pytest.importorskip("quadprog", reason="quadprog is in the `bench` extra")
    mechanism = condyle.load_mechanism(JAW)
    mechanism = other(mechanism) if changed else mechanism
    mechanism, found, s = solved(mechanism, count, name)
    passive, active, *_ = tensions(mechanism, found.pose, found.pose_rate)
    push = np.array([c.push for c in mechanism.contacts], dtype=float)
    work = np.array([c.muscle.max_force * c.muscle.optimal_length for c in mechanism.chains])
    weight = work / work.max() if name == "weighted" else np.ones(len(work))
    fine = 0
    for i in range(count):
        balance = Balance.of(s, i, passive[i], active[i], push)
        needed = balance.most()
        assert found.shortfall[i] == pytest.approx(max(needed, 1.0), rel=1e-7)
        if needed > 1:
            assert found.status[i] == Status.infeasible
            continue
        if name == "cubic":
            a = balance.cubes()
        else:
            a = balance.even() if name == "minimax" else balance.squares(weight)
        np.testing.assert_allclose(found.effort[i], passive[i] + active[i] * a, atol=1e-7)
        fine += 1
    assert 0.4 * count < fine < count


def quadprog(cost, wanted, A, b, low, high):
    """Least cost x^2 / 2 - wanted x with A x = b, low <= x <= high."""
    from quadprog import solve_qp

    one, up, down = np.eye(len(cost)), np.isfinite(high), np.isfinite(low)
    rows = np.vstack([A, one[down], -one[up]])
    return solve_qp(np.diag(cost), wanted, rows.T, np.r_[b, low[down], -high[up]], len(b))[0]


@dataclass(frozen=True)
class Balance:
    """C a + N force = q of activations and contact forces, moments times 50 so that rows are
    alike."""

    C: np.ndarray
    N: np.ndarray
    q: np.ndarray
    push: np.ndarray

    @staticmethod
    def of(s, i, passive, active, push):
        J, scale = s["J"][i], np.array([1, 1, 1, 50, 50, 50.0])
        q = (s["Q"][i] - J @ passive) * scale
        return Balance((J * active) * scale[:, None], (s["normal"][i] * scale).T, q, push)

    def program(self):
        """The least largest activation, by HiGHS: of activations, contact forces, and it."""
        n, k = self.C.shape[1], len(self.push)
        return linprog(
            np.r_[np.zeros(n + k), 1.0],
            A_ub=np.hstack([np.eye(n, n + k), -np.ones((n, 1))]),
            b_ub=np.zeros(n),
            A_eq=np.hstack([self.C, self.N, np.zeros((6, 1))]),
            b_eq=self.q,
            bounds=[(0, None)] * n
            + [(0, None) if p > 0 else (None, 0) for p in self.push]
            + [(0, None)],
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )

    def most(self):
        """The least largest activation; inf where there is none."""
        found = self.program()
        return np.inf if found.status == 2 else found.fun

    def squares(self, weight, target=0.0):
        """Least sum of squares of weight (a - target), 0 <= a <= 1, by quadprog."""
        k = len(self.push)
        low = np.r_[np.zeros(len(weight)), np.where(self.push > 0, 0.0, -np.inf)]
        high = np.r_[weight, np.where(self.push > 0, np.inf, 0.0)]
        # quadprog needs some cost of contacts too; the answer moves by its size.
        cost = np.r_[np.ones(len(weight)), np.full(k, 1e-15)]
        wanted = np.r_[weight * target, np.zeros(k)]
        whole = np.hstack([self.C / weight, self.N])
        return quadprog(cost, wanted, whole, self.q, low, high)[:-k] / weight

    def even(self):
        """The least largest activation, then the least sum of squares: what has a multiplier in
        the linear program stays at its limit in all its solutions."""
        found = self.program()
        n, k, t = self.C.shape[1], len(self.push), found.fun
        forces = np.where(self.push > 0, found.lower.marginals[n:-1], -found.upper.marginals[n:-1])
        most, least = -found.ineqlin.marginals > 1e-9, found.lower.marginals[:n] > 1e-9
        held = np.r_[most | least, forces > 1e-9 * forces.max(initial=1e-9)]
        at = np.r_[np.where(most, t, 0.0), np.zeros(k)]
        low = np.r_[np.zeros(n), np.where(self.push > 0, 0.0, -np.inf)][~held]
        high = np.r_[np.full(n, t), np.where(self.push > 0, np.inf, 0.0)][~held]
        whole, free = np.hstack([self.C, self.N]), ~held
        U, sizes, rows = np.linalg.svd(whole[:, free])
        rank = int((sizes > 1e-9 * sizes[0]).sum())
        right = (U.T @ (self.q - whole[:, held] @ at[held]))[:rank] / sizes[:rank]
        cost = np.r_[np.ones(n), np.full(k, 1e-15)][free]
        at[free] = quadprog(cost, 0 * cost, rows[:rank], right, low, high)
        return at[:n]

    def cubes(self):
        """Least sum of cubes, 0 <= a <= 1: the dual's six multipliers by SLSQP, then the equations
        of those contacts that bear by MINPACK."""

        def a(y):
            return np.sqrt(np.clip(y @ self.C, 0.0, 1.0))

        def dual(y):
            x = a(y)
            return (x**3 / 3).sum() - y @ (self.C @ x - self.q)

        begun = minimize(
            lambda y: -dual(y),
            np.zeros(6),
            jac=lambda y: self.C @ a(y) - self.q,
            constraints={
                "type": "ineq",
                "fun": lambda y: -self.push * (y @ self.N),
                "jac": lambda y: -self.push[:, None] * self.N.T,
            },
            method="SLSQP",
            options={"maxiter": 500, "ftol": 1e-16},
        ).x
        best = None
        for bears in product((True, False), repeat=len(self.push)):
            N = self.N[:, list(bears)]

            def wrong(z, N=N):
                return np.r_[self.C @ a(z[:6]) + N @ z[6:] - self.q, z[:6] @ N]

            start = np.linalg.lstsq(N, self.q - self.C @ a(begun), rcond=None)[0]
            found = root(wrong, np.r_[begun, start], method="hybr", options={"xtol": 1e-15})
            z, size = found.x, np.abs(self.q).max()
            pushing = (z[6:] * self.push[list(bears)] > -1e-9 * size).all()
            held = (self.push * (z[:6] @ self.N) < 1e-9 * np.abs(z[:6]).max()).all()
            error = np.abs(wrong(z)).max() / size
            if pushing and held and (best is None or error < best[0]):
                best = error, a(z[:6])
        assert best is not None and best[0] < 1e-10
        return best[1]


def test_results_are_fibres_activations_and_power():
    jaw = condyle.load_mechanism(JAW)
    mechanism, found, _ = solved(other(jaw), 20)
    passive, active, l, v, speed = tensions(mechanism, found.pose, found.pose_rate)
    np.testing.assert_allclose(found.joint_rate, -speed, atol=1e-9)
    model = condyle.derive(mechanism, backend="numpy")
    assert model.distribution.name == "cubic"
    q, rate, a = states(20)
    names = ("X", "Y", "alpha", "beta")
    columns = dict(zip(names, q.T, strict=True))
    columns |= {f"d{name}": x for name, x in zip(names, rate.T, strict=True)}
    columns |= {f"dd{name}": x for name, x in zip(names, a.T, strict=True)}
    derived = Derived(mechanism, found, np.zeros((20, 6)), True)
    got = {
        one.name: one.values(derived)
        for one in VARIABLES
        if one.when(derived)
        and one.name in ("activation", "fibre_length", "fibre_speed", "passive_force")
    }
    np.testing.assert_allclose(got["fibre_length"], l, rtol=1e-12)
    np.testing.assert_allclose(got["fibre_speed"], v, atol=1e-8)
    np.testing.assert_allclose(got["passive_force"], passive, rtol=1e-9, atol=1e-9)
    good = found.status == Status.ok
    wanted = (found.effort - passive)[good] / active[good]
    np.testing.assert_allclose(got["activation"][good], wanted, atol=1e-6)
    assert got["activation"][good].min() > -1e-9
    assert got["activation"][good].max() < 1 + 1e-9


def test_weighted_counts_activations_times_work():
    mechanism, found, s = solved(condyle.load_mechanism(JAW), 12, "weighted")
    passive, active, *_ = tensions(mechanism, found.pose, found.pose_rate)
    m = [chain.muscle for chain in mechanism.chains]
    work = np.array([one.max_force * one.optimal_length for one in m])
    weight = work / work.max()
    # Stationary: w^2 a / active = J . y where neither limit is met, with one y a sample.
    for i in np.flatnonzero(found.status == Status.ok):
        a = (found.effort[i] - passive[i]) / active[i]
        free = (a > 1e-6) & (a < 1 - 1e-6)
        bearing = np.abs(found.contact_force[i]) > 1e-6
        rows = np.vstack([s["J"][i].T[free], s["normal"][i][bearing]])
        slope = np.r_[(weight**2 * a / active[i])[free], np.zeros(bearing.sum())]
        left = slope - rows @ np.linalg.lstsq(rows, slope, rcond=1e-12)[0]
        assert free.sum() > 4
        np.testing.assert_allclose(left, 0, atol=1e-5 * slope.max())


def test_a_slack_muscle_bears_nothing_and_is_named():
    jaw = condyle.load_mechanism(JAW)
    name = "geniohyoid_left"
    slack = jaw.set(f"chain.{name}.muscle.tendon_length", 0.04)
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=5)
    solution = condyle.derive(slack, backend="numpy").solve(motion)
    assert (solution["effort"].sel(chain=name).values[solution["status"].values == 0] == 0).all()
    (said,) = (text for text in solution.condyle.warnings if "slack" in text)
    assert name in said and "tendon" in said


def test_files_hold_muscles_and_refuse_what_is_wrong():
    jaw = other(condyle.load_mechanism(JAW))
    assert condyle.mechanism.parse(condyle.mechanism.dumps(jaw)) == jaw
    text = condyle.mechanism.dumps(jaw)
    with pytest.raises(condyle.MechanismError, match="force_limit"):
        condyle.mechanism.parse(
            text.replace("via = [", "actuator = {force_limit = 3.0}\nvia = [", 1)
        )
    with pytest.raises(condyle.CondyleError, match="pennation"):
        jaw.set("chain.geniohyoid_left.muscle.pennation", 1.6)
    cable = (*jaw.chains[:-1], condyle.load_mechanism("human-jaw").chains[-1])
    mixed = jaw.model_copy(update={"chains": cable})
    with pytest.raises(condyle.InputError, match="other chains beside muscles"):
        condyle.derive(mixed, distribution="bounded")
    assert condyle.derive(mixed).distribution.name == "cubic"


def test_derivatives_within_limits_are_refused():
    model = condyle.derive(JAW, backend="numpy")
    with pytest.raises(condyle.UnsupportedError, match="muscles"):
        model.derivatives("effort", ("q",), q=np.zeros(4), v=np.zeros(4), a=np.zeros(4))


def test_variants_have_limits_of_their_own():
    model = condyle.derive(JAW, backend="numpy")
    q, v, a = states(3)
    path = "chain.medial_pterygoid_left.platform"
    here = np.array(model.mechanism.chains[10].platform)
    there = np.stack([here, here + np.array([0.002, 0.0, 0.001])])
    many = model.variants({path: there}).inverse_dynamics(q, v, a)
    for i, point in enumerate(there):
        one = condyle.derive(model.mechanism.set(path, tuple(point.tolist())), backend="numpy")
        expected = one.inverse_dynamics(q, v, a).effort
        np.testing.assert_allclose(many.effort[i], expected, rtol=1e-9, atol=1e-9)


def test_load_limit_is_the_largest_bite():
    model = condyle.derive(JAW, backend="numpy")
    q = np.random.default_rng(4).uniform([0, -1e-3, -0.02, 0], [3e-3, 1e-3, 0.02, 0.2], (6, 4))
    pose = model.inverse_kinematics(q).pose
    at = model.mechanism.platform.points["right_molar"]
    capacity = LoadCapacity.of(model)
    load = np.r_[np.zeros(6), at]
    for direction in (np.array([0, 0, -1.0]), np.array([0, 0.6, -0.8])):
        found = capacity.largest(pose, load, direction)
        held = found >= 0
        assert held.sum() >= 4 and (capacity.holds(pose, load) == held).all()
        still = np.zeros_like(q[held])
        for scale, status in ((0.999, Status.ok), (1.001, Status.infeasible)):
            force = scale * found[held][:, None] * direction
            wrench = np.hstack([force, 0 * force])
            got = model.inverse_dynamics(q[held], still, still, wrench, at="right_molar").status
            assert (got == status).all()
        assert found[held].min() > 50


def test_what_takes_limits_as_numbers_refuses_muscles():
    model = condyle.derive(JAW, backend="numpy")
    with pytest.raises(condyle.UnsupportedError, match="export of efforts within limits"):
        export(model.mechanism, ("bounded",))
