"""Cases whose motion textbooks know: a platform on lines without mass, which pull or do not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from condyle.mechanism import Mechanism
from condyle.mechanism.files import from_data
from condyle.model.model import Model

G = 9.81
INERTIA = (2e-4, 3e-4, 4e-4)
MASS = 0.3


def machine(surface: dict[str, Any] | None = None, **contact: Any) -> Mechanism:
    """A platform on six cables, with one contact at its mass centre, or none."""
    ends = [(40, 0, 5), (-40, 0, 5), (0, 40, 5), (0, -40, 5), (30, 30, -5), (-30, 30, -5)]
    chains = [
        {
            "name": f"line_{i}",
            "kind": "cable",
            "base": [3.0 * x, 3.0 * y + 10, 120.0 * (-1) ** i],
            "platform": [float(x), float(y), float(z)],
        }
        for i, (x, y, z) in enumerate(ends)
    ]
    xx, yy, zz = INERTIA
    data: dict[str, Any] = {
        "name": "textbook",
        "length_unit": "mm",
        "platform": {"mass": MASS, "inertia": {"xx": xx, "yy": yy, "zz": zz}},
        "chain": chains,
    }
    if surface is not None:
        data["contact"] = [{"name": "bead", "point": [0.0, 0.0, 0.0], "surface": surface} | contact]
    return from_data(data)


def moved(mechanism: Mechanism, q: Any, q1: Any, effort: Any = 0.0) -> Any:
    """Forward dynamics of one sample under its weight."""
    model = Model(mechanism, backend="numpy")
    tension = np.full((1, len(mechanism.chains)), effort)
    found = model.forward_dynamics(np.array([q]), np.array([q1]), tension, outputs="all")
    assert not found.status.any()
    return found


def test_free_fall_is_that_of_a_rigid_body() -> None:
    """At home, where the rates of the angles are omega: X'' = g, and Euler's equations."""
    omega = np.array([0.7, -1.1, 0.4])
    found = moved(machine(), np.zeros(6), [0.1, -0.2, 0.3, *omega])
    xx, yy, zz = INERTIA
    euler = [(yy - zz) / xx, (zz - xx) / yy, (xx - yy) / zz]
    spin = np.array(euler) * np.roll(omega, -1) * np.roll(omega, -2)
    a, b, c = omega  # omega = alpha' x + beta' y + gamma' z about axes that move
    turning = np.array([b * c, -a * c, a * b])
    np.testing.assert_allclose(found.acceleration[0, :3], [0, 0, -G], atol=1e-14)
    np.testing.assert_allclose(found.acceleration[0, 3:], spin - turning, atol=1e-13)


def test_block_slides_down_a_slope() -> None:
    """x'' = -g s / (1 + s^2), pushed by m g cos; with friction less, against the motion."""
    slope = 0.75
    plane = {"kind": "plane", "slope": [slope, 0.0], "offset": 0.0}
    cosine, along = 1 / np.hypot(1, slope), -slope / np.hypot(1, slope)
    found = moved(machine(plane), np.zeros(5), np.zeros(5))
    assert found.acceleration[0, 0] == pytest.approx(G * along * cosine, rel=1e-13)
    assert found.contact_force[0, 0] == pytest.approx(MASS * G * cosine, rel=1e-13)
    # Down the slope at 0.4 m/s with Coulomb's friction, which at that speed is whole but for 3e-6.
    mu, speed, smooth = 0.3, 0.4, 1e-3
    rough = machine(plane, friction={"coefficient": mu, "smoothing_speed": smooth})
    found = moved(rough, np.zeros(5), [-speed * cosine, 0, 0, 0, 0])
    held = mu * cosine * speed / np.hypot(speed, smooth)
    assert found.acceleration[0, 0] == pytest.approx(-G * (-along - held) * cosine, rel=1e-12)
    assert found.contact_force[0, 0] == pytest.approx(MASS * G * cosine, rel=1e-13)


def test_bead_on_a_parabola() -> None:
    """z = c x^2: (1 + 4 c^2 x^2) x'' = -2 c x (g + 2 c x'^2), N = m (g + 2 c x'^2) / sqrt(..)."""
    c, x, v = 12.0, 0.013, 0.6  # 1/m, m, m/s
    parabola = {"kind": "quadratic", "offset": 0.0, "slope": [0.0, 0.0]}
    parabola |= {"xx": c * 1e-3, "xy": 0.0, "yy": 0.0}
    found = moved(machine(parabola), [x, 0, 0, 0, 0], [v, 0, 0, 0, 0])
    steep, pulled = 1 + (2 * c * x) ** 2, G + 2 * c * v**2
    assert found.acceleration[0, 0] == pytest.approx(-2 * c * x * pulled / steep, rel=1e-12)
    assert found.contact_force[0, 0] == pytest.approx(MASS * pulled / np.sqrt(steep), rel=1e-12)


def test_pendulum() -> None:
    """A mass centre on a sphere: R theta'' = -g sin(theta), pulled by m (g cos + R theta'^2)."""
    R, theta, rate = 0.08, 0.5, 3.0
    ball = {"kind": "sphere", "centre": [0.0, 0.0, 80.0], "radius": 80.0}
    sine, cosine = np.sin(theta), np.cos(theta)
    found = moved(machine(ball), [R * sine, 0, 0, 0, 0], [R * cosine * rate, 0, 0, 0, 0])
    second = -G / R * sine
    x2 = R * (second * cosine - rate**2 * sine)
    assert found.acceleration[0, 0] == pytest.approx(x2, rel=1e-12)
    assert abs(found.contact_force[0, 0]) == pytest.approx(
        MASS * (G * cosine + R * rate**2), rel=1e-12
    )


def test_lines_pull() -> None:
    """Tension along each line, towards its base."""
    mechanism = machine()
    found = moved(mechanism, np.zeros(6), np.zeros(6), effort=2.0)
    lines = [np.subtract(chain.base, chain.platform) for chain in mechanism.chains]
    pull = sum(2.0 * line / np.linalg.norm(line) for line in lines)
    np.testing.assert_allclose(found.acceleration[0, :3], pull / MASS + [0, 0, -G], rtol=1e-13)
