"""Laws, sensors and loads against their equations, written anew with numpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from questions.jaw import Arrays, M, N, jaw, place, point, pose_of, run, sampled, times, twist
from support.loads import parts

from condyle.motion import resolve_load_point
from condyle.questions.entries import Machine
from condyle.questions.law import CONTROLLERS
from condyle.questions.law.bite_force import BITING, FREE, LEAVING
from condyle.questions.load import LOADS
from condyle.questions.load.food import APART, BROKEN, TOUCHING

PERIOD, WIDE = 2e-3, 1e100


def bound(kind: Any, entries: dict[str, Any], *name: str) -> Any:
    mechanism = jaw().mechanism
    points = mechanism.platform.points
    machine = Machine(
        mechanism, jaw().independent, lambda n: resolve_load_point(n, points), lambda f: f
    )
    return kind(**entries).bind(machine, *name)


def asked(
    entries: dict[str, Any], memory: Any = None, low: float = -WIDE, high: float = WIDE
) -> Arrays:
    """Results of the tick of a controller's table."""
    law = bound(CONTROLLERS[entries["kind"]], entries)
    ports = {**sampled(), **law.numbers, "period": PERIOD}
    ports |= {"low": np.full(6, low), "high": np.full(6, high)}
    if memory is not None:
        ports["memory_before"] = memory
    return run(jaw().kernel("tick", law.table, law.choices), ports)


def inverse(q: np.ndarray, q1: np.ndarray, q2: np.ndarray, force: Any = 0.0) -> np.ndarray:
    """Efforts that bear a force at the molar, too."""
    load = np.zeros((N, 9))
    load[:, :3], load[:, 6:] = force, point()
    return jaw().inverse_dynamics(q, q1, q2, *parts(load)).effort


def close(found: np.ndarray, expected: np.ndarray, bound: float = 1e-10) -> None:
    """1e-10 is rounding; 1e-8 that of Jacobians by differences of poses."""
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
    s, rng, D = sampled(), np.random.default_rng(1), np.array([[0.0, 0, 1], [1, 0, 0]])
    before, begun = rng.normal(size=(N, 2)), rng.uniform(0, 1, (N, 1))
    found = asked(entries, np.hstack([before, np.zeros((N, 1)), begun]))
    J = D @ place(s["q"], point())[1]
    M_inv, turned = np.linalg.inv(jaw().mass_matrix(s["q"])), J.transpose(0, 2, 1)
    free = back(300.0, 17.0)
    lever = M_inv @ turned @ np.linalg.inv(J @ M_inv @ turned)
    q2 = free - times(lever, times(J, free) + 80.0 * times(J, s["q1"]))
    share = np.minimum(begun + PERIOD / 0.05, 1)
    wanted = share * [20.0, -5.0]
    error = wanted + s["force"] @ D.T
    push = wanted + 0.4 * error + 3.0 * before
    close(found["asked"], inverse(s["q"], s["q1"], q2, -push @ D), 1e-8)
    total = before + (share >= 1) * error * PERIOD
    close(found["memory"], np.hstack([total, np.zeros((N, 1)), share]))


def test_computed_torque() -> None:
    s, Kp = sampled(), [100.0, 200.0, 300.0, 400.0]
    found = asked({"kind": "computed_torque", "stiffness": Kp, "damping": 17.0})
    close(found["asked"], inverse(s["q"], s["q1"], back(Kp, 17.0)))
    found = asked({"kind": "computed_torque", "stiffness": Kp})  # critically damped
    close(found["asked"], inverse(s["q"], s["q1"], back(Kp, 2 * np.sqrt(Kp))))
    for name in ("q", "q1", "joint", "joint_rate"):
        np.testing.assert_array_equal(found[name], s[name])


def test_joint_pd_within_limits() -> None:
    s, K = sampled(), np.arange(1.0, 7.0)
    entries: dict[str, Any] = {"kind": "joint_pd", "stiffness": tuple(K), "damping": tuple(K / 50)}
    wanted = K * (s["joint_d"] - s["joint"]) + K / 50 * (s["joint_rate_d"] - s["joint_rate"])
    close(asked(entries | {"gravity": False})["asked"], wanted)
    wanted += inverse(s["q_d"], 0 * s["q"], 0 * s["q"])
    found = asked(entries | {"gravity": True}, low=-0.05, high=0.02)
    close(found["asked"], wanted)
    np.testing.assert_array_equal(found["effort"], np.clip(found["asked"], -0.05, 0.02))
    assert (found["effort"] != found["asked"]).any()


