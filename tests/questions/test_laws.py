"""Laws, sensors and loads against their equations, written anew with numpy."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from support.loads import parts
from support.points import moved

import condyle
from condyle.model.model import Model
from condyle.motion import resolve_load_point
from condyle.questions.entries import Machine
from condyle.questions.law import CONTROLLERS
from condyle.questions.law.bite_force import BITING, FREE, LEAVING
from condyle.questions.load import LOADS
from condyle.questions.load.food import APART, BROKEN, TOUCHING

N, M, PERIOD = 12, 4, 2e-3
WIDE = 1e100
Arrays = dict[str, np.ndarray]


@cache
def jaw() -> Model:
    return Model(condyle.load_mechanism("masticatory"), backend="numpy")


@cache
def machine() -> Machine:
    points = jaw().mechanism.platform.points
    return Machine(
        jaw().mechanism, jaw().independent, lambda n: resolve_load_point(n, points), lambda f: f
    )


def point(name: str = "right_molar") -> np.ndarray:
    return np.array(jaw().mechanism.platform.points[name])


def pose_of(q: np.ndarray) -> np.ndarray:
    return jaw().poses.survey(q, ("pose",)).values["pose"].T


def place(q: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (N, 3) of a point, and its Jacobian (N, 3, m) by differences of fourth order."""
    h, columns = 1e-3, []
    for i in range(M):
        step = h * np.eye(M)[i]
        far = {k: np.array([moved(x, p) for x in pose_of(q + k * step)]) for k in (-2, -1, 1, 2)}
        columns.append((far[-2] - far[2] + 8 * (far[1] - far[-1])) / (12 * h))
    return np.array([moved(x, p) for x in pose_of(q)]), np.stack(columns, axis=2)


def twist(q: np.ndarray, q1: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Velocity of O_M and angular velocity, (N, 3) each: half the sum of r x v over three axes."""
    along = [place(q, p) for p in (np.zeros(3), *np.eye(3))]
    O, *v = (np.einsum("nij,nj->ni", J, q1) for _, J in along)
    levers = [d + p - along[0][0] for (d, _), p in zip(along[1:], np.eye(3), strict=True)]
    turning = sum(np.cross(r, one - O) for r, one in zip(levers, v, strict=True)) / 2
    return O, np.asarray(turning)


@cache
def sampled() -> Arrays:
    """States and references at random, and what encoders read of them."""
    rng = np.random.default_rng(3)
    found = {}
    for end in ("", "_d"):
        q = rng.uniform(-1, 1, (N, M)) * [0.002, 0.002, 0.02, 0.03]
        q1, q2 = 0.3 * rng.normal(size=(N, M)), 2 * rng.normal(size=(N, M))
        at = jaw().kernel("instant").run({"q": q, "q1": q1})
        assert not at.status.any()
        found |= {f"q{end}": q, f"q1{end}": q1, f"q2{end}": q2}
        found |= {
            f"joint{end}": at.values["joint"].T,
            f"joint_rate{end}": at.values["joint_rate"].T,
        }
    del found["q2"]
    force = rng.normal(size=(N, 3)) + np.array([0, 0, -4.0])
    return found | {"force": force, "force_d": rng.uniform(0, 40, (N, 1))}


def asked(entries: dict[str, Any], memory: np.ndarray | None = None, limit: float = WIDE) -> Arrays:
    """Results of the tick of a controller's table."""
    law = CONTROLLERS[entries["kind"]](**entries).bind(machine())  # type: ignore[attr-defined]
    ports = dict(sampled()) | {"period": np.full((N, 1), PERIOD)}
    for name, value in law.numbers.items():
        ports[name] = np.broadcast_to(value, (N, np.size(value)))
    ports |= {name: np.full((N, 6), s * limit) for name, s in (("low", -1), ("high", 1))}
    if memory is not None:
        ports["memory_before"] = memory
    answer = jaw().kernel("tick", law.table, law.choices).run(ports)
    assert not answer.status.any()
    return {name: a.T for name, a in answer.values.items()}


def inverse(q: np.ndarray, q1: np.ndarray, q2: np.ndarray, force: Any = 0.0) -> np.ndarray:
    """Efforts that bear a force at the molar, too."""
    load = np.zeros((N, 9))
    load[:, :3], load[:, 6:] = force, point()
    return jaw().inverse_dynamics(q, q1, q2, *parts(load)).effort


def close(found: np.ndarray, expected: np.ndarray, bound: float = 1e-10) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=bound * np.abs(expected).max())


