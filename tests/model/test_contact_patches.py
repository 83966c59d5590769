"""Patches of contacts at poses: curvatures against the surfaces themselves, and lost contacts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

import condyle
from condyle import Mechanism
from condyle.model.contact_patches import contact_patches

LEFT = "contact.left_condyle."
FOOT = np.array([-0.026, 0.071, 0.042])
BALL = 0.008
K, GIVE = 3e6, 2e-3 / 3e6  # of a foundation with nu = 0
LAW = {"kind": "foundation", "modulus": K, "poisson": 0.0, "thickness": 2e-3}
QUADRATIC = {"kind": "quadratic", "slope": [-0.8, 0.1], "xx": 12.0, "xy": 5.0, "yy": -9.0}
SURFACES: list[dict[str, Any]] = [
    {"kind": "plane", "slope": [-0.8, 0.3]},
    QUADRATIC,
    {"kind": "sphere", "centre": np.add(FOOT, [0.003, 0.004, -0.02]).tolist(), "side": "inside"},
    {"kind": "sphere", "centre": np.add(FOOT, [0.003, 0.004, 0.02]).tolist(), "side": "outside"},
    {"kind": "ellipsoid", "centre": (FOOT - [0.003, 0.004, 0.02]).tolist(), "side": "inside",
     "semi_axes": [0.025, 0.03, 0.02], "rotation": [0.3, 0.2, -0.1]},
    {"kind": "cylinder", "point": (FOOT - [0.003, 0.004, 0.02]).tolist(), "axis": [1, 2, 0.5],
     "side": "inside"},
    {"kind": "profile", "direction": [0.6, 0.8], "points":
     [[-0.01, 0.05], [0.02, 0.045], [0.045, 0.041], [0.06, 0.04]]},
]  # fmt: skip


def machine(surface: dict[str, Any], radius: Any) -> Mechanism:
    """The left ball touches the surface at about FOOT; with a radius of its own it has no size."""
    own = dict(surface)
    side = own.pop("side", "below")
    if own["kind"] in ("sphere", "cylinder"):
        lever = FOOT - own.get("centre", own.get("point"))
        if "axis" in own:
            axis = np.array(own["axis"]) / np.linalg.norm(own["axis"])
            lever -= axis * (axis @ lever)
        own["radius"] = float(np.linalg.norm(lever))
    base = condyle.load_mechanism("masticatory")
    kind = condyle.mechanism.surface.SURFACES[own["kind"]]
    if "offset" in kind.model_fields:
        own["offset"] = 0.0
    wall = kind(**own)
    w = FOOT.copy()
    w[2] -= brentq(lambda z: wall.phi(w - [0, 0, z]), -0.02, 0.02) if wall.closed else wall.phi(w)
    n = np.array(_gradient(wall, w))
    n /= np.linalg.norm(n)
    push = {"below": -1, "inside": -1, "outside": 1}[side]
    entry: dict[str, Any] = {**LAW} if radius is None else {**LAW, "radius": radius}
    ball = None if radius is not None else BALL
    point = w + (push * BALL * n if radius is None else 0)
    changes = {"surface": own, "side": side, "ball_radius": ball, "point": point.tolist()}
    changes |= {"compliance": entry, "one_sided": True, "bounds": {}}
    return base.set({LEFT + key: value for key, value in changes.items()})


def _gradient(wall: Any, p: np.ndarray) -> list[float]:
    steps = 1e-7 * np.eye(3)
    return [float(wall.phi(p + e) - wall.phi(p - e)) / 2e-7 for e in steps]


def relative_radius(mechanism: Mechanism, pose: np.ndarray) -> float:
    """sqrt(R1 R2) of the gap between the ball and the wall, by its second differences."""
    contact, R = mechanism.contacts[0], Rotation.from_euler("XYZ", pose[3:]).as_matrix()
    centre = pose[:3] + R @ contact.point
    wall, push = contact.surface, contact.push
    foot, ball = centre, contact.ball_radius or 0.0
    for _ in range(50):
        n = np.array(_gradient(wall, foot))
        n *= push / np.linalg.norm(n)
        foot = centre - n * ball
    x = R[:, 0] - n * (n @ R[:, 0])
    x /= np.linalg.norm(x)
    y = push * np.cross(n, x)
    radii = contact.compliance.radius or ball
    rx, ry = radii if isinstance(radii, tuple) else (radii, radii)

    def gap(u: float, v: float) -> float:
        at = foot + u * x + v * y
        height = brentq(lambda h: wall.phi(at + h * n), -2e-3, 2e-3, xtol=1e-16)
        return u**2 / rx / 2 + v**2 / ry / 2 - height

    e = 2e-4
    xx, yy = (gap(e, 0) + gap(-e, 0)) / e**2, (gap(0, e) + gap(0, -e)) / e**2
    xy = (gap(e, e) - gap(e, -e) - gap(-e, e) + gap(-e, -e)) / (4 * e**2)
    return float((xx * yy - xy**2) ** -0.5)


@pytest.mark.parametrize("radius", [None, 0.006, (0.004, 0.009)])
@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: s["kind"] + s.get("side", ""))
def test_the_curvature_is_that_of_ball_and_wall(surface: dict[str, Any], radius: Any) -> None:
    mechanism = machine(surface, radius)
    q = np.array([0.001, -0.0005, 0.02, -0.03]) * (0.3 if surface["kind"] == "sphere" else 1)
    pose = condyle.derive(mechanism, backend="numpy").inverse_kinematics(q).pose
    push = mechanism.contacts[0].push
    found = contact_patches(mechanism, pose[None], push * np.array([[20.0, 20.0]]))
    R = relative_radius(mechanism, pose)
    depth = np.sqrt(20.0 * GIVE / (np.pi * R))
    assert found.indentation[0, 0] == pytest.approx(depth, rel=1e-4)
    assert found.area[0, 0] == pytest.approx(2 * np.pi * R * depth, rel=1e-4)
    assert np.isnan(found.indentation[0, 1]) and np.isinf(found.stiffness[0, 1])
    lost = contact_patches(mechanism, pose[None], -push * np.array([[20.0, 20.0]]))
    assert lost.area[0, 0] == lost.indentation[0, 0] == lost.stiffness[0, 0] == 0
