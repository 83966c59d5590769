"""Muscles: limits at the sample's length and speed, and recruitment within them.

Geometry by central differences of the line's own length, curves by SymPy, what is lacking by HiGHS,
recruitment by its conditions of optimality.
"""

from functools import cache

import numpy as np
import pytest
from distribution.oracle import unexplained
from scipy.optimize import linprog
from support.machines import model as shared

import condyle
from condyle.analysis.map.load_capacity import LoadCapacity
from condyle.export import export
from condyle.kinematics.chain.muscle import force_length, force_velocity, passive_force
from condyle.mechanism.coordinates import rotations
from condyle.quantities import variables
from condyle.results.derived import Derived
from condyle.status import Status

JAW = "human-jaw-muscles"
STEP = 1e-6  # s, of central differences
LOAD = (0, 0, -60.0, 0, 0, 0)
ONE = np.array(1.0)
MOMENTS = np.array([1, 1, 1, 50, 50, 50.0])  # so that rows of equations are alike


@cache
def curves():
    """f_L, f_V and f_P of SymPy, before they are cut off."""
    pytest.importorskip("sympy", reason="sympy is in the `bench` extra")
    from sympy import Symbol, lambdify
    from sympy.physics import biomechanics

    x, kinds = Symbol("x"), ("ForceLengthActive", "ForceVelocity", "ForceLengthPassive")
    families = [getattr(biomechanics, f"Fiber{kind}DeGroote2016") for kind in kinds]
    return [lambdify(x, f.with_defaults(x).doit(deep=True), "numpy") for f in families]


def test_curves_are_those_of_sympy():
    own = force_length, force_velocity, lambda x: passive_force(x, np.array(0.6))
    l, v = np.linspace(0.2, 1.9, 401), np.linspace(-1.2, 1.2, 401)
    for mine, theirs, x in zip(own, curves(), (l, v, l), strict=True):
        expected = np.maximum(theirs(x), 0.0)
        np.testing.assert_allclose(mine(x), expected, rtol=1e-12, atol=1e-13)
    beyond = force_velocity(-1.1 * ONE), passive_force(0.9 * ONE, 0.6 * ONE)
    assert beyond == (0, 0) and passive_force(1.5 * ONE, 0 * ONE) == 0


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
    """Passive and greatest active tension, (N, n) each, lengths and speeds of fibres, speeds."""
    f_L, f_V, f_P = curves()
    L, ahead, before = (lines(mechanism, pose + s * STEP * rate) for s in (0, 1, -1))
    speed = (ahead - before) / (2 * STEP)
    names = ("max_force", "optimal_length", "tendon_length", "pennation", "max_speed")
    force, optimal, tendon, alpha, fastest = (
        np.array([getattr(chain.muscle, name) for chain in mechanism.chains]) for name in names
    )
    along = L - tendon
    fibre = np.sqrt(along**2 + (optimal * np.sin(alpha)) ** 2)
    cos = along / fibre
    l, v = fibre / optimal, speed * cos / optimal / fastest
    pull = np.where(along > 0, force * cos, 0.0)
    strain = np.array([chain.muscle.passive_strain for chain in mechanism.chains])
    with np.errstate(over="ignore"):  # SymPy's f_P is 1 at a strain of 0.6
        passive = np.maximum(f_P(1 + (l - 1) * 0.6 / strain), 0) * pull
    return passive, f_L(l) * np.maximum(f_V(v), 0) * pull, l, v, speed


def solved(mechanism, count, distribution=None, **given):
    """The mechanism, inverse dynamics, and the six equations of its platform."""
    model = condyle.derive(mechanism, distribution=distribution, backend="numpy")
    found = model.inverse_dynamics(*states(count), LOAD, at="right_molar", outputs="all", **given)
    return model.mechanism, found, equations(model, found, LOAD)