def test_impedance() -> None:
    s, k = sampled(), np.array([2e3, 3e3, 4e3])
    found = asked({"kind": "impedance", "stiffness": tuple(k), "damping": 30.0, "posture": 90.0})
    (p, J), (p_d, J_d) = (place(s[name], point()) for name in ("q", "q_d"))
    force = k * (p_d - p) + 30.0 * (times(J_d, s["q1_d"]) - times(J, s["q1"]))
    free = 90.0 * (s["q_d"] - s["q"]) + 2 * np.sqrt(90.0) * (s["q1_d"] - s["q1"])
    by = np.linalg.solve(jaw().mass_matrix(s["q"]), J.transpose(0, 2, 1))
    taken = times(by @ np.linalg.pinv(J @ by, hermitian=True) @ J, free)
    close(found["asked"], inverse(s["q"], s["q1"], s["q2_d"] + free - taken, -force), 1e-8)


BITE: dict[str, Any] = {
    "kind": "bite_force", "stiffness": 900.0, "force": 40.0, "direction": (3.0, 0.0, 4.0),
}  # fmt: skip


def mode_next(mode: float, measured: float, ahead: float, closing: float) -> float:
    if measured < 1.0:
        return FREE
    if mode == BITING:
        return LEAVING if ahead < -2e-4 and closing < 0 else BITING
    return BITING if mode == FREE and measured > 2.0 and closing > 0 else mode


def test_bite_force() -> None:
    s, u = sampled(), np.array([0.6, 0.0, 0.8])
    entries = BITE | {"proportional": 0.4, "integral": 6.0, "bite_damping": 120.0}
    entries["rise"] = 20 * PERIOD
    J = np.einsum("i,nij->nj", u, place(s["q"], point())[1])
    measured = -s["force"] @ u
    ahead, closing = ((J * x).sum(axis=1) for x in (s["q_d"] - s["q"], s["q1_d"]))
    met = set()
    for before, share in ((FREE, 0.5), (BITING, 0.97), (BITING, 0.3), (LEAVING, 0.5)):
        found = asked(entries, np.tile([before, 0.2, share], (N, 1)))
        mode = np.array([mode_next(before, *x) for x in zip(measured, ahead, closing, strict=True)])
        aim, part = s["force_d"][:, 0], min(share + 0.05, 1.0)
        error, biting = part * aim - measured, mode == BITING
        total = np.where(biting, 0.2 + (part == 1.0) * error * PERIOD, 0.0)
        rises = np.where(biting, part, np.clip(measured / aim, 0.0, 1.0))
        right = np.column_stack([mode, total, rises])
        np.testing.assert_allclose(found["memory"], right, rtol=1e-12)
        q2 = back(900.0, 60.0)
        by = np.linalg.solve(jaw().mass_matrix(s["q"]), J[..., None])[..., 0]
        along = (J * (q2 + 120.0 * s["q1"])).sum(axis=1) / (J * by).sum(axis=1)
        q2 = q2 - np.where(biting, along, 0)[:, None] * by
        push = np.where(biting, part * aim + 0.4 * error + 6.0 * 0.2, measured)
        close(found["asked"], inverse(s["q"], s["q1"], q2, -push[:, None] * u), 1e-8)
        met |= {(before, m) for m in mode}
    assert {(FREE, BITING), (BITING, BITING), (BITING, LEAVING), (LEAVING, LEAVING)} <= met
    assert {(BITING, FREE), (FREE, FREE)} <= met


def test_an_integral_does_not_grow_where_limits_cut() -> None:
    memory = np.tile([BITING, 0.2, 1.0], (N, 1))
    free, cut = (asked(BITE, memory, -limit, limit)["memory"] for limit in (WIDE, 1e-6))
    held = (cut[:, 0] == BITING) & (free[:, 1] > 0.2)
    assert held.any() and (cut[held, 1] == 0.2).all()
    shrinks = free[:, 1] < 0.2
    np.testing.assert_array_equal(cut[shrinks], free[shrinks])


