"""Laws of contacts: closed forms, and integrals of their pressures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from condyle import load_mechanism
from condyle.errors import MechanismError
from condyle.mechanism.compliance import Compliance
from condyle.mechanism.compliance import FoundationCompliance as Foundation
from condyle.mechanism.compliance import HertzCompliance as Hertz
from condyle.mechanism.compliance import LinearCompliance as Linear

E, NU, H, R, N = 2.7e6, 0.4, 2e-3, 8e-3, np.array([0.5, 25.0, 100.0])
K = (1 - NU) * E / ((1 + NU) * (1 - 2 * NU))
STIFF = E / (1 - NU**2)  # E*
SPHERE = np.full((3, 2), 1 / R)
OVAL = np.array([[20.0, 110.0], [0.01, 125.0], [124.9, 125.0]])
LAYER: dict[str, Any] = {"modulus": E, "poisson": NU, "thickness": H, "radius": R}
BODY: dict[str, Any] = {"modulus": E, "poisson": NU, "radius": R}


def close(found: Any, wanted: Any, error: float = 1e-10) -> None:
    assert np.abs(np.asarray(found) / wanted - 1).max() < error, (found, wanted)


def test_a_sphere_on_a_foundation() -> None:
    d = np.sqrt(N * H / (np.pi * K * R))
    found = Foundation(**LAYER).patch(N, SPHERE)
    close(found.indentation, d)
    close(found.area, 2 * np.pi * R * d)
    close(found.peak_pressure, K * d / H)
    close(found.mean_pressure, N / (2 * np.pi * R * d))
    close(found.reach, np.sqrt(2 * R * d))
    close(found.energy_density, K * (d / H) ** 2 / 2)
    close(found.strain, d / H)


def test_a_condyle_on_its_cartilage() -> None:
    """Of a ball of 8 mm on a layer of 2 mm with K 7.4 MPa, as jaw models have them."""
    law = Foundation(modulus=7.4e6, poisson=0.0, thickness=2e-3, radius=8e-3)
    found = law.patch(np.array([25.0, 100.0, 200.0]), SPHERE)
    assert (found.indentation * 1e3).round(2).tolist() == [0.52, 1.04, 1.47]
    assert (found.area * 1e6).round().tolist() == [26, 52, 74]
    assert (found.peak_pressure * 1e-6).round(1).tolist() == [1.9, 3.8, 5.4]


def test_hertz_sphere_and_cylinder() -> None:
    found, a = Hertz(**BODY).patch(N, SPHERE), np.cbrt(3 * N * R / (4 * STIFF))
    close(found.indentation, a**2 / R)
    close(N, 4 / 3 * STIFF * np.sqrt(R) * found.indentation**1.5)
    close(found.area, np.pi * R * found.indentation)
    close(found.peak_pressure, 1.5 * N / found.area)
    side = (1 + 2 * NU) / 2  # of the stresses along the surface, at the centre
    close(found.energy_density, found.peak_pressure**2 / (2 * E)
          * (1 + 2 * side**2 - 2 * NU * (2 * side + side**2)))  # fmt: skip
    length = 0.02
    line = Hertz(**BODY, length=length).patch(N, np.array([[0.0, 1 / R]] * 3))
    b = np.sqrt(4 * N * R / (np.pi * length * STIFF))
    close(line.area, 2 * b * length)
    close(line.peak_pressure, np.sqrt(STIFF * N / (np.pi * length * R)))
    close(line.indentation, b**2 / R)
    both = Hertz(modulus=(E, 3 * E), poisson=(NU, 0.1), radius=R)
    close(both.effective_modulus, 1 / ((1 - NU**2) / E + (1 - 0.1**2) / (3 * E)))


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.6, 0.0), (0.3, -0.5)])
def test_hertz_pressure_bends_a_half_space_to_the_ellipse(place: tuple[float, float]) -> None:
    """Boussinesq: the displacement under the ellipse's pressure, by integrals over chords."""
    law = Hertz(**BODY)
    found = law.patch(N, OVAL)
    a, b = found.reach, found.area / (np.pi * found.reach)
    x, y = place
    turn = (np.arange(4000) + 0.5) * np.pi / 4000  # directions of the chords
    for k in range(3):
        u, v = np.cos(turn) / a[k], np.sin(turn) / b[k]
        square, along = u**2 + v**2, x * u + y * v
        chord = np.pi / 2 * ((1 - x**2 - y**2) + along**2 / square) / np.sqrt(square)
        moved = found.peak_pressure[k] * chord.mean() / STIFF
        gap = (OVAL[k, 0] * (x * a[k]) ** 2 + OVAL[k, 1] * (y * b[k]) ** 2) / 2
        close(moved, found.indentation[k] - gap, 1e-7 if k == 1 else 1e-10)


