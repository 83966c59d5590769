"""Plants whose contacts lift and land, against closed forms and `condyle simulate`."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from export.test_fmu import Unit, quiet
from fmpy.validation import validate_fmu
from scipy.optimize import brentq
from scipy.special import gamma
from simulation.bodies import body, on_plane

import condyle
from condyle.errors import InputError, UnsupportedError
from condyle.export import fmu as target
from condyle.simulation.compliant import ContactLaws
from condyle.simulation.simulating import planned

Array = np.ndarray
G, R, M = 9.81, 0.05, 0.2
STEEL = {"kind": "hertz", "modulus": 2e9, "poisson": 0.3}
RIGID, COMPLIANT = ({"contacts": {"kind": kind}} for kind in ("rigid", "compliant"))
HOW = ("CoSimulation", "ModelExchange")

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")


@pytest.fixture
def plant(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Exports a scenario's plant, which fmpy finds nothing to warn of."""
    monkeypatch.setattr(target, "FLAGS", tuple(f for f in target.FLAGS if f != "-O2"))

    def made(model: Any, scenario: dict[str, Any], fmi: Any = 3) -> Path:
        path = tmp_path / f"plant{fmi}.fmu"
        condyle.export_fmu(model, path, kind="plant", fmi=fmi, scenario=scenario)
        assert validate_fmu(str(path)) == []
        return path

    return made


def run(path: Path, how: str, seconds: float, outputs: list[str], every: float = 1e-3) -> Any:
    """Outputs over time, without the rows of events."""
    options: dict[str, Any] = {"start_values": {"tolerance": 1e-11}}
    if how == "ModelExchange":
        options |= {"solver": "CVode", "relative_tolerance": 1e-10}
    found = fmpy.simulate_fmu(
        str(path), fmi_type=how, stop_time=seconds, output_interval=every, output=outputs,
        record_events=False, **options,
    )  # fmt: skip
    return found


def height(t: Array, e: float, h: float) -> Array:
    """Of a ball that falls from h and bounces until it lies."""
    z, start, v = np.where(t < np.sqrt(2 * h / G), h - G * t * t / 2, 0.0), np.sqrt(2 * h / G), 0.0
    for k in range(1, 200):
        v = e**k * np.sqrt(2 * G * h)
        s = t - start
        z = np.where((s >= 0) & (s < 2 * v / G), v * s - G * s * s / 2, z)
        start += 2 * v / G
    return z


@pytest.mark.parametrize("version", [2, 3])
def test_bouncing_ball(plant: Any, version: int, tmp_path: Path) -> None:
    """Heights of all bounces and of the rest after them, by the unit's steps and by a host's."""
    e, h = 0.8, 0.5
    ball = body([on_plane((0, 0, 0), R, restitution=e)])
    path = plant(ball, RIGID | {"start": {"Z": h}}, version)
    outputs = ["q.Z", "active.contact", "contact_force.contact", "gap.contact"]
    for how, bound in zip(HOW, (1e-10, 1e-6), strict=True):
        found = run(path, how, 3.0, outputs)
        assert np.abs(found["q.Z"] - height(found["time"], e, h)).max() < bound
        assert np.abs(found["gap.contact"] - found["q.Z"]).max() < 1e-12
        assert (found["active.contact"][0], found["active.contact"][-1]) == (0, 1)
        assert abs(found["contact_force.contact"][-1] - M * G) < 1e-9
    fmpy.extract(str(path), unzipdir=str(tmp_path / "unit"))
    quiet("gcc", tmp_path / "unit")


def test_restitution_1_keeps_energy(plant: Any) -> None:
    ball = body([on_plane((0, 0, 0), R, restitution=1.0)])
    path = plant(ball, RIGID | {"start": {"Z": 0.1, "dX": 0.3}})
    found = run(path, "CoSimulation", 10.0, ["q.Z", "q1.Z"], 0.01)
    energy = found["q1.Z"] ** 2 / 2 + G * found["q.Z"]
    assert np.abs(energy / (G * 0.1) - 1).max() < 1e-9
    assert (found["q1.Z"] > 0).sum() > 300


def test_spinning_ball_slides_and_sticks_at_landings(plant: Any, tmp_path: Path) -> None:
    """Poisson's and Coulomb's laws at three landings; the first slides, the others stick."""
    mu, e, h, spin = 0.3, 0.7, 0.4, 120.0
    friction = {"coefficient": mu, "smoothing_speed": 1e-6}
    contact = on_plane((0, 0, 0), R, restitution=e, friction=friction)
    path = plant(
        body([contact], M, (0.4 * M * R * R,) * 3), RIGID | {"start": {"Z": h, "dalpha": spin}}
    )
    down, along, turn, after = np.sqrt(2 * G * h), 0.0, spin, []
    for _ in range(3):
        slip, most = along + R * turn, mu * (1 + e) * down
        change = -slip * 2 / 7 if abs(slip) * 2 / 7 < most else -most
        along, turn, down = along + change, turn + 2.5 * change / R, e * down
        after.append([along, R * turn])
    for how, bound in zip(HOW, (1e-9, 1e-6), strict=True):
        found = run(path, how, 1.2, ["q1.Y", "q1.alpha"])[[400, 800, 1100]]  # between landings
        got = np.stack([found["q1.Y"], R * found["q1.alpha"]], 1)
        assert np.abs(got - after).max() < bound
    fmpy.extract(str(path), unzipdir=str(tmp_path / "unit"))
    quiet("gcc", tmp_path / "unit")