def back(Kp: Any, Kv: Any) -> np.ndarray:
    s = sampled()
    return s["q2_d"] + Kv * (s["q1_d"] - s["q1"]) + Kp * (s["q_d"] - s["q"])


def test_hybrid_gives_forces_along_some_directions_and_motion_along_others() -> None:
    entries: dict[str, Any] = {
        "kind": "hybrid", "stiffness": 300.0, "damping": 17.0, "forces": (20.0, -5.0),
        "directions": ((0, 0, 1), (1, 0, 0)), "proportional": 0.4, "integral": 3.0,
        "force_damping": 80.0, "rise": 0.05,
    }  # fmt: skip
    s, rng = sampled(), np.random.default_rng(1)
    memory = np.concatenate(
        [rng.normal(size=(N, 2)), np.zeros((N, 1)), rng.uniform(0, 1, (N, 1))], axis=1
    )
    found = asked(entries, memory)
    D = np.array([[0.0, 0, 1], [1, 0, 0]])
    _, J_point = place(s["q"], point())
    J = D @ J_point
    M_inv = np.linalg.inv(jaw().mass_matrix(s["q"]))
    free = back(300.0, 17.0)
    lever = M_inv @ J.transpose(0, 2, 1) @ np.linalg.inv(J @ M_inv @ J.transpose(0, 2, 1))
    missed = (J @ (free + 0.0)[..., None])[..., 0] + 80.0 * np.einsum("nij,nj->ni", J, s["q1"])
    q2 = free - np.einsum("nij,nj->ni", lever, missed)
    share = np.minimum(memory[:, 3:] + PERIOD / 0.05, 1)
    wanted = share * [20.0, -5.0]
    error = wanted + s["force"] @ D.T
    push = wanted + 0.4 * error + 3.0 * memory[:, :2]
    close(found["asked"], inverse(s["q"], s["q1"], q2, -push @ D), 1e-8)
    total = memory[:, :2] + (share >= 1) * error * PERIOD
    close(found["memory"], np.concatenate([total, np.zeros((N, 1)), share], axis=1))


def test_computed_torque() -> None:
    Kp = [100.0, 200.0, 300.0, 400.0]
    found = asked({"kind": "computed_torque", "stiffness": Kp, "damping": 17.0})
    s = sampled()
    close(found["asked"], inverse(s["q"], s["q1"], back(Kp, 17.0)))
    found = asked({"kind": "computed_torque", "stiffness": Kp})
    close(found["asked"], inverse(s["q"], s["q1"], back(Kp, 2 * np.sqrt(Kp))))
    for name in ("q", "q1", "joint", "joint_rate"):
        np.testing.assert_array_equal(found[name], s[name])


@pytest.mark.parametrize("gravity", [True, False])
def test_joint_pd(gravity: bool) -> None:
    K = np.arange(1.0, 7.0)
    entries = {
        "kind": "joint_pd",
        "stiffness": tuple(K),
        "damping": tuple(K / 50),
        "gravity": gravity,
    }
    s = sampled()
    wanted = K * (s["joint_d"] - s["joint"]) + K / 50 * (s["joint_rate_d"] - s["joint_rate"])
    if gravity:
        wanted += inverse(s["q_d"], 0 * s["q"], 0 * s["q"])
    close(asked(entries)["asked"], wanted)


def test_impedance() -> None:
    s, k = sampled(), np.array([2e3, 3e3, 4e3])
    found = asked({"kind": "impedance", "stiffness": tuple(k), "damping": 30.0, "posture": 90.0})
    (p, J), (p_d, J_d) = (place(s[name], point()) for name in ("q", "q_d"))
    force = k * (p_d - p)
    force += 30.0 * (np.einsum("nij,nj->ni", J_d, s["q1_d"]) - np.einsum("nij,nj->ni", J, s["q1"]))
    free = 90.0 * (s["q_d"] - s["q"]) + 2 * np.sqrt(90.0) * (s["q1_d"] - s["q1"])
    by = np.linalg.solve(jaw().mass_matrix(s["q"]), J.transpose(0, 2, 1))
    taken = by @ np.linalg.pinv(J @ by, hermitian=True) @ J @ free[..., None]
    close(found["asked"], inverse(s["q"], s["q1"], s["q2_d"] + free - taken[..., 0], -force), 1e-8)