LAWS: list[Compliance] = [
    Linear(stiffness=1e5), Hertz(**BODY), Hertz(**BODY, length=0.01), Foundation(**LAYER),
    Foundation(**LAYER, large_strain=True), Foundation(**LAYER, length=0.01),
    Foundation(modulus=(E, 2 * E), poisson=NU, thickness=(H, 3 * H), radius=R),
]  # fmt: skip


@pytest.mark.parametrize("law", LAWS)
def test_stiffness_is_the_slope_and_no_force_no_patch(law: Compliance) -> None:
    # Complex steps do not go through elliptic integrals: differences, of the forces.
    less, more = (law.patch(N[:2] * f, OVAL[:2]).indentation for f in (1 - 1e-5, 1 + 1e-5))
    close(law.patch(N[:2], OVAL[:2]).stiffness, 2e-5 * N[:2] / (more - less), 1e-8)
    none = law.patch(np.zeros(3), OVAL)
    assert none.indentation.tolist() == none.area.tolist() == none.peak_pressure.tolist() == [0] * 3


@pytest.mark.parametrize("law", LAWS[3:])
def test_a_foundation_is_the_sum_of_its_springs(law: Foundation) -> None:
    found, layers = law.patch(N[:1], OVAL[:1]), law._layers
    k1, k2 = OVAL[0]
    d, (K, h) = found.indentation[0], layers[0]
    y = np.linspace(-1, 1, 2001) * np.sqrt(2 * d / k2)
    x = np.linspace(-1, 1, 2001) * np.sqrt(2 * d / k1) if law.length is None else np.zeros(1)
    depth = np.fmax(d - (k1 * x[:, None] ** 2 + k2 * y**2) / 2, 0)
    p = depth / sum(h / K for K, h in layers)
    if law.large_strain:
        p = -K * np.log(1 - depth / h)
    across = law.length if law.length is not None else x[1] - x[0]
    patch = (y[1] - y[0]) * across
    close(p.sum() * patch, N[0], 1e-4)
    close((p > 0).sum() * patch, found.area[0], 2e-3)
    close(p.max(), found.peak_pressure[0])


def test_a_layer_that_is_squeezed_out_has_no_answer() -> None:
    law = Foundation(**LAYER, large_strain=True)
    most = 2 * np.pi * R * K * H
    found = law.patch(most * np.array([1e-7, 0.999, 1.001]), SPHERE)
    assert np.isnan(found.indentation).tolist() == [False, False, True]
    close(found.indentation[0], np.sqrt(most * 1e-7 * H / (np.pi * K * R)), 1e-3)
    assert H * 0.99 < found.indentation[1] < H


@pytest.mark.parametrize("law", LAWS)
def test_what_presses_is_what_it_is_pressed_by_and_energy_its_integral(law: Compliance) -> None:
    """Against the depth under a force, and the trapezoidal rule of the force over the depth."""
    depth = law.patch(N[:2], OVAL[:2]).indentation
    close(law.pressed(depth, OVAL[:2])[0], N[:2])
    d = np.linspace(0, 1, 20_001)[:, None] * depth
    force, energy = law.pressed(d, OVAL[:2])
    close(energy[-1], ((force[1:] + force[:-1]) / 2 * np.diff(d, axis=0)).sum(axis=0), 1e-6)
    assert not np.any(law.pressed(-depth, OVAL[:2]))


def test_sides_that_do_not_touch_at_a_point_have_none() -> None:
    for law in (Hertz(**BODY), Foundation(**LAYER)):
        found = law.patch(N, np.array([[0.0, 100.0], [-1.0, 100.0], [-2.0, -1.0]]))
        assert np.isnan(found.area).all() and np.isnan(found.peak_pressure).all()


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"kind": "hertz", "modulus": 1e6, "poisson": 0.3}, "radius is missing"),
        ({"kind": "hertz", "modulus": 1e6, "poisson": 0.6, "radius": 1e-3}, "at most 0.5, got 0.6"),
        ({"kind": "foundation", **LAYER, "poisson": 0.5}, "less than 0.5"),
        ({"kind": "foundation", **LAYER, "thickness": [1e-3, 1e-3]}, "modulus one"),
        ({"kind": "foundation", **LAYER, "large_strain": True, "length": 1e-2}, "one layer"),
        ({"kind": "linear"}, "stiffness: is missing"),
        ({"kind": "spring", "stiffness": 1.0}, "Available: foundation, hertz, linear"),
    ],
)
def test_what_is_wrong_with_a_compliance_is_said(entry: dict[str, Any], said: str) -> None:
    with pytest.raises(MechanismError, match=said):
        load_mechanism("masticatory").set("contact.left_condyle.compliance", entry)
