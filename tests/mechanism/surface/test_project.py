"""The nearest home on the surfaces."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text

from condyle.errors import InputError
from condyle.kinematics.constraints import contacts_of, residuals
from condyle.kinematics.project import project_home
from condyle.mechanism.files import from_data
from condyle.mechanism.home import characteristic_length


def shaken(seed: int, **options: Any) -> dict[str, Any]:
    """A random mechanism whose contact points are up to a millimetre off."""
    rng = np.random.default_rng(seed)
    raw = random_mechanism(rng, **options)
    for contact in raw["contact"]:
        contact["point"] = [x + float(rng.uniform(-0.5, 0.5)) for x in contact["point"]]
    return raw


@pytest.mark.parametrize(
    "options",
    [
        {"surface": "mixed", "contacts": 3},
        {"surface": ("ellipsoid", "quadratic"), "contacts": 2, "ball_radius": 4.0},
        {"surface": "plane", "contacts": 1},
    ],
    ids=lambda options: f"{options['surface']}",
)
def test_nearest(options: dict[str, Any]) -> None:
    """On the surfaces, and no pose on them is nearer: the displacement is normal to them."""
    mechanism = from_data(shaken(4, **options), at_home=False)
    projection = project_home(mechanism)
    assert projection.needed
    x = ca.SX.sym("x", 6)
    phi = residuals(contacts_of(mechanism), x)
    values = ca.Function("phi", [x], [phi, ca.jacobian(phi, x)])(projection.displacement)
    value, C = map(np.asarray, values)
    assert np.abs(value).max() < 1e-12
    weight = np.repeat([1.0, characteristic_length(mechanism)], 3)
    along, rows = projection.displacement * weight, (C / weight).reshape(-1, 6)
    left = along - rows.T @ np.linalg.lstsq(rows.T, along, rcond=None)[0]
    # Tangent at the point reached, but for the surfaces' turn over the displacement itself.
    assert np.linalg.norm(left) < 0.05 * np.linalg.norm(along)
    for contact, point in zip(mechanism.contacts, projection.points, strict=True):
        moved = contact.model_copy(update={"point": tuple(map(float, point))})
        assert abs(float(moved.offset_surface.phi(point))) < 1e-12
        assert np.linalg.norm(point - contact.point) < 1.5e-3


def test_check_gives_points_for_the_file(
    condyle_command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for the room around home, whose search ends by the clock."""
    room = SimpleNamespace(radius=0.0, at_most=0.0, stops="", points=0, spacing=0.0)
    monkeypatch.setattr("condyle.report.mechanism_summary.ball_around_home", lambda _: room)
    raw = shaken(5, surface="quadratic")
    path = tmp_path / "off.toml"
    path.write_text(toml_text(raw))
    refused = condyle_command("check", path)
    assert refused.status == 2 and "condyle check --project" in refused.err
    outcome = condyle_command("check", path, "--project")
    assert outcome.status == 0 and "nearest home on the surfaces" in outcome.out
    data = json.loads(condyle_command("check", path, "--project", "--json").out)
    assert set(data["displacement"]) == {"X", "Y", "Z", "alpha", "beta", "gamma"}
    assert {"left_condyle", "right_condyle"} == set(data["contacts"])
    points = re.findall(r"point = (\[.*\])", outcome.out)
    for contact, point in zip(raw["contact"], points, strict=True):
        contact["point"] = json.loads(point)
    path.write_text(toml_text(raw))
    mended = condyle_command("check", path)
    assert mended.status == 0 and "warning" not in mended.err
    assert condyle_command("check", path, "--project").out == mended.out  # nothing to project
    raw["platform"]["mass"] = -1.0
    path.write_text(toml_text(raw))
    outcome = condyle_command("check", path, "--project")
    assert outcome.status == 2 and "platform.mass" in outcome.err


def test_surfaces_that_cannot_be_met() -> None:
    raw = shaken(8)
    for contact, offset in zip(raw["contact"], (1e4, -1e4), strict=True):
        contact["surface"] = {"kind": "plane", "slope": [-1.1, 0], "offset": offset}
    with pytest.raises(InputError, match="no pose near home"):
        project_home(from_data(raw, at_home=False))