def mode_next(mode: float, measured: float, ahead: float, closing: float) -> float:
    if measured < 1.0:
        return FREE
    if mode == BITING:
        return LEAVING if ahead < -2e-4 and closing < 0 else BITING
    return BITING if mode == FREE and measured > 2.0 and closing > 0 else mode


def test_bite_force() -> None:
    s, u = sampled(), np.array([0.6, 0.0, 0.8])
    entries = {
        "kind": "bite_force",
        "stiffness": 900.0,
        "force": 40.0,
        "direction": (3.0, 0.0, 4.0),
    }
    entries |= {"proportional": 0.4, "integral": 6.0, "bite_damping": 120.0, "rise": 20 * PERIOD}
    _, J = place(s["q"], point())
    J = np.einsum("i,nij->nj", u, J)
    measured = -s["force"] @ u
    ahead, closing = (np.einsum("nj,nj->n", J, x) for x in (s["q_d"] - s["q"], s["q1_d"]))
    met = set()
    for before, share in ((FREE, 0.5), (BITING, 0.97), (BITING, 0.3), (LEAVING, 0.5)):
        memory = np.column_stack([np.full(N, before), np.full(N, 0.2), np.full(N, share)])
        found = asked(entries, memory)
        mode = np.array([mode_next(before, *x) for x in zip(measured, ahead, closing, strict=True)])
        aim, part = s["force_d"][:, 0], min(share + 0.05, 1.0)
        error, biting = part * aim - measured, mode == BITING
        total = np.where(biting, 0.2 + (part == 1.0) * error * PERIOD, 0.0)
        rises = np.where(biting, part, np.clip(measured / aim, 0.0, 1.0))
        right = np.column_stack([mode, total, rises])
        np.testing.assert_allclose(found["memory"], right, rtol=1e-12)
        q2 = back(900.0, 60.0)
        by = np.linalg.solve(jaw().mass_matrix(s["q"]), J[..., None])[..., 0]
        along = np.einsum("nj,nj->n", J, q2 + 120.0 * s["q1"]) / np.einsum("nj,nj->n", J, by)
        q2 = q2 - np.where(biting, along, 0)[:, None] * by
        push = np.where(biting, part * aim + 0.4 * error + 6.0 * 0.2, measured)
        close(found["asked"], inverse(s["q"], s["q1"], q2, -push[:, None] * u), 1e-8)
        met |= {(before, m) for m in mode}
    assert {(FREE, BITING), (BITING, BITING), (BITING, LEAVING), (LEAVING, LEAVING)} <= met
    assert {(BITING, FREE), (FREE, FREE)} <= met


def test_an_integral_does_not_grow_where_limits_cut() -> None:
    entries = {
        "kind": "bite_force",
        "stiffness": 900.0,
        "force": 40.0,
        "direction": (3.0, 0.0, 4.0),
    }
    memory = np.tile([BITING, 0.2, 1.0], (N, 1))
    free, cut = (asked(entries, memory, limit)["memory"] for limit in (WIDE, 1e-6))
    held = (cut[:, 0] == BITING) & (free[:, 1] > 0.2)
    assert held.any() and (cut[held, 1] == 0.2).all()
    shrinks = free[:, 1] < 0.2
    np.testing.assert_array_equal(cut[shrinks], free[shrinks])


def test_limits_cut_what_is_asked_for() -> None:
    law = CONTROLLERS["joint_pd"](kind="joint_pd", stiffness=3.0, damping=0.1, gravity=False)
    bound = law.bind(machine())  # type: ignore[attr-defined]
    ports = dict(sampled()) | {"period": np.full((N, 1), PERIOD)}
    ports |= {n: np.broadcast_to(v, (N, 6)) for n, v in bound.numbers.items()}
    ports |= {"low": np.full((N, 6), -0.05), "high": np.full((N, 6), 0.02)}
    found = jaw().kernel("tick", bound.table, bound.choices).run(ports).values
    np.testing.assert_array_equal(found["effort"], np.clip(found["asked"], -0.05, 0.02))
    assert (found["effort"] != found["asked"]).any()


