"""EPFL's robotic jaw: its published dimensions, and its bite against an own linear program."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

import condyle

PUBLISHED, MEASURED = 1155.0, 124.6 + 124.6 + 66.3  # N


def test_home_is_at_mid_stroke() -> None:
    """The published height makes legs shorter than the actuators can be."""
    legs = [
        1e3 * np.subtract(leg.platform, leg.base)
        for leg in condyle.load_mechanism("epfl-jaw").chains
    ]
    lengths = np.linalg.norm(legs, axis=1)
    np.testing.assert_allclose(lengths, (378.64 + 480.24) / 2, atol=5e-3)
    aside = [np.hypot(*leg[:2]) for leg in legs]
    np.testing.assert_allclose(np.hypot(aside, 324.415), 378.51, atol=5e-3)
    angles = np.degrees(np.arcsin([leg[2] for leg in legs] / lengths))
    np.testing.assert_allclose(angles, 63, atol=0.05)


@pytest.mark.parametrize("tooth", ["incisor", "right_molar", "left_molar"])
def test_a_bite_is_that_of_an_own_linear_program(tooth: str) -> None:
    """Of rods that carry along themselves: legs' weights act at their own centres."""
    robot = condyle.load_mechanism("epfl-jaw")
    at = np.array(robot.platform.points[tooth])
    columns, weight = [], np.zeros(6)
    weight[2] -= 3.0 * 9.81  # its centre is above O_M, without a moment
    for leg in robot.chains:
        line = np.subtract(leg.platform, leg.base)
        length, unit = np.linalg.norm(line), line / np.linalg.norm(line)
        columns.append([*unit, *np.cross(leg.platform, unit)])
        # Held by universal joint and ball: the ball takes what tips the leg about its base.
        tips = 1.2 * 0.125 / length + 0.5 * (length - 0.1) / length
        down = np.array([0, 0, -9.81 * tips])
        across = down - unit * (unit @ down)
        along = unit * (-9.81 * 0.5 * unit[2])  # the piston rests on the actuator
        force = across + along
        weight += [*force, *np.cross(leg.platform, force)]
    bite = np.array([0, 0, -1.0, *np.cross(at, [0, 0, -1.0])])
    matrix = np.column_stack([*columns, bite])
    limits = [(-222.4, 222.4)] * 6 + [(0, None)]
    best = linprog(np.r_[np.zeros(6), -1.0], A_eq=matrix, b_eq=-weight, bounds=limits)
    found = float(condyle.largest_bite(robot, tooth).force[0, 0])
    assert found == pytest.approx(best.x[-1], rel=1e-9)
    assert MEASURED < found < PUBLISHED
