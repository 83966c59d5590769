"""Poses from encoders by a fixed number of steps: against inverse kinematics, SciPy, the path."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares
from support.cases import case
from support.machines import model
from support.speeds import first

from condyle.backends.kernel import AGAIN, Kernel
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.program import Programs
from condyle.kinematics.chain import FAMILIES
from condyle.model.forward_kinematics import ForwardKinematics, PoseStatus
from condyle.questions.builder import Builder
from condyle.questions.file_numbers import numbers_of
from condyle.questions.pose import pose_from_encoders
from condyle.questions.structure import structure_of

# Curved contacts; every family, two contacts; none; planes; those of one kind with them.
NAMES = ("masticatory-curved", "all_kinds", "gough-stewart", "masticatory", "mixed_k5_n6")
NAMES += ("rss_k1_n6_ball", "mixed_k3_n9_curved", "rss_k2_n6_profile", "hexaglide", "mixed_k2_n8")
AXES = ("X", "Y", "Z", "alpha", "beta", "gamma")


@cache
def truth(name: str, reach: float = 0.05, count: int = 30) -> tuple[np.ndarray, np.ndarray]:
    """Poses that the mechanism can take, and their joint coordinates."""
    m = model(name)
    unit = np.where([c in "XYZ" for c in m.independent], m.characteristic_length, 1.0)
    q = np.random.default_rng(5).uniform(-reach, reach, (count, len(unit))) * unit
    found = m.poses.survey(q, ("pose", "joint"))
    assert found.reached.sum() >= count / 3
    pose, joint = (found.values[key].T[found.reached] for key in ("pose", "joint"))
    return pose, joint


def starts(name: str, size: float) -> np.ndarray:
    """Poses off the true ones, and off the contacts."""
    pose = truth(name)[0]
    unit = np.repeat([model(name).characteristic_length, 1.0], 3)
    return pose + np.random.default_rng(1).uniform(-size, size, pose.shape) * unit


def turning(name: str) -> np.ndarray:
    return np.array([FAMILIES[c.kind].joint_unit == "rad" for c in case(name).mechanism.chains])


def solved(kernel: Kernel, joint: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, ...]:
    answer = kernel.run({"joint": joint, "start": start})
    return answer.values["pose"].T, answer.values["residual"].T, answer.status


@pytest.mark.parametrize("name", first(NAMES, 4))
def test_inverts_inverse_kinematics(name: str) -> None:
    """Also from where the contacts do not hold, and with whole turns of joints that turn."""
    pose, joint = truth(name)
    turns = 2 * np.pi * (np.arange(joint.shape[1]) % 5 - 2) * turning(name)
    for size in (0.0, 1e-5, 1e-3):
        found, left, status = solved(model(name).kernel("pose"), joint + turns, starts(name, size))
        assert not status.any()
        np.testing.assert_allclose(found, pose, rtol=0, atol=2e-12)
        assert np.abs(left).max() < 2e-12


@pytest.mark.usefixtures("compiler_command")
def test_compiled() -> None:
    """The same, alone and in batches; what is in doubt too."""
    name = "masticatory"
    joint, start = truth(name)[1].copy(), starts(name, 1e-3)
    joint[3] = np.nan
    joint[4] += 3.0
    pose, left, status = solved(model(name).kernel("pose"), joint, start)
    again = solved(model(name, "compiled").kernel("pose"), joint, start)
    assert status[3] == AGAIN and status[4] == AGAIN and not status[5:].any()
    np.testing.assert_array_equal(again[2], status)
    np.testing.assert_allclose(again[0][5:], pose[5:], rtol=0, atol=1e-12)
    np.testing.assert_allclose(again[1][5:], left[5:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", first(["all_kinds", "mixed_k2_n8", "masticatory"]))
def test_encoders_that_disagree_meet_in_least_squares(name: str) -> None:
    """Against SciPy, by inverse kinematics; angles count by the characteristic length."""
    m, (pose, joint), turn = model(name), truth(name), turning(name)
    length = m.characteristic_length
    unit = np.array([length if c in "XYZ" else 1.0 for c in m.independent])
    noise = 1e-3 * np.random.default_rng(2).normal(size=joint.shape)
    joint = joint + noise * np.where(turn, 1.0, length)
    found, left, status = solved(m.kernel("pose"), joint, pose)
    assert not status.any() and np.abs(left).max() > 1e-5
    columns, weight = [AXES.index(c) for c in m.independent], np.where(turn, length, 1.0)
    for row in range(2):

        def off(x: np.ndarray, row: int = row) -> np.ndarray:
            at = m.poses.survey((x * unit)[None], ("joint",)).values["joint"][:, 0]
            return (joint[row] - at) * weight / length

        best = least_squares(off, pose[row, columns] / unit, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        # The least sum is flat: where it is, is known to the root of rounding.
        np.testing.assert_allclose(found[row, columns] / unit, best.x, rtol=0, atol=1e-7)
        np.testing.assert_allclose(left[row] * weight / length, best.fun, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", first(["masticatory-curved", "gough-stewart", "masticatory"], 2))
def test_what_is_certain_is_what_the_followed_path_finds(name: str) -> None:
    """From home, near and far; what is doubtful is never called found."""
    joint = truth(name, 0.3, 300)[1]
    pose, left, status = solved(model(name).kernel("pose"), joint, np.zeros((len(joint), 6)))
    followed = ForwardKinematics(model(name).mechanism).solve(joint)
    reached = followed.status == PoseStatus.OK
    sure = (status == 0) & reached
    assert 10 < (status == 0).sum() < len(joint)
    np.testing.assert_allclose(pose[sure], followed.pose[sure], rtol=0, atol=1e-10)
    assert np.abs(left[status == 0]).max() < 1e-9
    assert reached[status == 0].mean() > 0.95


def test_rates_and_weights_in_a_question_of_ones_own() -> None:
    """Joint rates of a motion give its rates back; a chain of no weight has no say."""
    name = "all_kinds"
    mechanism, m = case(name).mechanism, model(name)
    structure = structure_of(mechanism)
    b = Builder(structure)
    joint, rate, weight = (b.lane_sample(port) for port in ("joint", "joint_rate", "weight"))
    found = pose_from_encoders(b, joint, b.sample("start", 6), weight=weight)
    b.output("q", found.q, "m, rad", structure.m)
    b.output("q1", found.last.rates(rate), "per s", structure.m)
    b.output("sure", found.sure, "1")
    kernel = NumpyKernel(Programs(b.finish()), numbers_of(structure, mechanism))
    q = truth(name)[0][:, [AXES.index(x) for x in m.independent]]
    q1 = np.random.default_rng(4).normal(size=q.shape)
    at = m.inverse_dynamics(q, q1, 0 * q, outputs="all")
    given = {"joint": at.configuration.joint, "joint_rate": at.joint_rate, "start": at.pose}
    given["weight"] = np.ones_like(at.joint_rate)
    for wrong in (False, True):
        if wrong:  # a blind encoder: the others are enough
            given["joint"][:, 1] += 0.1
            given["joint_rate"][:, 1] = 7.0
            given["weight"][:, 1] = 0.0
        values = kernel.run(given).values
        assert (values["sure"] == 1).all()
        np.testing.assert_allclose(values["q"].T, q, rtol=0, atol=1e-11)
        np.testing.assert_allclose(values["q1"].T, q1, rtol=0, atol=1e-9)
