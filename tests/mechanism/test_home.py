"""The rule for the dependent coordinates, and what the geometry at home decides."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from oracles.closure import dependent_coordinates as expected_dependents
from oracles.random_mechanism import random_mechanism, toml_text

import condyle
from condyle.mechanism import Mechanism, parse
from condyle.mechanism.files import from_data
from condyle.mechanism.home import (
    characteristic_length,
    dependent_coordinates,
    home_residuals,
    independent_coordinates,
)


@pytest.mark.parametrize("contacts", range(6))
def test_dependent_coordinates_follow_the_rule(contacts: int) -> None:
    for seed in range(4):
        raw = random_mechanism(np.random.default_rng(seed), contacts=contacts)
        mechanism = parse(toml_text(raw))
        assert dependent_coordinates(mechanism) == expected_dependents(raw)
        assert len(independent_coordinates(mechanism)) == 6 - contacts


def test_the_reference(reference: Mechanism) -> None:
    assert dependent_coordinates(reference) == ("Z", "gamma")
    assert independent_coordinates(reference) == ("X", "Y", "alpha", "beta")
    points = [c.platform for c in reference.chains] + [c.point for c in reference.contacts]
    length = np.mean([np.linalg.norm(p) for p in points])
    assert characteristic_length(reference) == pytest.approx(length, rel=1e-15)


# Level planes leave gamma free; a slope of 1e-4 gives condition numbers about 1e4.
@pytest.mark.parametrize("slope, angle", [(0.0, "alpha"), (0.5e-4, "alpha"), (3e-4, "gamma")])
def test_a_badly_determined_set_is_passed_over(
    raw: dict[str, Any], slope: float, angle: str
) -> None:
    for contact in raw["contact"]:
        offset = contact["point"][2] - slope * contact["point"][0]
        contact["surface"] = {"kind": "plane", "slope": [slope, 0], "offset": offset}
    assert dependent_coordinates(from_data(raw)) == ("Z", angle) == expected_dependents(raw)


def test_the_file_decides(raw: dict[str, Any]) -> None:
    raw["dependent"] = ["alpha", "X"]
    model = condyle.derive(from_data(raw))
    assert set(model.dependent) == {"X", "alpha"}
    assert model.independent == ("Y", "Z", "beta", "gamma")


def test_home_residuals_are_distances(raw: dict[str, Any]) -> None:
    surface = raw["contact"][0]["surface"]
    surface["offset"] -= 3e-3 * np.hypot(surface["slope"][0], 1)
    np.testing.assert_allclose(home_residuals(from_data(raw)), [3e-6, 0], atol=1e-15)