# -- sensors -----------------------------------------------------------------------------------


@pytest.mark.parametrize("velocity", ["difference", "exact"])
def test_an_observer_counts_and_finds_the_state(velocity: str) -> None:
    """Exact encoders give the state; coarse ones the least squares of their counts."""
    s, rng = sampled(), np.random.default_rng(8)
    true = pose_of(s["q"])
    before = s["joint"] - PERIOD * s["joint_rate"] + 1e-5 * rng.normal(size=(N, 6))
    ports = {
        "joint": s["joint"],
        "joint_rate": s["joint_rate"],
        "period": np.full((N, 1), PERIOD),
        "smoothing": np.full((N, 1), 0.3),
        "pose_before": true - 1e-3 * rng.normal(size=(N, 6)) * [0.02, 0.02, 0.02, 1, 1, 1],
        "pose_rate_before": np.zeros((N, 6)),
        "joint_before": before,
        "joint_rate_before": s["joint_rate"] * 1.1,
    }
    kernel = jaw().kernel("observer", velocity)
    for resolution in (0.0, 1e-3):
        ports["resolution"] = np.full((N, 6), resolution)
        answer = kernel.run(ports)
        assert not answer.status.any()
        found = {name: a.T for name, a in answer.values.items()}
        count = s["joint"] if not resolution else resolution * np.round(s["joint"] / resolution)
        np.testing.assert_allclose(found["joint"], count, rtol=0, atol=1e-15)
        rate = s["joint_rate"]
        if velocity == "difference":
            rate = 0.3 * 1.1 * rate + 0.7 * (count - before) / PERIOD
        np.testing.assert_allclose(found["joint_rate"], rate, rtol=1e-12, atol=1e-12)
        at = jaw().kernel("instant").run({"q": found["q"], "q1": found["q1"]}).values
        A = np.moveaxis(at["A"], -1, 0).transpose(0, 2, 1)  # (N, n, m)
        for right in (count - at["joint"].T, rate - at["joint_rate"].T):
            left = np.einsum("nij,ni->nj", A, right)
            assert np.abs(left).max() < 1e-9 * np.abs(A).max() ** 2
        if not resolution:
            np.testing.assert_allclose(found["q"], s["q"], rtol=0, atol=1e-13)
        np.testing.assert_allclose(found["pose"], pose_of(found["q"]), rtol=0, atol=1e-12)


# -- loads -------------------------------------------------------------------------------------

LIMITS = {n: np.full((N, 6), v) for n, v in (("low", -WIDE), ("high", WIDE), ("speed", 1.0))}


def food(mode: int, t: float, s: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, list[float]]:
    """Force, and the guards that are on."""
    u, into = np.array([0.0, 0.6, 0.8]), t + s @ [0.0, 0.6, 0.8]
    push = 800.0 * into + 20.0 * max(v @ u, 0.0)
    if mode == APART:
        return np.zeros(3), [into]
    if mode == BROKEN:
        return np.zeros(3), [-into]
    return -u * (push if into > 0 else 0.0), [-into, push - 3.0, 1e-4 - (t - into)]


