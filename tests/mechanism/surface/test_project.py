"""The nearest home on the surfaces."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from oracles.random_mechanism import random_mechanism, toml_text
from support.speeds import few
from support.surfaces import CLOSED, KINDS, ball_options

import condyle
from condyle.errors import InputError
from condyle.kinematics.constraints import contacts_of, residuals
from condyle.kinematics.project import project_home
from condyle.mechanism.files import from_data
from condyle.mechanism.home import characteristic_length


def phi_of(mechanism: condyle.Mechanism) -> ca.Function:
    x = ca.SX.sym("x", 6)
    phi = residuals(contacts_of(mechanism), x)
    return ca.Function("phi", [x], [phi, ca.jacobian(phi, x)])


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
        {"surface": "plane"},
        {"surface": "mixed", "contacts": 3},
        {"surface": ("ellipsoid", "quadratic"), "contacts": 2, "ball_radius": 4.0},
        {"surface": "sphere", "contacts": 1},
    ],
)
def test_nearest(options: dict[str, Any]) -> None:
    """On the surfaces, and no pose on them is nearer: the displacement is normal to them."""
    mechanism = from_data(shaken(4, **options), at_home=False)
    projection = project_home(mechanism)
    assert projection.needed
    value, C = (np.asarray(v) for v in phi_of(mechanism)(projection.displacement))
    assert np.abs(value).max() < 1e-12
    length = characteristic_length(mechanism)
    weight = np.array([1, 1, 1, length, length, length])
    along = projection.displacement * weight
    rows = (C / weight).reshape(-1, 6)
    left = along - rows.T @ np.linalg.lstsq(rows.T, along, rcond=None)[0]
    # Tangent at the point reached, but for the surfaces' turn over the displacement itself.
    assert np.linalg.norm(left) < 0.05 * np.linalg.norm(along)
    for contact, point in zip(mechanism.contacts, projection.points, strict=True):
        moved = contact.model_copy(update={"point": tuple(map(float, point))})
        assert abs(float(moved.offset_surface.phi(point))) < 1e-12
        assert np.linalg.norm(point - contact.point) < 1.5e-3


@pytest.mark.parametrize("ball", [0.0, 4.0])
@pytest.mark.parametrize("kind", few(KINDS, "quadratic"))
def test_check_gives_points_for_the_file(
    condyle_command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, kind: str, ball: float
) -> None:
    monkeypatch.setenv("CONDYLE_BACKEND", "numpy")
    raw = shaken(5, surface=kind)
    if ball:
        for contact in raw["contact"]:
            contact |= ball_options(kind, first=kind not in CLOSED) | {"ball_radius": ball}
    path = tmp_path / "off.toml"
    path.write_text(toml_text(raw))
    refused = condyle_command("check", path)
    assert refused.status == 2 and "condyle check --project" in refused.err
    outcome = condyle_command("check", path, "--project")
    assert outcome.status == 0 and "nearest home on the surfaces" in outcome.out
    points = re.findall(r"point = (\[.*\])", outcome.out)
    assert len(points) == 2
    for contact, point in zip(raw["contact"], points, strict=True):
        contact["point"] = json.loads(point)
    path.write_text(toml_text(raw))
    mended = condyle_command("check", path)
    assert mended.status == 0 and "warning" not in mended.err


def test_json(condyle_command, tmp_path: Path) -> None:
    path = tmp_path / "off.toml"
    path.write_text(toml_text(shaken(6)))
    outcome = condyle_command("check", path, "--project", "--json")
    data = json.loads(outcome.out)
    assert set(data["displacement"]) == {"X", "Y", "Z", "alpha", "beta", "gamma"}
    assert {"left_condyle", "right_condyle"} == set(data["contacts"])


def test_nothing_to_project(condyle_command) -> None:
    usual = condyle_command("check", "masticatory")
    assert condyle_command("check", "masticatory", "--project").out == usual.out


def test_other_problems_are_still_said(condyle_command, tmp_path: Path) -> None:
    raw = shaken(7)
    raw["platform"]["mass"] = -1.0
    (tmp_path / "bad.toml").write_text(toml_text(raw))
    outcome = condyle_command("check", "bad.toml", "--project")
    assert outcome.status == 2 and "platform.mass" in outcome.err


def test_surfaces_that_cannot_be_met() -> None:
    raw = shaken(8)
    raw["contact"][0]["surface"] = {"kind": "plane", "slope": [-1.1, 0], "offset": 1e4}
    raw["contact"][1]["surface"] = {"kind": "plane", "slope": [-1.1, 0], "offset": -1e4}
    with pytest.raises(InputError, match="no pose near home"):
        project_home(from_data(raw, at_home=False))
