"""What --check-gains foretells is what happens."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import condyle
from condyle.errors import UnsupportedError
from condyle.results.model import Model
from condyle.simulation.bind import bind
from condyle.simulation.gains import check_gains, error_bound
from condyle.simulation.scenario import scenario_from

KP, PERIOD = 400.0, 1e-3


def report(model: Model, **controller: Any) -> Any:
    table = {"kind": "computed_torque", "stiffness": KP} | controller
    t = np.linspace(0, 1, 11)
    rest = condyle.Motion.from_arrays(t, {n: 0 * t for n in model.independent})
    return check_gains(bind(model, scenario_from({"controller": table}), motion=rest))


def test_a_continuous_loop_has_the_roots_of_its_gains(jaw: Model) -> None:
    """e'' + Kv e' + Kp e = 0 in every coordinate, whatever the mechanism does."""
    home = report(jaw, damping=24.0, ideal=True).points[0]
    expected = np.sort_complex(np.tile(np.roots([1, 24.0, KP]), 4))
    assert np.allclose(np.sort_complex(home.eigenvalues), expected, rtol=1e-4)
    assert np.isclose(home.damping, 24.0 / 2 / np.sqrt(KP), rtol=1e-4)
    # L = (Kv s + Kp) / s^2 passes 1 at w with w^4 = Kp^2 + (Kv w)^2.
    w = np.sqrt((24.0**2 + np.sqrt(24.0**4 + 4 * KP**2)) / 2)
    assert np.isclose(home.phase, np.degrees(np.arctan(24.0 * w / KP)), atol=0.2)


def test_a_sampled_loop_is_late(jaw: Model) -> None:
    """The same for double integrators sampled and held, written here."""
    found = report(jaw, delay=1)
    T, Kv = PERIOD, 2 * np.sqrt(KP)
    F = np.array([[1, T, T**2 / 2], [0, 1, T], [-KP, -Kv, 0]])
    z = np.linalg.eigvals(F)
    assert found.stable and np.isclose(found.points[0].radius, np.abs(z).max(), rtol=1e-5)


@pytest.mark.parametrize(("damping", "stable"), [(0.02, True), (0.4, False)])
def test_unstable_drives_are_foretold(jaw: Model, damping: float, stable: bool) -> None:
    """A damper against a rotor of 6.6e-5 kg m^2 at 1 kHz: what is said is what happens."""
    pd = {"kind": "joint_pd", "stiffness": 5.0, "damping": damping}
    t = np.linspace(0, 1, 11)
    rest = condyle.Motion.from_arrays(t, {n: 0 * t for n in jaw.independent})
    tables = {"duration": 0.03, "controller": pd, "start": {"beta": 1e-5}}
    said = check_gains(bind(jaw, scenario_from(tables), motion=rest))
    assert said.stable == stable and bool(said.warnings) != stable
    error = np.abs(condyle.simulate(jaw, tables, motion=rest)["tracking_error"].values)
    assert (error[-1].max() < 2e-5) == stable


def test_no_loop_no_gains(jaw: Model) -> None:
    with pytest.raises(UnsupportedError, match="no controller"):
        check_gains(bind(jaw, scenario_from({})))


@pytest.mark.parametrize("damping", [10.0, 30.0, 40.0, 60.0])
def test_the_bound_of_errors(damping: float) -> None:
    """int |h| of the impulse response, by sampling it."""
    t, h = np.linspace(0, 10, 200001), None
    roots = np.roots([1, damping, 400.0 + 1e-9]).astype(complex)
    h = ((np.exp(roots[0] * t) - np.exp(roots[1] * t)) / (roots[0] - roots[1])).real
    area = np.trapezoid(np.abs(h), t) if hasattr(np, "trapezoid") else np.trapz(np.abs(h), t)
    assert np.isclose(error_bound(400.0, damping, 3.0), 3 * area, rtol=1e-4)
