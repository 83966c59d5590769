"""Contacts that lift and land, against closed forms of free bodies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq
from support.machines import model

import condyle
from benchmarks.bites import bitten, robot
from condyle.errors import ScenarioError, UnsupportedError
from condyle.questions.load.food import FOODS
from condyle.simulation.live import Live
from condyle.simulation.simulating import planned

from .bodies import body, events, lifted, on_plane

pytestmark = pytest.mark.slow  # builds kernels
G = 9.81
RIGID = {"contacts": {"kind": "rigid"}}


def test_bouncing_ball() -> None:
    e, r, h = 0.8, 0.05, 0.5
    solution = lifted(body([on_plane((0, 0, 0), r, restitution=e)]), {"Z": h}, 3.0)
    landings = events(solution, "contact_landed")
    v = e ** np.arange(1, 21) * np.sqrt(2 * G * h)
    times = np.sqrt(2 * h / G) + np.cumsum([0, *(2 * v[:-1] / G)])
    found = np.array([[event["time"], event["state"]["dZ"]] for event in landings[:20]])
    assert np.abs(found[:, 0] - times).max() < 1e-12
    assert np.abs(found[:, 1] ** 2 / (2 * G) - v**2 / (2 * G)).max() < 1e-12
    end = np.sqrt(2 * h / G) * (1 + e) / (1 - e)  # of infinitely many bounces
    assert landings[-1]["text"].endswith("stays")
    # The rule: no rebound that would rise less than 1e-9 of the size, here 54 mm.
    assert 0 < end - landings[-1]["time"] < 2 * np.sqrt(2e-9 * 0.054 / G) / (1 - e)
    lift = solution.condyle.contact_lifts["contact"]
    assert lift["count"] == len(landings) and lift["point"] == [0, 0, h]
    assert lift["first"] == 0 and lift["last"] == landings[-1]["time"]
    assert abs(lift["open"] - lift["last"]) < 1e-9
    assert abs(lift["landing_speed"] - np.sqrt(2 * G * h)) < 1e-9
    at_rest = solution.sel(time=slice(end + 1e-6, None))
    assert np.abs(at_rest["contact_force"] - 0.2 * G).max() < 1e-11
    assert np.abs(at_rest["pose"]).max() < 1e-9
    energy = solution["energy"]
    lost = energy.sel(account="contact_friction").values
    kept = energy.sel(account=["kinetic", "potential"]).sum("account").values
    assert np.abs(kept + lost - kept[0]).max() < 1e-12


@pytest.mark.ci
@pytest.mark.parametrize("food", FOODS)
def test_a_bite_that_lands_on_food(food: str) -> None:
    """Under force control without a preload: the balls lift and land, and the force is held."""
    solution = bitten(robot(), "bite_force", food, 0.0)
    lifts = solution.condyle.contact_lifts
    assert solution["time"][-1] == 1.9 and {*lifts} == {"left_condyle", "right_condyle"}
    assert {event["kind"] for event in solution.condyle.events} >= {
        "contact_lifted",
        "food_touched",
    }
    push, gap = -solution["contact_force"].values, solution["contact_gap"].values
    assert push.min() > -1e-9 and gap.min() > -1e-12 and (np.minimum(push, gap) < 1e-9).all()
    force = np.linalg.norm(solution["load_force"].values[:, 0], axis=1)
    assert force[solution["time"].values > 1.75].min() > 19.5 and force.max() < 21.0


def swing(I: float, m: float, b: float, h: float, amplitude: float) -> float:
    """Time of a block on a frictionless floor from rest at a tilt to upright, by its energy."""

    def rate(s: float) -> float:  # of time by the root of the angle fallen
        tilt, mean = amplitude - s * s, amplitude - s * s / 2
        lever = b * np.cos(tilt) - h * np.sin(tilt)
        fallen = (b * np.cos(mean) - h * np.sin(mean)) * np.sinc(s * s / 2 / np.pi)  # over s^2
        return 2 * np.sqrt((I + m * lever**2) / (2 * m * G * fallen))

    return float(quad(rate, 0, np.sqrt(amplitude), epsabs=1e-13, epsrel=1e-13)[0])


def test_rocking_block() -> None:
    m, b, h, I = 0.5, 0.03, 0.12, 0.004
    corners = [on_plane((x, 0, -h), name=name) for x, name in ((-b, "left"), (b, "right"))]
    tilt = 0.1
    start = {"beta": tilt, "Z": b * np.sin(tilt) + h * np.cos(tilt) - h}
    model = body(corners, m, (0.005, I, 0.003))
    solution = lifted(model, start, 1.2, rtol=1e-12)
    landings = events(solution, "contact_landed")
    times, amplitude = [swing(I, m, b, h, tilt)], tilt
    ratio = (I - m * b * b) / (I + m * b * b)
    energy = m * G * start["Z"]
    for _ in range(5):
        energy *= ratio**2
        amplitude = brentq(
            lambda x, e=energy: m * G * (b * np.sin(x) + h * np.cos(x) - h) - e, 0, amplitude,
            xtol=1e-16,
        )  # fmt: skip
        times.append(times[-1] + 2 * swing(I, m, b, h, amplitude))
    assert [event["owner"] for event in landings[:6]] == ["left", "right"] * 3
    assert np.abs(np.array([event["time"] for event in landings[:6]]) - times).max() < 1e-8


def test_contacts_that_only_touch_stay() -> None:
    """They have no force but that of rounding, which pulls."""
    corners = [(-0.1, -0.1, -0.1), (-0.1, 0.1, -0.1), (0.1, 0.0, -0.1)]
    for points in ([(0, 0, 0)], corners):
        some = [on_plane(point, name=f"contact_{i}") for i, point in enumerate(points)]
        weightless = body(some).mechanism.set({"gravity": [1e-14, 0, 1e-12]})
        solution = lifted(condyle.derive(weightless), {}, 0.05)
        assert not solution.condyle.events and np.abs(solution["pose"]).max() < 1e-14


def test_ball_slides_down_an_incline() -> None:
    r, m, mu, slope, v = 0.05, 0.2, 0.1, 0.6, 1.0
    inertia = 0.4 * m * r * r
    friction = {"coefficient": mu, "smoothing_speed": 1e-6}
    ball = body([on_plane((0, 0, 0), r, slope=[0.0, -slope], friction=friction)], m, (inertia,) * 3)
    t = 0.5
    across = 1 / np.hypot(1, slope)  # cosine of the incline
    solution = lifted(ball, {"dY": v * across, "dZ": -v * slope * across}, t)
    down = v * t + (slope - mu) * across * G * t * t / 2
    pose = solution["pose"].values[-1]
    assert abs(pose[1] - down * across) < 1e-8 and abs(pose[2] + down * slope * across) < 1e-8
    assert abs(pose[3] + 2.5 * mu * G * across / r * t * t / 2) < 1e-8
    assert not events(solution, "contact_lifted")
    force = solution["contact_force"].values
    assert np.abs(force - m * G * across).max() < 1e-9


def test_spinning_ball_slides_and_sticks_at_landings() -> None:
    r, m, mu, e, h, spin = 0.05, 0.2, 0.3, 0.7, 0.4, 120.0
    inertia = 0.4 * m * r * r
    friction = {"coefficient": mu, "smoothing_speed": 1e-6}
    contact = on_plane((0, 0, 0), r, restitution=e, friction=friction)
    ball = body([contact], m, (inertia,) * 3)
    solution = lifted(ball, {"Z": h, "dalpha": spin}, 1.2)
    landings, sticks = events(solution, "contact_landed")[:3], []
    down, along, omega = np.sqrt(2 * G * h), 0.0, spin
    for event in landings:
        slip = along + r * omega  # of the lowest point, along Y
        most = mu * (1 + e) * down
        sticks.append(abs(slip) * 2 / 7 < most)
        change = -slip * 2 / 7 if sticks[-1] else -np.sign(slip) * most
        along, omega = along + change, omega + 2.5 * change / r
        down *= e
        state = event["state"]
        found = np.array([state["dY"], state["dZ"], state["dalpha"] * r])
        assert np.abs(found - [along, down, omega * r]).max() < 1e-9
    assert sticks == [False, True, True]


def test_energy_is_kept_by_restitution_1() -> None:
    contact = on_plane((0, 0, 0), 0.05, restitution=1.0)
    ball = body([contact], 0.2, (3e-4, 2e-4, 2e-4), (0, 0.02, 0.0))
    solution = lifted(ball, {"Z": 0.3, "dalpha": 3.0, "dX": 0.2}, 10.0)
    assert len(events(solution, "contact_landed")) > 15
    energy = solution["energy"].sel(account=["kinetic", "potential"]).sum("account").values
    assert np.abs(energy / energy[0] - 1).max() < 1e-9
    X = solution["pose_rate"].sel(coordinate="X").values
    assert np.abs(X - 0.2).max() < 1e-9


def test_momentum_at_landings() -> None:
    """M dq' = J^T P for unit impulses P: M of another question, J from the contacts' velocities."""
    r, rng = 0.05, np.random.default_rng(46)
    feet = [on_plane((0.1 * i, 0.05 * i * i, -0.01 * i), r, name=f"foot_{i}") for i in range(3)]
    held = on_plane((0, 0.1, 0), name="held", slope=[0.3, 0.2]) | {"one_sided": False}
    made = body([*feet, held], 0.2, (3e-4, 2e-4, 2.5e-4), (0.01, 0.02, -0.01))
    free = planned(made, [RIGID])[0].freed
    assert free is not None and free.lifting is not None
    count = len(free.lifting.names)
    for _ in range(20):
        q = rng.normal(size=5) * 0.2
        ports = {"q": np.tile(q, (5, 1)), "q1": np.eye(5)}
        ports |= {name: np.tile(x, (5, 1)) for name, x in free.lifting.ports().items()}
        values = free.model.kernel("impact", free.lifting.forms).run(ports).values
        J = values["velocity"].reshape(3 * count, 5)
        response = values["q_response"][..., 0].reshape(5, 3 * count)
        assert np.abs(free.model.mass_matrix(q) @ response - J.T).max() < 1e-9
        G = values["impulse_response"][..., 0].reshape(3 * count, 3 * count)
        assert np.abs(G - J @ response).max() < 1e-9 * np.abs(G).max()


def test_contacts_that_never_lift_move_as_kept_ones() -> None:
    """The elimination of kept contacts, and multipliers with projection, share no equation."""
    start = {"dX": 0.1, "Y": 0.002, "dalpha": 0.2, "dgamma": 0.3}
    probe, scenario = model("sphere-in-cylinder"), {"duration": 0.1, "rtol": 1e-11, "start": start}
    kept, rigid = (condyle.simulate(probe, scenario | more) for more in ({}, RIGID))
    assert not events(rigid, "contact_lifted")
    for name, most in (("pose", 1e-10), ("contact_force", 1e-7), ("share", 1e-8)):
        assert np.abs(kept[name].values - rigid[name].values).max() < most
    assert rigid["contact_active"].all() and np.abs(rigid["contact_gap"]).max() < 1e-13


def test_no_sample_pulls_or_overlaps() -> None:
    """A body on three feet, thrown: what lands, slides, lifts and comes to rest."""
    rng, size = np.random.default_rng(46), 0.06
    feet = [
        on_plane((size * np.cos(a), size * np.sin(a), -0.04), restitution=e, name=f"foot_{i}")
        for i, (a, e) in enumerate(zip(2 * np.pi * np.arange(3) / 3, (0.0, 0.3, 0.6), strict=True))
    ]
    thrown, lands = body(feet, 0.4, (4e-4, 5e-4, 7e-4)), 0
    for _ in range(3):
        start = {"Z": 0.03, "alpha": rng.uniform(-0.3, 0.3), "beta": rng.uniform(-0.3, 0.3)}
        start |= {"dalpha": rng.normal(), "dbeta": rng.normal(), "dX": rng.normal()}
        solution = lifted(thrown, start, 0.4, rtol=1e-9)
        force, gap = solution["contact_force"].values, solution["contact_gap"].values
        active = solution["contact_active"].values
        assert len(force) == 401 and (force >= 0).all() and not force[~active].any()
        assert gap.min() > -1e-9 and np.abs(gap[active]).max(initial=0.0) < 1e-12
        lands += len(events(solution, "contact_landed"))
    assert lands > 20


def test_what_cannot_lift_is_said() -> None:
    with pytest.raises(ScenarioError, match="there are none: set one_sided = true or clearance"):
        condyle.simulate("masticatory", RIGID)
    bilateral = on_plane((0, 0, 0), 0.05, name="held") | {"one_sided": False}
    rough = bilateral | {"friction": {"coefficient": 0.1}}
    foot = on_plane((0.03, 0, -0.05), name="foot")
    with pytest.raises(ScenarioError, match="remove it from held, or set one_sided"):
        condyle.simulate(body([rough, foot]), RIGID)
    machine = body([on_plane((0, 0, 0), 0.05)]).mechanism
    few = machine.replace(chains=machine.chains[:5])
    with pytest.raises(ScenarioError, match='"rigid" frees 6 coordinates, and the 5 chains'):
        condyle.simulate(few, RIGID)
    with pytest.raises(ScenarioError, match="Z is not free"):
        condyle.simulate(machine, {"start": {"Z": 0.1}})
    with pytest.raises(ScenarioError, match=r"contact\" is .* beyond its surface"):
        condyle.simulate(machine, {"start": {"Z": -0.1}} | RIGID)


def test_where_contacts_are_kept_is_said() -> None:
    probe = model("sphere-in-cylinder")
    with pytest.raises(UnsupportedError, match="live simulation keeps contacts"):
        Live(planned(probe, [RIGID])[0])
    report = condyle.check_gains(
        probe,
        {"controller": {"kind": "computed_torque", "stiffness": 400.0, "damping": 40.0}} | RIGID,
    )
    assert report.stable is None and "with all contacts kept" in report.warnings[-1]