def equations(model, found, load):
    """Of the platform, by samples: J, Q and normals."""
    ports = {name: getattr(found, name) for name in ("pose", "pose_rate", "pose_acceleration")}
    none = np.zeros((len(found.pose), 3))
    point = model.mechanism.platform.points["right_molar"] + none
    ports |= {"force": np.array(load[:3]) + none, "moment": none, "point": point}
    return {k: np.moveaxis(x, -1, 0) for k, x in model.kernel("balance").run(ports).values.items()}


@cache
def stiff():
    """With passive forces that matter."""
    jaw = condyle.load_mechanism(JAW)
    return jaw.set({f"chain.{name}.muscle.passive_strain": 0.6 for name in jaw.chain_names})


@cache
def other():
    """With pennation, via points, and other curves, so that nothing is 0."""
    jaw = stiff()
    chain = jaw.chains[6]
    middle = 0.7 * np.array(chain.base) + 0.3 * np.array(chain.platform) + [0.0, 0.004, 0.0]
    muscles = enumerate(jaw.chain_names)
    changes = {f"chain.{c}.muscle.pennation": 0.05 + 0.02 * (i // 2) for i, c in muscles}
    return jaw.set(changes | {f"chain.{chain.name}.via": [tuple(middle.tolist())]})


SLOPES = {
    "bounded": lambda a, work: a,
    "weighted": lambda a, work: a * work**2,
    "cubic": lambda a, work: a**2,
    "minimax": None,
}
EXHAUSTIVE = [pytest.param(name, 150, False, marks=pytest.mark.ci) for name in SLOPES]


@pytest.mark.parametrize(
    ("name", "count", "changed"), [*((name, 12, True) for name in SLOPES), *EXHAUSTIVE]
)
def test_recruitment_is_the_least(name, count, changed):
    mechanism, found, s = solved(other() if changed else stiff(), count, name)
    work = np.array([c.muscle.max_force * c.muscle.optimal_length for c in mechanism.chains])
    slope = SLOPES[name]
    recruited(mechanism, found, s, slope and (lambda a, i: slope(a, work / work.max())))


def recruited(mechanism, found, s, slope):
    """Efforts where there are any are the least by their slope; else how much is lacking.

    Args: slope: of what is least, in activations, of a sample; None: the largest activation is.
    """
    passive, active, *_ = tensions(mechanism, found.pose, found.pose_rate)
    push, fine = np.array([c.push for c in mechanism.contacts], dtype=float), 0
    n, k = passive.shape[1], len(push)
    for i in range(len(passive)):
        # C a + N force = q of activations and contact forces.
        C = s["J"][i] * active[i] * MOMENTS[:, None]
        N, q = (s["normal"][i] * MOMENTS).T, (s["Q"][i] - s["J"][i] @ passive[i]) * MOMENTS
        low = np.r_[np.zeros(n), np.where(push > 0, 0.0, -np.inf)]
        high = np.r_[np.full(n, np.inf), np.where(push > 0, np.inf, 0.0)]
        needed = linprog(  # the least largest activation
            np.r_[np.zeros(n + k), 1.0],
            *(np.hstack([np.eye(n, n + k), -np.ones((n, 1))]), np.zeros(n)),
            *(np.hstack([C, N, np.zeros((6, 1))]), q),
            [*zip(low, high, strict=True), (0, None)],
            options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
        )
        needed = np.inf if needed.status == 2 else needed.fun
        assert found.shortfall[i] == pytest.approx(max(needed, 1.0), rel=1e-7)
        if needed > 1:
            assert found.status[i] == Status.infeasible
            continue
        force, taut = found.contact_force[i], active[i] > 1e-6  # N; the others are slack
        own = (found.effort[i] - passive[i]) / np.where(taut, active[i], 1.0)
        assert np.abs(own[~taut]).max(initial=0) < 1e-6
        a = np.where(taut, own, 0.0)
        assert np.abs(C @ a + N @ force - q).max() < 1e-8 * np.abs(q).max()
        assert a.min() > -1e-9 and a.max() < 1 + 1e-9 and (push * force).min() > -1e-7
        fine += 1
        if slope is None:
            assert a.max() == pytest.approx(needed, abs=1e-8)
            continue
        high[:n] = 1.0
        x, gradient = np.r_[a, force / 100], np.r_[np.where(taut, slope(a, i), 0), np.zeros(k)]
        assert unexplained(np.hstack([C, 100 * N]), x, gradient, low, high) < 1e-7
    assert 0.4 * len(passive) < fine < len(passive)


def test_results_are_fibres_activations_and_power():
    mechanism, found, _ = solved(other(), 20)
    passive, active, l, v, speed = tensions(mechanism, found.pose, found.pose_rate)
    np.testing.assert_allclose(found.joint_rate, -speed, atol=1e-9)
    derived = Derived(mechanism, found, np.zeros((20, 6)), True)
    names = ("activation", "fibre_length", "fibre_speed", "passive_force")
    got = {n: derived.values(x) for n, x in variables().items() if n in names and derived.has(x)}
    np.testing.assert_allclose(got["fibre_length"], l, rtol=1e-12)
    np.testing.assert_allclose(got["fibre_speed"], v, atol=1e-8)
    np.testing.assert_allclose(got["passive_force"], passive, rtol=1e-9, atol=1e-9)
    good = found.status == Status.ok
    activation = got["activation"][good]
    np.testing.assert_allclose(activation, (found.effort - passive)[good] / active[good], atol=1e-6)
    assert activation.min() > -1e-9 and activation.max() < 1 + 1e-9


def test_a_slack_muscle_bears_nothing_and_is_named():
    name = "geniohyoid_left"
    slack = condyle.load_mechanism(JAW).set(f"chain.{name}.muscle.tendon_length", 0.04)
    motion = condyle.Motion.from_csv(condyle.motion.bundled_reference()[0], rate=5)
    solution = condyle.derive(slack, backend="numpy").solve(motion)
    assert (solution["effort"].sel(chain=name).values[solution["status"].values == 0] == 0).all()
    (said,) = (text for text in solution.condyle.warnings if "slack" in text)
    assert name in said and "tendon" in said


def test_files_hold_muscles_and_what_is_wrong_is_refused():
    jaw = other()
    text = condyle.mechanism.dumps(jaw)
    assert condyle.mechanism.parse(text) == jaw
    spoiled = text.replace("via = [", "actuator = {force_limit = 3.0}\nvia = [", 1)
    with pytest.raises(condyle.MechanismError, match="force_limit"):
        condyle.mechanism.parse(spoiled)
    with pytest.raises(condyle.CondyleError, match="pennation"):
        jaw.set("chain.geniohyoid_left.muscle.pennation", 1.6)
    cable = (*jaw.chains[:-1], condyle.load_mechanism("human-jaw").chains[-1])
    mixed = jaw.model_copy(update={"chains": cable})
    with pytest.raises(condyle.InputError, match="other chains beside muscles"):
        condyle.derive(mixed, distribution="bounded")
    assert condyle.derive(mixed).distribution.name == "cubic" == shared(JAW).distribution.name
    zero = np.zeros(4)
    with pytest.raises(condyle.UnsupportedError, match="muscles"):
        shared(JAW).derivatives("effort", ("q",), q=zero, v=zero, a=zero)
    with pytest.raises(condyle.UnsupportedError, match="export of efforts within limits"):
        export(jaw, ("bounded",))


def test_variants_have_limits_of_their_own():
    model = shared(JAW)
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
    model = shared(JAW)
    q = np.random.default_rng(4).uniform([0, -1e-3, -0.02, 0], [3e-3, 1e-3, 0.02, 0.2], (6, 4))
    pose = model.inverse_kinematics(q).pose
    load = np.r_[np.zeros(6), model.mechanism.platform.points["right_molar"]]
    capacity = LoadCapacity.of(model)
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
