"""Numbers that do not go together are mentioned; those of real machines are not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.mechanism import Mechanism, bundled_text, dumps, parse
from condyle.mechanism.files import from_data
from condyle.mechanism.library import starter_text
from condyle.mechanism.mechanism_checks import extent, length_text, mechanism_warnings

TEXT = bundled_text("masticatory")
LEFT = condyle.load_mechanism("masticatory").chains[2]
FAR = tuple(np.add(LEFT.crank_tip, 550 * np.subtract(LEFT.base, LEFT.crank_tip)).tolist())


def moments(value: float) -> dict[str, float]:
    return dict.fromkeys(("xx", "yy", "zz"), value)


def kinds(machine: Mechanism) -> set[str]:
    return {warning.kind for warning in mechanism_warnings(machine)}


def test_real_machines_are_plausible() -> None:
    """None of the bundled ones is warned of, nor what a person starts with."""
    for name in condyle.bundled_mechanisms():
        assert not mechanism_warnings(condyle.load_mechanism(name)), name
    assert not mechanism_warnings(parse(starter_text("start")))


def test_a_contact_that_gravity_lifts_at_home_is_said() -> None:
    """Efforts of least norm push one condyle of the robot on its surface, or pull it."""
    sides = {f"{CONTACT}.side": "above", f"{CONTACT}.one_sided": True}
    for side in ("above", "below"):
        machine = condyle.load_mechanism("masticatory").set(sides | {f"{CONTACT}.side": side})
        home = np.zeros((1, 4))
        force = condyle.derive(machine).inverse_dynamics(home, home, home).contact_force[0, 0]
        found = condyle.check(machine)
        held, pulls = (
            found.data["contacts"]["left_condyle"]["held"],
            (side == "above") == (force < 0),
        )
        assert held["lost"] == pulls and abs(held["force"] - force) < 1e-12
        assert (f"would pull {abs(force):.3g} N, so it lifts" in str(found)) == pulls


CHAIN, CONTACT = "chain.masseter_left", "contact.left_condyle"
CASES: list[tuple[dict[str, Any], str, str]] = [
    (
        {"platform.mass": 200.0, "platform.inertia": moments(120.0)},
        "gyration_large mass_large",
        "774.6 mm, is beyond the size of the mechanism, 144 mm",
    ),
    ({"platform.mass": 200.0}, "mass_large", "denser than any metal"),
    ({"platform.mass": 2e-4}, "gyration_large", "954.5 mm"),
    (
        {"platform.inertia": moments(2e-9)},
        "gyration_small",
        "its radius of gyration is 0.1 mm, and its joints are up to",
    ),
    ({"gravity[2]": 9.81}, "gravity_upwards", "points up"),
    ({"gravity[2]": -9810.0}, "gravity_size", "9810 m/s^2"),
    ({"gravity[2]": -1.62}, "gravity_size", "neither the Earth's"),
    ({"gravity": (0, -9.80, 0)}, "", ""),
    ({"gravity": (0, 0, 0)}, "", ""),
    ({f"{CHAIN}.base": FAR}, "length_large", 'the crank of chain "masseter_left" 11'),
    (
        {f"{CHAIN}.coupler.transverse": 1.0},
        "rod_gyration",
        'the coupler of chain "masseter_left" 17.41 m',
    ),
    ({f"{CHAIN}.actuator.speed_limit": 2e4}, "speed_limit", 'chain "masseter_left" 400 m/s'),
    (
        {f"{CONTACT}.bounds.x": (-0.02, 0.01)},
        "home_outside_bounds",
        'contact "left_condyle": home is outside its bounds: x is -26.65 mm, and the surface goes '
        "from -20 to 10 mm",
    ),
    ({f"{CONTACT}.bounds.x": (-0.02665 + 1e-17, 0.01)}, "", ""),
    ({f"{CONTACT}.friction.coefficient": 2.5}, "friction_large", ""),
    ({f"{CHAIN}.actuator.coulomb": 3.0}, "coulomb_large", ""),
    (
        {f"{CHAIN}.actuator.coulomb": 0.1, f"{CHAIN}.actuator.smoothing_speed": 6.0},
        "smoothing_large",
        "",
    ),
    ({f"{CONTACT}.friction.coefficient": 2.0, f"{CHAIN}.actuator.coulomb": 2.9}, "", ""),
]


@pytest.mark.filterwarnings("ignore::condyle.errors.CondyleWarning")
def test_what_a_person_would_see(reference: Mechanism) -> None:
    for changes, expected, message in CASES:
        found = mechanism_warnings(reference.set(changes))
        assert {warning.kind for warning in found} == {*expected.split()}, changes
        assert any(message in str(warning) for warning in found) or not expected


def test_units_that_were_mixed_up(reference: Mechanism) -> None:
    (first, *_) = mechanism_warnings(parse(TEXT.replace('length_unit = "mm"', 'length_unit = "m"')))
    assert first.kind == "length_large" and "characteristic length 59.51 m" in str(first)
    assert 'millimetres in a file of length_unit "m"' in str(first)
    assert first.data["lengths"]["the characteristic length"] == pytest.approx(59.51, rel=1e-3)
    small = parse(dumps(reference).replace('length_unit = "m"', 'length_unit = "mm"'))
    assert {"length_small", "gyration_large"} <= kinds(small)
    assert "metres in a file of length_unit" in str(mechanism_warnings(small)[0])


def test_a_ball_touches_where_its_wall_is(raw: dict[str, Any]) -> None:
    """The bound is one of the wall: the ball's centre may be beyond it."""
    x, y, z = raw["contact"][0]["point"]
    radius = 5.0
    touch = [x, y, z] + radius * np.array([1.1, 0.0, 1.0]) / np.hypot(1.1, 1.0)  # the skull's side
    edge = float(touch[0])
    raw["contact"][0] |= {
        "surface": {"kind": "plane", "slope": [-1.1, 0], "offset": float(touch[2] + 1.1 * edge)},
        "side": "below",
        "ball_radius": radius,
        "bounds": {"x": [edge - 1, edge + 1]},
    }
    machine = from_data(raw)
    np.testing.assert_allclose(machine.contacts[0].touching_point, touch / 1e3, atol=1e-15)
    assert not mechanism_warnings(machine)
    raw["contact"][0]["bounds"] = {"x": [x - 1, x + 1]}
    assert kinds(from_data(raw)) == {"home_outside_bounds"}


def test_sizes(reference: Mechanism) -> None:
    points = [p for c in reference.chains for p in (c.platform, c.base, c.crank_tip)]
    points += [*(c.point for c in reference.contacts), *reference.platform.points.values()]
    np.testing.assert_allclose(extent(reference), np.ptp(points, axis=0), rtol=1e-14)
    crank = np.linalg.norm(np.subtract(LEFT.base, LEFT.crank_tip))
    assert LEFT.lengths["crank"] == pytest.approx(crank)
    assert (length_text(0.0512), length_text(12.3456)) == ("51.2 mm", "12.35 m")