@pytest.mark.parametrize("mode", [APART, TOUCHING, BROKEN])
def test_loads_and_the_plant(mode: int) -> None:
    """Their wrench about O_M, the accelerations that it makes, works, and what is watched."""
    entries: list[dict[str, Any]] = [
        {"kind": "spring", "point": "incisor", "direction": (3.0, 0.0, 4.0), "stiffness": 150.0,
         "damping": 1.5, "rest": 1e-3},
        {"kind": "food", "point": "right_molar", "direction": (0.0, 3.0, 4.0), "thickness": 2e-3,
         "stiffness": 800.0, "damping": 20.0, "break_force": 3.0},
        {"kind": "constant", "force": (0.3, -0.2, -1.0), "moment": (0.0, 1e-3, 0.0)},
    ]  # fmt: skip
    loads = [LOADS[one["kind"]](**one).bind(machine(), one["kind"]) for one in entries]
    s = sampled()
    effort = 0.02 * np.random.default_rng(1).normal(size=(N, 6))
    ports = {"q": s["q"], "q1": s["q1"], "effort": effort, **LIMITS}
    for i, load in enumerate(loads):
        own = {"point": load.point, "mode": mode if load.name == "food" else 0, **load.numbers}
        for name, value in own.items():
            ports[f"load_{i}_{name}"] = np.broadcast_to(value, (N, np.size(value)))
    end = 0.002
    ports["bounds"] = np.broadcast_to([-end, -end, -WIDE, end, WIDE, end], (N, 6))
    laws = tuple(load.law for load in loads)
    answer = jaw().kernel("rate", laws, (1, 2), (0,)).run(ports)
    assert not answer.status.any()
    found = {name: np.moveaxis(a, -1, 0) for name, a in answer.values.items()}
    u = np.array([0.6, 0.0, 0.8])
    forces, guards = np.empty((N, 3, 3)), []
    total, moments = np.zeros((N, 6)), np.zeros((N, 3))
    for i, load in enumerate(loads):
        d, J = place(s["q"], load.point)
        v = np.einsum("nij,nj->ni", J, s["q1"])
        if load.name == "spring":
            forces[:, i] = -(150.0 * (d @ u - 1e-3) + 1.5 * (v @ u))[:, None] * u
        elif load.name == "food":
            both = [food(mode, 2e-3, *x) for x in zip(d, v, strict=True)]
            forces[:, i], guards = [f for f, _ in both], [g for _, g in both]
        else:
            forces[:, i], moments = entries[i]["force"], np.array([entries[i]["moment"]] * N)
        lever = d + load.point - pose_of(s["q"])[:, :3]
        total[:, :3] += forces[:, i]
        total[:, 3:] += np.cross(lever, forces[:, i]) + moments
        moments = np.zeros((N, 3))
    np.testing.assert_allclose(found["load_force"], forces, rtol=0, atol=1e-9)
    np.testing.assert_allclose(
        found["measured_force"], forces[:, 1] + forces[:, 2], rtol=0, atol=1e-9
    )
    close(found["wrench"], total, 1e-9)
    load9 = np.hstack([total, np.zeros((N, 3))])
    moved_by = jaw().forward_dynamics(s["q"], s["q1"], effort, *parts(load9), outputs="all")
    rate = found["rate"]
    np.testing.assert_array_equal(rate[:, :M], s["q1"])
    close(rate[:, M : 2 * M], moved_by.acceleration)
    close(rate[:, 2 * M], np.einsum("nj,nj->n", effort, s["joint_rate"]))
    close(rate[:, 2 * M + 1], np.einsum("nj,nj->n", total, np.hstack(twist(s["q"], s["q1"]))), 1e-9)
    assert (rate[:, 2 * M + 2 :] == 0).all()  # nothing rubs here
    close(found["contact_force"], moved_by.contact_force)
    close(found["too_fast"], np.abs(s["joint_rate"]) - 1.0)
    on = found["guards"][:, 6:] != -1.0
    assert (on.sum(axis=1) == len(guards[0])).all()
    np.testing.assert_allclose(found["guards"][:, 6:][on].reshape(N, -1), guards, atol=1e-9)
    at = jaw().poses.configuration(pose_of(s["q"])).contact_point[:, 0]
    faces = np.hstack([ports["bounds"][:, :3] - at, at - ports["bounds"][:, 3:]])
    np.testing.assert_allclose(found["guards"][:, :6], faces, atol=1e-12)
    jumps = [jump.mode for jump in loads[1].jumps]
    assert jumps == [TOUCHING, APART, APART, BROKEN, BROKEN]


def test_food_between_closed_teeth_is_broken() -> None:
    load = LOADS["food"](kind="food", food="bolus", point="incisor").bind(machine(), "food")
    assert load.begin(np.zeros(3)) == BROKEN and load.begin(np.array([0, 0, -0.02])) == APART
    assert "breaks at inf N" in load.jumps[3].text