@pytest.mark.parametrize("velocity", ["difference", "exact"])
def test_an_observer_counts_and_finds_the_state(velocity: str) -> None:
    """Exact encoders give the state; coarse ones the least squares of their counts."""
    s, rng = sampled(), np.random.default_rng(8)
    before = s["joint"] - PERIOD * s["joint_rate"] + 1e-5 * rng.normal(size=(N, 6))
    off = 1e-3 * rng.normal(size=(N, 6)) * [0.02, 0.02, 0.02, 1, 1, 1]
    ports = {
        "joint": s["joint"], "joint_rate": s["joint_rate"], "period": PERIOD, "smoothing": 0.3,
        "pose_before": pose_of(s["q"]) - off, "pose_rate_before": np.zeros(6),
        "joint_before": before, "joint_rate_before": s["joint_rate"] * 1.1,
    }  # fmt: skip
    for step in (0.0, 1e-3):
        found = run(jaw().kernel("observer", velocity), {**ports, "resolution": np.full(6, step)})
        count = step * np.round(s["joint"] / step) if step else s["joint"]
        np.testing.assert_allclose(found["joint"], count, rtol=0, atol=1e-15)
        rate = s["joint_rate"]
        if velocity == "difference":
            rate = 0.3 * 1.1 * rate + 0.7 * (count - before) / PERIOD
        np.testing.assert_allclose(found["joint_rate"], rate, rtol=1e-12, atol=1e-12)
        at = run(jaw().kernel("instant"), {"q": found["q"], "q1": found["q1"]})
        for right in (count - at["joint"], rate - at["joint_rate"]):  # A: (N, m, n)
            assert np.abs(times(at["A"], right)).max() < 1e-9 * np.abs(at["A"]).max() ** 2
        if not step:
            np.testing.assert_allclose(found["q"], s["q"], rtol=0, atol=1e-13)
        np.testing.assert_allclose(found["pose"], pose_of(found["q"]), rtol=0, atol=1e-12)


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
    loads = [bound(LOADS[one["kind"]], one, one["kind"]) for one in entries]
    s, end, u = sampled(), 0.002, np.array([0.6, 0.0, 0.8])
    effort = 0.02 * np.random.default_rng(1).normal(size=(N, 6))
    bounds = np.array([-end, -end, -WIDE, end, WIDE, end])
    ports = {"q": s["q"], "q1": s["q1"], "effort": effort, "bounds": bounds}
    ports |= {"low": np.full(6, -WIDE), "high": np.full(6, WIDE), "speed": np.ones(6)}
    for i, load in enumerate(loads):
        own = {"point": load.point, "mode": mode if i == 1 else 0, **load.numbers}
        ports |= {f"load_{i}_{name}": value for name, value in own.items()}
    found = run(jaw().kernel("rate", tuple(one.law for one in loads), (1, 2), (0,)), ports)

    places = [place(s["q"], load.point) for load in loads]
    (d, v), (d_f, v_f), _ = ((d, times(J, s["q1"])) for d, J in places)
    foods = [food(mode, 2e-3, *x) for x in zip(d_f, v_f, strict=True)]
    forces = np.stack(
        [
            -(150.0 * (d @ u - 1e-3) + 1.5 * (v @ u))[:, None] * u,
            np.array([force for force, _ in foods]),
            np.tile(entries[2]["force"], (N, 1)),
        ],
        axis=1,
    )
    total = np.hstack([forces.sum(axis=1), np.tile(entries[2]["moment"], (N, 1))])
    for i, load in enumerate(loads):
        lever = places[i][0] + load.point - pose_of(s["q"])[:, :3]
        total[:, 3:] += np.cross(lever, forces[:, i])
    np.testing.assert_allclose(found["load_force"], forces, rtol=0, atol=1e-9)
    measured = forces[:, 1] + forces[:, 2]
    np.testing.assert_allclose(found["measured_force"], measured, rtol=0, atol=1e-9)
    close(found["wrench"], total, 1e-9)

    load9 = np.hstack([total, np.zeros((N, 3))])
    moved_by = jaw().forward_dynamics(s["q"], s["q1"], effort, *parts(load9), outputs="all")
    rate = found["rate"]
    np.testing.assert_array_equal(rate[:, :M], s["q1"])
    close(rate[:, M : 2 * M], moved_by.acceleration)
    close(rate[:, 2 * M], (effort * s["joint_rate"]).sum(axis=1))
    close(rate[:, 2 * M + 1], (total * twist(s["q"], s["q1"])).sum(axis=1), 1e-9)
    assert (rate[:, 2 * M + 2 :] == 0).all()  # nothing rubs here
    close(found["contact_force"], moved_by.contact_force)
    close(found["too_fast"], np.abs(s["joint_rate"]) - 1.0)
    guards, on = [guard for _, guard in foods], found["guards"][:, 6:] != -1.0
    assert (on.sum(axis=1) == len(guards[0])).all()
    np.testing.assert_allclose(found["guards"][:, 6:][on].reshape(N, -1), guards, atol=1e-9)
    at = jaw().poses.configuration(pose_of(s["q"])).contact_point[:, 0]
    faces = np.hstack([bounds[:3] - at, at - bounds[3:]])
    np.testing.assert_allclose(found["guards"][:, :6], faces, atol=1e-12)
    jumps = [jump.mode for jump in loads[1].jumps]
    assert jumps == [TOUCHING, APART, APART, BROKEN, BROKEN]


def test_food_between_closed_teeth_is_broken() -> None:
    load = bound(LOADS["food"], {"kind": "food", "food": "bolus", "point": "incisor"}, "food")
    assert load.begin(np.zeros(3)) == BROKEN and load.begin(np.array([0, 0, -0.02])) == APART
    assert "breaks at inf N" in load.jumps[3].text
