"""Numbers that do not go together are mentioned; those of real machines are not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.mechanism import Mechanism, bundled_text, parse
from condyle.mechanism.library import starter_text
from condyle.mechanism.mechanism_checks import extent, length_text, mechanism_warnings

TEXT = bundled_text("masticatory")


def kinds(machine: Mechanism) -> set[str]:
    return {warning.kind for warning in mechanism_warnings(machine)}


@pytest.mark.parametrize("name", condyle.bundled_mechanisms())
def test_real_machines_are_plausible(name: str) -> None:
    assert not mechanism_warnings(condyle.load_mechanism(name))


def test_the_starter_is_plausible() -> None:
    assert not mechanism_warnings(parse(starter_text("start")))


CASES: dict[str, tuple[Callable[[Mechanism], Mechanism], set[str], str]] = {
    "200 kg, 120 kg m^2": (
        lambda m: m.set({"platform.mass": 200.0, "platform.inertia": {k: 120.0 for k in AXES}}),
        {"gyration_large", "mass_large"},
        "774.6 mm, is beyond the size of the mechanism, 144 mm",
    ),
    "200 kg": (lambda m: m.set("platform.mass", 200.0), {"mass_large"}, "denser than any metal"),
    "grams": (lambda m: m.set("platform.mass", 2e-4), {"gyration_large"}, "954.5 mm"),
    "a tenth of a millimetre": (
        lambda m: m.set("platform.inertia", {k: 2e-9 for k in AXES}),
        {"gyration_small"},
        "its radius of gyration is 0.1 mm, and its joints are up to",
    ),
    "upwards": (lambda m: m.set("gravity[2]", 9.81), {"gravity_upwards"}, "points up"),
    "millimetres": (lambda m: m.set("gravity[2]", -9810.0), {"gravity_size"}, "9810 m/s^2"),
    "moon": (lambda m: m.set("gravity[2]", -1.62), {"gravity_size"}, "neither the Earth's"),
    "wall": (lambda m: m.set("gravity", (0, -9.80, 0)), set(), ""),
    "weightless": (lambda m: m.set("gravity", (0, 0, 0)), set(), ""),
    "long": (
        lambda m: m.set("chain.masseter_left.base", LEFT_FAR),
        {"length_large"},
        'the crank of chain "masseter_left" 11',
    ),
    "rod": (
        lambda m: m.set("chain.masseter_left.coupler.transverse", 1.0),
        {"rod_gyration"},
        'the coupler of chain "masseter_left" 1.741e+04 mm'.replace("1.741e+04 mm", "17.41 m"),
    ),
    "sound": (
        lambda m: m.set("chain.masseter_left.actuator.speed_limit", 2e4),
        {"speed_limit"},
        'chain "masseter_left" 400 m/s',
    ),
    "bounds": (
        lambda m: m.set("contact.left_condyle.bounds.x", (-0.02, 0.01)),
        {"home_outside_bounds"},
        'contact "left_condyle": home is outside its bounds: x is -26.65 mm, and the surface goes '
        "from -20 to 10 mm",
    ),
    "at a bound": (
        lambda m: m.set("contact.left_condyle.bounds.x", (-0.02665 + 1e-17, 0.01)),
        set(),
        "",
    ),
}
AXES = ("xx", "yy", "zz")
LEFT_FAR = tuple(
    np.add(
        condyle.load_mechanism("masticatory").get("chain.masseter_left.crank_tip"),
        550
        * np.subtract(
            condyle.load_mechanism("masticatory").get("chain.masseter_left.base"),
            condyle.load_mechanism("masticatory").get("chain.masseter_left.crank_tip"),
        ),
    ).tolist()
)


@pytest.mark.parametrize("case", CASES)
def test_what_a_person_would_see(reference: Mechanism, case: str) -> None:
    change, expected, message = CASES[case]
    found = mechanism_warnings(change(reference))
    assert {warning.kind for warning in found} == expected
    assert any(message in str(warning) for warning in found) or not expected


def test_units_that_were_mixed_up() -> None:
    in_metres = parse(TEXT.replace('length_unit = "mm"', 'length_unit = "m"'))
    (first, *_) = mechanism_warnings(in_metres)
    assert first.kind == "length_large" and "characteristic length 59.51 m" in str(first)
    assert 'millimetres in a file of length_unit "m"' in str(first)
    assert first.data["lengths"]["the characteristic length"] == pytest.approx(59.51, rel=1e-3)
    small = condyle.dumps(condyle.load_mechanism("masticatory"))
    as_millimetres = parse(small.replace('length_unit = "m"', 'length_unit = "mm"'))
    assert {"length_small", "gyration_large"} <= kinds(as_millimetres)
    assert "metres in a file of length_unit" in str(mechanism_warnings(as_millimetres)[0])


def test_a_ball_touches_where_its_wall_is(raw: dict[str, Any]) -> None:
    """The bound is one of the wall: the ball's centre may be beyond it."""
    from condyle.mechanism.files import from_data

    x, y, z = raw["contact"][0]["point"]
    slope, radius = np.array([-1.1, 0.0, -1.0]), 5.0
    n = slope / np.linalg.norm(slope) * -1  # upwards
    touch = np.array([x, y, z]) + radius * n  # the skull is above the ball
    offset = touch[2] + 1.1 * touch[0]
    raw["contact"][0] |= {
        "surface": {"kind": "plane", "slope": [-1.1, 0], "offset": float(offset)},
        "side": "below",
        "ball_radius": radius,
        "bounds": {"x": [float(touch[0]) - 1, float(touch[0]) + 1]},
    }
    machine = from_data(raw)
    np.testing.assert_allclose(machine.contacts[0].touching_point, touch / 1e3, atol=1e-15)
    assert not mechanism_warnings(machine)
    raw["contact"][0]["bounds"] = {"x": [x - 1, x + 1]}
    assert kinds(from_data(raw)) == {"home_outside_bounds"}


def test_sizes(reference: Mechanism) -> None:
    points = [c.platform for c in reference.chains] + [c.base for c in reference.chains]
    points += [c.crank_tip for c in reference.chains] + [c.point for c in reference.contacts]
    points += list(reference.platform.points.values())
    wanted = np.max(points, axis=0) - np.min(points, axis=0)
    np.testing.assert_allclose(extent(reference), wanted, rtol=1e-14)
    chain = reference.chains[0]
    assert chain.lengths["crank"] == pytest.approx(
        np.linalg.norm(np.subtract(chain.base, chain.crank_tip))
    )
    assert (length_text(0.0512), length_text(12.3456)) == ("51.2 mm", "12.35 m")
