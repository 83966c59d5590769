"""Surfaces and their options in mechanism files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import toml_text
from support.surfaces import BALL, CLOSED, KINDS, ball_options, table

import condyle
from condyle.errors import MechanismError
from condyle.mechanism import Mechanism, dumps, json_schema, parse
from condyle.mechanism.home import home_residuals
from condyle.report.mechanism_summary import check

HOME = np.array([-26.65, 72, 42.53])


def spoiled(raw: dict[str, Any], surface: dict[str, Any], **options: Any) -> str:
    """The bundled file with another surface and more keys for its first contact."""
    raw["contact"][0] |= {"surface": surface, **options}
    return toml_text(raw)


def problems(text: str) -> list[str]:
    with pytest.raises(MechanismError) as caught:
        parse(text)
    return caught.value.problems


def moved_home(kind: str) -> dict[str, Any]:
    """A surface through the left condyle at home."""
    from oracles.random_mechanism import random_surface

    return random_surface(np.random.default_rng(2), kind, HOME, np.array([-1.1, 0.0]))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_goes_round(raw: dict[str, Any], kind: str) -> None:
    """File in mm, mechanism in SI, file in m, the same mechanism to the last bit."""
    side = "inside" if kind in CLOSED else "below"
    mechanism = parse(spoiled(raw, moved_home(kind), side=side, one_sided=True))
    contact = mechanism.contacts[0]
    assert (contact.surface.kind, contact.side, contact.one_sided) == (kind, side, True)
    assert np.abs(home_residuals(mechanism)).max() < 1e-15
    again = parse(dumps(mechanism))
    assert again == mechanism


def test_units_of_second_order_coefficients(raw: dict[str, Any]) -> None:
    contact = parse(spoiled(raw, moved_home("quadratic"))).contacts[0]
    given = raw["contact"][0]["surface"]
    assert contact.surface.xx == pytest.approx(given["xx"] * 1e3, rel=1e-15)  # 1/mm to 1/m
    assert contact.surface.slope == tuple(given["slope"])


def test_options_may_stand_with_the_surface(raw: dict[str, Any]) -> None:
    surface = moved_home("plane") | {"side": "below", "one_sided": True}
    inside = parse(spoiled(raw, surface)).contacts[0]
    assert inside.side == "below" and inside.one_sided
    assert any(
        "is given twice: in [[contact]]" in p for p in problems(spoiled(raw, surface, side="below"))
    )


SPHERE = {"kind": "sphere", "centre": [0, 0, 0], "radius": 30}
LINE = {"kind": "profile", "direction": [1.0, 0.0], "points": [[0, 0], [1, 1], [2, 3]]}


@pytest.mark.parametrize(
    ("surface", "options", "message"),
    [
        (SPHERE | {"radius": -1}, {}, "surface.radius: expected a value above"),
        (SPHERE | {"colour": 1}, {}, "surface.colour: is not a key"),
        ({"kind": "torus"}, {}, "'torus' is unknown. Available: cylinder, ellipsoid, plane"),
        ({"kind": "expression", "function": "p[2]"}, {}, "'expression' is unknown"),
        ({"slope": [0, 0], "offset": 1}, {}, "`kind` is missing"),
        (SPHERE, {"side": "below"}, 'expected "inside" or "outside" for a sphere, got "below"'),
        (
            {"kind": "ellipsoid", "centre": [0, 0, 0], "semi_axes": [1, 2, 3]},
            {"side": "below"},
            'expected "inside" or "outside" for an ellipsoid',
        ),
        (LINE, {"side": "inside"}, 'expected "below" or "above" for a profile, got "inside"'),
        (SPHERE, {"side": "left"}, "side: expected"),
        (SPHERE, {"ball_radius": 3}, "side is missing"),
        (SPHERE, {"one_sided": True}, "side is missing"),
        (SPHERE, {"one_sided": "yes", "side": "inside"}, "one_sided: expected true or false"),
        (SPHERE, {"ball_radius": -3, "side": "inside"}, "ball_radius: expected a value above"),
        (SPHERE, {"ball_radius": 30, "side": "inside"}, "no room inside a sphere of radius 30 mm"),
        (LINE | {"direction": [1.0, 0.1]}, {}, "direction: expected a unit vector"),
        (LINE | {"direction": [0.0, 0.6, 0.8]}, {}, "X-Y plane has no z"),
        (LINE | {"points": [[0, 0], [1, 1]]}, {}, "points: expected at least 3"),
        (LINE | {"points": [[0, 0], [1, 1], [1, 2]]}, {}, "s must rise"),
        ({"kind": "cylinder", "point": [0, 0, 0], "axis": [0, 0, 0], "radius": 1}, {}, "zero"),
        (SPHERE, {}, "mm off the surface at home"),
    ],
)
def test_what_is_wrong(
    raw: dict[str, Any], surface: dict[str, Any], options: dict[str, Any], message: str
) -> None:
    found = problems(spoiled(raw, surface, **options))
    assert any(p.startswith('contact "left_condyle"') and message in p for p in found), found


def test_a_ball_that_cannot_touch(raw: dict[str, Any]) -> None:
    tight = {"kind": "quadratic", "offset": 38.53 + 0.2 * 26.65**2, "slope": [0.4 * 26.65, 0]}
    text = spoiled(raw, tight | {"xx": 0.2}, side="above", ball_radius=BALL)
    assert any('radius 4 mm on the side "above" cannot touch' in p for p in problems(text))


def test_direction_of_three_numbers(raw: dict[str, Any]) -> None:
    surface = moved_home("profile")
    flat = parse(spoiled(raw, surface))
    solid = parse(spoiled(raw, surface | {"direction": [*surface["direction"], 0.0]}))
    assert flat == solid


def test_schema_knows_the_kinds() -> None:
    schema = json_schema()
    contact = schema["$defs"]["Contact"]["properties"]
    assert set(contact["surface"]["discriminator"]["mapping"]) == set(KINDS)
    assert {"side", "ball_radius", "one_sided"} <= set(contact)


def test_check_says_what_a_contact_is(raw: dict[str, Any]) -> None:
    wall = table("sphere") | {"centre": [-26.65, 72, 12.53], "radius": 26.0}
    options = ball_options("sphere", first=False)
    description = check(parse(spoiled(raw, wall, **options, one_sided=True)))
    assert "sphere, outside, ball of radius 4 mm, unilateral," in str(description)
    found = description.data["contacts"]["left_condyle"]
    assert (found["kind"], found["side"], found["ball_radius"]) == ("sphere", "outside", 0.004)


def test_the_bundled_curved_mechanism(reference: Mechanism) -> None:
    """Tangent to the paper's planes at home, and it runs the reference motion."""
    curved = condyle.load_mechanism("masticatory-curved")
    assert [c.surface.kind for c in curved.contacts] == ["quadratic", "quadratic"]
    for ours, plane in zip(curved.contacts, reference.contacts, strict=True):
        s, (x, y, _) = ours.surface, ours.point
        slope = (s.slope[0] + 2 * s.xx * x, s.slope[1] + 2 * s.yy * y)
        assert slope == pytest.approx(plane.surface.slope, abs=1e-14)
        # Radii of curvature: along the steepest line, and across it.
        assert (1 + 1.1**2) ** 1.5 / (2 * s.xx) == pytest.approx(45.6e-3, abs=1e-4)
        assert np.hypot(1, 1.1) / (2 * s.yy) == pytest.approx(-59.5e-3, abs=1e-4)
    assert np.abs(home_residuals(curved)).max() < 1e-15
    assert curved.chains == reference.chains and curved.platform == reference.platform
    model = condyle.derive(curved, backend="numpy")
    solution = model.solve(condyle.reference_motion(), condyle.reference_load())
    assert (solution["status"] == 0).all() and (solution["bound_margin"] > 0).all()
    peak = np.abs(solution["effort"]).max()
    assert float(peak) == pytest.approx(0.914, abs=1e-3)