def machines() -> dict[str, Any]:
    b, h, inertia, tilt = 0.03, 0.12, (0.005, 0.004, 0.003), 0.1
    up = b * np.sin(tilt) + h * np.cos(tilt) - h
    corners = [on_plane((x, 0, -h), name=name) for x, name in ((-b, "left"), (b, "right"))]
    plane = {"kind": "plane", "slope": [0.0, 0.0], "offset": 0.0}
    three = [(-b, -b), (b, -b), (b, b)]
    feet = [on_plane((*p, -h), name=f"foot {i}", restitution=0.6) for i, p in enumerate(three)]
    rough = {"coefficient": 0.2, "smoothing_speed": 1e-6}
    rubbing = [foot | {"restitution": 0.4, "friction": rough} for foot in feet]
    loose = {"name": "ball", "point": [0, 0, 0], "surface": plane, "clearance": 1e-3}
    guide = {"name": "guide", "point": [0.1, 0, 0], "surface": plane}
    hinged = [guide, on_plane((-0.05, 0, 0), restitution=0.7)]
    return {
        "rocking block": (body(corners, 0.5, inertia), {"beta": tilt, "Z": up}, 1.0),
        "feet": (body(feet, 0.5, inertia), {"beta": 0.05, "alpha": 0.03, "Z": 0.02}, 0.3),
        "rough feet": (
            body(rubbing, 0.5, inertia),
            {"beta": 0.05, "alpha": 0.03, "Z": 0.02, "dX": 0.1},
            0.3,
        ),
        "clearance": (body([loose | {"restitution": 0.5}]), {"dZ": 0.3, "dbeta": 1.0}, 0.3),
        "guided": (body(hinged, 0.5, inertia), {"beta": 0.1}, 0.6),
    }


@pytest.mark.ci
@pytest.mark.parametrize("name", machines())
def test_contacts_are_those_of_the_simulation(plant: Any, name: str) -> None:
    """Several contacts, both faces of one, and beside one that always holds: landings, releases,
    rest, and forces of all."""
    model, start, seconds = machines()[name]
    scenario = RIGID | {"start": start, "duration": seconds, "rtol": 1e-11}
    own = condyle.simulate(model, scenario)
    assert len([e for e in own.condyle.events if e["kind"] == "contact_landed"]) > 5
    path = plant(model, scenario)
    named = [v.name for v in fmpy.read_model_description(str(path)).modelVariables]
    poses, forces = (
        [n for n in named if n.startswith(f"{of}.")] for of in ("pose", "contact_force")
    )
    # In model exchange bounces end a little earlier, from where friction turns the feet elsewhere.
    for how, bound in zip(HOW, (1e-9, 1e-4 if name == "rough feet" else 1e-6), strict=True):
        found = run(path, how, seconds, [*poses, *forces])
        got = np.stack([found[n] for n in poses], 1)
        assert np.abs(got - own["pose"].values).max() < bound
        off = np.abs(np.stack([found[n] for n in forces], 1) - own["contact_force"].values)
        assert (off.max() if how == "CoSimulation" else np.median(off)) < 100 * bound


@pytest.mark.parametrize("kind", ["rigid", pytest.param("compliant", marks=pytest.mark.ci)])
def test_a_machine_under_efforts(plant: Any, kind: str, tmp_path: Path) -> None:
    """A probe lands in a pipe: efforts of a controller, each held for a millisecond."""
    rubber = {"kind": "foundation", "modulus": 2e6, "poisson": 0.45, "thickness": 1e-3}
    rubber |= {"radius": 0.01, "damping": 5.0}
    changes = {"contact.probe.compliance": rubber, "contact.probe.restitution": 0.5}
    model = condyle.load_mechanism("sphere-in-cylinder").set(changes)
    law = {"kind": "computed_torque", "stiffness": 2500.0, "rate": 1000.0}
    scenario = {"duration": 0.06, "rate": 1000, "rtol": 1e-10, "start": {"Z": 0.002}}
    scenario |= {"controller": law, "contacts": {"kind": kind}}
    own = condyle.simulate(model, scenario)
    path = plant(model, scenario)
    unit = Unit(path, 3, tmp_path / "unit")
    quiet("gcc", tmp_path / "unit")
    unit.write("tolerance", 1e-11)
    chains, worst = model.chain_names, 0.0
    for k, effort in enumerate(own["effort"].values[:-1]):
        got = [unit.read(f"pose.{c}") for c in ("X", "Y", "Z", "alpha", "beta", "gamma")]
        worst = max(worst, np.abs(got - own["pose"].values[k]).max())
        for chain, value in zip(chains, effort, strict=True):
            unit.write(f"effort.{chain}", value)
        unit.step(1e-3 * k, 1e-3)
    assert "contact_landed" in [e["kind"] for e in own.condyle.events]
    assert worst < 1e-8
    kept = unit.keep()
    before = [unit.step(0.06, 1e-3), unit.read("contact_force.probe")]
    unit.back(unit.unpack(unit.pack(kept)))
    assert [unit.step(0.06, 1e-3), unit.read("contact_force.probe")] == before
    unit.unit.freeInstance()


