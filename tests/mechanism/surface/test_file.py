"""Surfaces and their options in mechanism files."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.random_mechanism import random_surface, toml_text
from support.machines import model
from support.surfaces import CLOSED, KINDS, ball_options, table

import condyle
from condyle.errors import MechanismError
from condyle.mechanism import Mechanism, dumps, json_schema, parse
from condyle.mechanism.home import home_residuals
from condyle.report.mechanism_summary import check

HOME = np.array([-26.65, 72, 42.53])


def text_with(raw: dict[str, Any], surface: dict[str, Any], **options: Any) -> str:
    """The bundled file with another surface and more keys for its first contact."""
    raw["contact"][0] |= {"surface": surface, **options}
    return toml_text(raw)


def moved_home(kind: str) -> dict[str, Any]:
    """A surface through the left condyle at home."""
    return random_surface(np.random.default_rng(2), kind, HOME, np.array([-1.1, 0.0]))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_goes_round(raw: dict[str, Any], kind: str) -> None:
    """File in mm, mechanism in SI, file in m, the same mechanism to the last bit."""
    side, given = "inside" if kind in CLOSED else "below", moved_home(kind)
    mechanism = parse(text_with(raw, given, side=side, one_sided=True))
    contact = mechanism.contacts[0]
    assert (contact.surface.kind, contact.side, contact.one_sided) == (kind, side, True)
    assert np.abs(home_residuals(mechanism)).max() < 1e-15
    assert parse(dumps(mechanism)) == mechanism
    if kind == "quadratic":
        assert contact.surface.xx == pytest.approx(given["xx"] * 1e3, rel=1e-15)  # 1/mm to 1/m
        assert contact.surface.slope == tuple(given["slope"])
    if kind == "profile":
        solid = given | {"direction": [*given["direction"], 0.0]}
        assert parse(text_with(raw, solid)) == mechanism


SPHERE = {"kind": "sphere", "centre": [0, 0, 0], "radius": 30}
LINE = {"kind": "profile", "direction": [1.0, 0.0], "points": [[0, 0], [1, 1], [2, 3]]}
ELLIPSOID = {"kind": "ellipsoid", "centre": [0, 0, 0], "semi_axes": [1, 2, 3]}
CYLINDER = {"kind": "cylinder", "point": [0, 0, 0], "axis": [0, 0, 0], "radius": 1}
TIGHT = {"kind": "quadratic", "offset": 38.53 + 0.2 * 26.65**2, "slope": [10.66, 0], "xx": 0.2}


@pytest.mark.parametrize(
    ("surface", "options", "message"),
    [
        (SPHERE | {"radius": -1}, {}, "surface.radius: expected a value above"),
        (SPHERE | {"colour": 1}, {}, "surface.colour: is not a key"),
        ({"kind": "torus"}, {}, "'torus' is unknown. Available: cylinder, ellipsoid, plane"),
        ({"slope": [0, 0], "offset": 1}, {}, "`kind` is missing"),
        (SPHERE, {"side": "below"}, 'expected "inside" or "outside" for a sphere, got "below"'),
        (ELLIPSOID, {"side": "below"}, 'expected "inside" or "outside" for an ellipsoid'),
        (LINE, {"side": "inside"}, 'expected "below" or "above" for a profile, got "inside"'),
        (SPHERE, {"side": "left"}, "side: expected"),
        (SPHERE, {"ball_radius": 3}, "side is missing"),
        (SPHERE, {"one_sided": True}, "side is missing"),
        (SPHERE, {"one_sided": "yes", "side": "inside"}, "one_sided: expected true or false"),
        (SPHERE, {"ball_radius": -3, "side": "inside"}, "ball_radius: expected a value above"),
        (SPHERE, {"ball_radius": 30, "side": "inside"}, "no room inside a sphere of radius 30 mm"),
        (SPHERE | {"side": "inside"}, {"side": "inside"}, "is given twice: in [[contact]]"),
        (LINE | {"direction": [1.0, 0.1]}, {}, "direction: expected a unit vector"),
        (LINE | {"direction": [0.0, 0.6, 0.8]}, {}, "X-Y plane has no z"),
        (LINE | {"points": [[0, 0], [1, 1]]}, {}, "points: expected at least 3"),
        (LINE | {"points": [[0, 0], [1, 1], [1, 2]]}, {}, "s must rise"),
        (CYLINDER, {}, "zero"),
        (SPHERE, {}, "mm off the surface at home"),
        (TIGHT, {"side": "above", "ball_radius": 4.0}, 'radius 4 mm on the side "above" cannot'),
    ],
)
def test_what_is_wrong(
    raw: dict[str, Any], surface: dict[str, Any], options: dict[str, Any], message: str
) -> None:
    with pytest.raises(MechanismError) as caught:
        parse(text_with(raw, surface, **options))
    found = caught.value.problems
    assert any(p.startswith('contact "left_condyle"') and message in p for p in found), found


def test_schema_knows_the_kinds() -> None:
    contact = json_schema()["$defs"]["Contact"]["properties"]
    assert set(contact["surface"]["discriminator"]["mapping"]) == set(KINDS)
    assert {"side", "ball_radius", "one_sided"} <= set(contact)


def test_check_says_what_a_contact_is(raw: dict[str, Any]) -> None:
    wall = table("sphere") | {"centre": [-26.65, 72, 12.53], "radius": 26.0}
    options = ball_options("sphere", first=False)
    description = check(parse(text_with(raw, wall, **options, one_sided=True)))
    assert "sphere, outside, ball of radius 4 mm, unilateral," in str(description)
    found = description.data["contacts"]["left_condyle"]
    assert (found["kind"], found["side"], found["ball_radius"]) == ("sphere", "outside", 0.004)


@pytest.mark.slow
def test_the_bundled_curved_mechanism(reference: Mechanism) -> None:
    """Tangent to the paper's planes at home, and it runs the reference motion."""
    curved = condyle.load_mechanism("masticatory-curved")
    for ours, plane in zip(curved.contacts, reference.contacts, strict=True):
        s, (x, y, _) = ours.surface, ours.point
        assert s.kind == "quadratic"
        slope = (s.slope[0] + 2 * s.xx * x, s.slope[1] + 2 * s.yy * y)
        assert slope == pytest.approx(plane.surface.slope, abs=1e-14)
        # Radii of curvature: along the steepest line, and across it.
        assert (1 + 1.1**2) ** 1.5 / (2 * s.xx) == pytest.approx(45.6e-3, abs=1e-4)
        assert np.hypot(1, 1.1) / (2 * s.yy) == pytest.approx(-59.5e-3, abs=1e-4)
    assert np.abs(home_residuals(curved)).max() < 1e-15
    assert curved.chains == reference.chains and curved.platform == reference.platform
    solution = model("masticatory-curved").solve(
        condyle.reference_motion(), condyle.reference_load()
    )
    assert (solution["status"] == 0).all() and (solution["bound_margin"] > 0).all()
    assert float(np.abs(solution["effort"]).max()) == pytest.approx(0.914, abs=1e-3)
