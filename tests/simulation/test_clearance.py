"""Contacts with clearance: closed forms, and a slider-crank against a solver of its own."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from oracles import slider_crank as oracle
from pydantic import ValidationError

import condyle

from .bodies import body, events, lifted

pytestmark = pytest.mark.slow  # builds kernels
G = 9.81
PLANE = {"kind": "plane", "slope": [0.0, 0.0], "offset": 0.0}
# The slider-crank's plane is turned about X, for a plane as a surface is not vertical.
ACROSS, NORMAL = np.array([0, 1, 1]) / np.sqrt(2), np.array([0, -1, 1]) / np.sqrt(2)


def test_ball_between_two_planes() -> None:
    """Thrown up without friction, it lands on the upper plane, then on the lower one."""
    c, e, v = 0.02, 0.5, 1.5
    ball = {"name": "ball", "point": [0, 0, 0], "surface": PLANE, "clearance": c, "restitution": e}
    solution = lifted(body([ball]), {"dZ": v}, 0.1)
    above, below = events(solution, "contact_landed")[:2]
    up = np.sqrt(v * v - 2 * G * c)
    first, speed = (v - up) / G, e * up
    down = np.sqrt(speed**2 + 4 * G * c)
    times = [first, first + (down - speed) / G]
    assert np.abs(np.array([above["time"], below["time"]]) - times).max() < 1e-12
    assert abs(above["state"]["dZ"] + e * up) < 1e-12
    assert abs(below["state"]["dZ"] - e * down) < 1e-12
    gap, Z = solution["contact_gap"].values[:, 0], solution["pose"].values[:, 2]
    assert np.abs(gap - (c - np.abs(Z))).max() < 1e-15
    kept = condyle.simulate(body([ball]), {"duration": 0.01, "start": {"dX": 1.0}})
    assert np.abs(kept["pose"].sel(coordinate="Z")).max() < 1e-15


def test_ball_in_a_socket_rests_on_either_side() -> None:
    """A pendulum in a spherical socket with play: its weight, or more at speed, on the outer face;
    thrown upwards slowly, it hangs on the inner one."""
    r, c, m = 0.1, 0.003, 0.2
    sphere = {"kind": "sphere", "centre": [0, 0, r], "radius": r}
    model = body([{"name": "ball", "point": [0, 0, 0], "surface": sphere, "clearance": c}], m)
    rest = lifted(model, {"Z": -c}, 0.01)
    assert np.abs(rest["contact_force"] + m * G).max() < 1e-9
    # Along the outer face: radius r + c; the force follows from the energy.
    v = 0.8
    swings = lifted(model, {"Z": -c, "dX": v}, 0.05)
    height = swings["pose"].sel(coordinate="Z").values + c
    force = m * (v * v - 2 * G * height) / (r + c) + m * G * (1 - height / (r + c))
    assert np.abs(swings["contact_force"].values[:, 0] + force).max() < 1e-8


@lru_cache
def slider_crank(degrees: float) -> condyle.Model:
    """With the crank there at home, and the slider in the middle of its guide."""
    crank = np.radians(degrees)
    rod = -np.arcsin(oracle.CRANK / oracle.ROD * np.sin(crank))
    tip = -oracle.ROD * np.array([np.cos(rod), np.sin(rod)])
    base = tip - oracle.CRANK * np.array([np.cos(crank), np.sin(crank)])
    m_crank, m_rod, m_slider = oracle.MASSES
    chain = {
        "name": "crank",
        "kind": "RSS",
        "base": [*placed(base)],
        "axis": [*NORMAL],
        "crank_tip": [*placed(tip)],
        "platform": [0.0, 0.0, 0.0],
        "crank": {
            "mass": m_crank, "com": oracle.CRANK / 2, "inertia": m_crank * oracle.CRANK**2 / 3,
        },
        "coupler": {
            "mass": m_rod, "com": 0.5, "transverse": m_rod * oracle.ROD**2 / 12, "axial": 0.0,
        },
        "actuator": {"torque_limit": 1.0},
    }  # fmt: skip
    ropes = [
        {
            "name": f"rope_{i}",
            "kind": "cable",
            "base": [*placed(at)],
            "platform": [*placed(on)],
            "actuator": {"force_limit": [0, 1.0]},
        }
        for i, (at, on) in enumerate((((3, 1), (0.05, 0)), ((-1, 4), (0, 0.02))))
    ]
    ends = [
        {
            "name": name,
            "point": [x, 0.0, 0.0],
            "surface": PLANE | {"slope": [0.0, -1.0], "offset": -oracle.HIGH * np.sqrt(2)},
            "side": "above",
            "ball_radius": oracle.HIGH,
            "clearance": oracle.CLEARANCE,
            "restitution": oracle.RESTITUTION,
            "friction": {"coefficient": oracle.FRICTION, "smoothing_speed": oracle.SMOOTHING},
        }
        for name, x in (("front", oracle.HALF), ("back", -oracle.HALF))
    ]
    guides = [
        {"name": f"guide_{i}", "point": [*placed(at)], "surface": PLANE | {"slope": [0.0, 1.0]}}
        for i, at in enumerate(((0.9, 0), (-0.9, 0.5), (-0.9, -0.5)))
    ]
    inertia = oracle.INERTIAS[2]
    about = {"xx": inertia, "yy": inertia, "zz": inertia}
    platform = {"mass": m_slider, "com": [0.0, 0.0, 0.0], "inertia": about}
    data: dict[str, Any] = {"name": "slider-crank", "platform": platform, "contact": guides + ends}
    data |= {"chain": [chain, *ropes], "gravity": [*(-oracle.G * ACROSS)]}
    return condyle.derive(condyle.Mechanism.model_validate(data), distribution="weighted")


def placed(planar: Any) -> np.ndarray:
    """A planar vector in {S}."""
    return np.array([planar[0], 0.0, 0.0]) + planar[1] * ACROSS


def start_of(y: np.ndarray, home: float, free: tuple[str, ...]) -> dict[str, float]:
    """Free coordinates of the slider in a state of the oracle, and their rates."""
    lengths = np.array([oracle.CRANK, oracle.ROD])
    q, w = y[:2], y[3:5]
    x0 = lengths @ np.cos([home, -np.arcsin(oracle.CRANK / oracle.ROD * np.sin(home))])
    place = placed([lengths @ np.cos(q) - x0, lengths @ np.sin(q)])
    speed = placed([-lengths @ (np.sin(q) * w), lengths @ (np.cos(q) * w)])
    n = NORMAL
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    R = np.eye(3) + np.sin(y[2]) * K + (1 - np.cos(y[2])) * K @ K
    D = y[5] * K @ R
    angles, rates = [], []
    for (a, da), (b, db) in (
        ((-R[1, 2], -D[1, 2]), (R[2, 2], D[2, 2])),
        ((R[0, 2], D[0, 2]), (np.hypot(R[0, 0], R[0, 1]), None)),
        ((-R[0, 1], -D[0, 1]), (R[0, 0], D[0, 0])),
    ):
        angles.append(np.arctan2(a, b))
        rates.append(da / b if db is None else (da * b - a * db) / (a * a + b * b))
    names = ("X", "Y", "Z", "alpha", "beta", "gamma")
    every = dict(zip(names, [*place, *angles], strict=True))
    every |= dict(zip([f"d{n}" for n in names], [*speed, *rates], strict=True))
    return {n: every[n] for name in free for n in (name, f"d{name}")}


@pytest.mark.parametrize("spin", [0.0, pytest.param(20.0, marks=pytest.mark.ci)])
def test_slider_crank_with_clearance(spin: float) -> None:
    """From dead centre to dead centre, where the slider does not say where the crank is. With
    spin the slider does not land on both ends at once."""
    run = oracle.run(np.array([0.0, 0.0, 0.0, 150.0, -75.0, spin]), 0.0, 0.05)
    t, y = np.array(run.t), np.array(run.y)
    crank, compared = np.degrees(y[:, 0]), 0
    for low, high, home in ((8.0, 172.0, 90.0), (188.0, 270.0, 260.0)):
        i, j = np.searchsorted(crank, (low, high))
        start, end = float(t[i]), float(t[min(j, len(t) - 1)])
        state = start_of(y[i], np.radians(home), ("X", "Y", "beta"))
        solution = lifted(slider_crank(home), state, end - start, rtol=1e-12)
        # Bounces end by rules of both sides' own, at speeds below.
        landings = [time for time, _, v in run.landings if start < time < end and v > 5e-4]
        releases = [time for time, _ in run.releases if start < time < end]
        for kind, wanted in (("contact_landed", landings), ("contact_lifted", releases)):
            times = start + once([event["time"] for event in events(solution, kind)])
            assert np.abs(times[:, None] - wanted).min(axis=0, initial=1.0).max(initial=0.0) < 1e-8
            assert len(times) - len(wanted) in (0, 1, 2)
        compared += len(landings)
        energy = solution["energy"]
        total = energy.sel(account=["kinetic", "potential", "contact_friction"]).sum("account")
        assert np.abs(total / total[0] - 1).max() < 1e-8
    assert compared >= (11, 18)[spin > 0]


def once(times: list[float]) -> np.ndarray:
    """Of contacts that land together the first."""
    found = np.array(times)
    return found[np.diff(found, prepend=-1.0) > 1e-10]


def test_clearance_is_of_two_sided_contacts() -> None:
    contact = {"name": "a", "point": [0, 0, 0], "surface": PLANE, "clearance": 1e-3}
    with pytest.raises(ValidationError, match="two-sided contact; remove it, or one_sided"):
        condyle.mechanism.contact.Contact.model_validate(
            contact | {"side": "above", "one_sided": True}
        )
    sphere = {"kind": "sphere", "centre": [0, 0, 5e-4], "radius": 5e-4}
    with pytest.raises(ValidationError, match=r"expected less than 0\.5 mm"):
        condyle.mechanism.contact.Contact.model_validate(contact | {"surface": sphere})