def test_impacts_of_hertz_and_of_hunt_and_crossley(plant: Any) -> None:
    """Time of contact of an elastic impact; speed after one with damping. Without weight."""
    d, v = 0.4, 0.7
    c = 4 / 3 * STEEL["modulus"] / (1 - STEEL["poisson"] ** 2) * np.sqrt(R)
    depth = (5 * M * v * v / (4 * c)) ** 0.4
    time = 4 * np.sqrt(np.pi) * gamma(0.4) / (5 * gamma(0.9)) * depth / v
    leaves = brentq(
        lambda u: np.log((1 + d * v) / (1 - d * u)) - d * (v + u),
        v / (1 + 2 * d * v),
        v,
        xtol=1e-15,
    )
    for damping, speed in ((0.0, v), (d, leaves)):
        ball = body([on_plane((0, 0, 0), R, compliance=STEEL | {"damping": damping})], M)
        floating = ball.mechanism.replace(gravity=(0.0, 0.0, 0.0))
        path = plant(floating, COMPLIANT | {"start": {"Z": v * 1e-3, "dZ": -v}})
        for how, bound in zip(HOW, (1e-7, 1e-5), strict=True):
            found = run(path, how, 0.01, ["q.Z", "q1.Z"])
            last = found[-1]
            assert abs(last["q1.Z"] / speed - 1) < bound
            if not damping:
                lasted = last["time"] - 1e-3 - last["q.Z"] / last["q1.Z"]
                assert abs(lasted / time - 1) < bound


def test_laws_are_those_of_the_simulation(plant: Any) -> None:
    """Ellipse, line, layers and their large strains, and a turned ball in a socket: indented."""
    layer = {"kind": "foundation", "modulus": 5e6, "poisson": 0.45, "thickness": 4e-3}
    wall, oval = 0.08, STEEL | {"radius": [0.02, 0.05]}
    ball = {"name": "socket", "point": [0, 0, R - wall], "ball_radius": R, "one_sided": True}
    ball |= {"surface": {"kind": "sphere", "centre": [0, 0, 0], "radius": wall}, "side": "inside"}
    laws = {
        "ellipse": oval,
        "line": layer | {"length": 0.01},
        "thick": layer | {"large_strain": True},
        "roller": STEEL | {"length": 0.01},
    }
    places = [(0.1, 0.0, 0), (-0.1, 0.05, 0), (-0.05, -0.1, 0), (0.1, 0, 0)]
    planes = [
        on_plane(place, R, name=name, compliance=laws[name])
        for name, place in zip(laws, places, strict=True)
    ]
    start = {"Z": -1e-4, "alpha": 1e-4, "gamma": 0.4}
    for contacts in (planes[:3], [planes[3], ball | {"compliance": oval}]):
        model, scenario = body(contacts), COMPLIANT | {"start": start}
        (plan,) = planned(model, [scenario])
        names = [f"{of}.{one['name']}" for of in ("contact_force", "gap") for one in contacts]
        names += [f"pose.{c}" for c in ("X", "Y", "Z", "alpha", "beta", "gamma")]
        found = run(plant(model, scenario), "CoSimulation", 1e-3, names)[0]
        force, gap, pose = np.split(
            [found[name] for name in names], [len(contacts), 2 * len(contacts)]
        )
        assert plan.freed is not None and plan.freed.lifting is not None
        right = ContactLaws(plan.freed.lifting).forces(gap[None], 0 * gap[None], pose[None])
        assert right.force.min() > 1.0
        assert np.abs(force * plan.freed.lifting.push / right.force[0] - 1).max() < 1e-12


def test_what_is_refused(tmp_path: Path) -> None:
    export = partial(condyle.export_fmu, "sphere-in-cylinder", tmp_path / "it.fmu")
    with pytest.raises(InputError, match="controller and plant, got kind inverse; add one"):
        export(kind="inverse", scenario=RIGID)
    drives = {"motor_constant": 0.1, "current_limit": 5.0}
    with pytest.raises(UnsupportedError, match="no contacts that lift together with"):
        export(kind="plant", scenario=RIGID | {"drives": drives})
    assert not [*tmp_path.iterdir()]
