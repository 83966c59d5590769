"""Poses from encoders by a fixed number of steps: against inverse kinematics, SciPy, the path."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares
from support.cases import case

from condyle.backends.kernel import AGAIN, Kernel
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.graph.program import Variants
from condyle.kinematics.chain import FAMILIES
from condyle.model.forward_kinematics import ForwardKinematics, PoseStatus
from condyle.model.model import Model
from condyle.questions.builder import Builder
from condyle.questions.file_numbers import numbers_of
from condyle.questions.pose import pose_from_encoders
from condyle.questions.structure import structure_of

NAMES = ("masticatory", "masticatory-curved", "gough-stewart", "hexaglide", "rss_k1_n6_ball")
NAMES += ("rss_k2_n6_profile", "mixed_k2_n8", "mixed_k3_n9_curved", "mixed_k5_n6", "all_kinds")


@cache
def model(name: str, backend: str = "numpy") -> Model:
    return Model(case(name).mechanism, backend=backend)


@cache
def truth(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Poses that the mechanism can take, and their joint coordinates."""
    m = model(name)
    unit = np.where([c in "XYZ" for c in m.independent], m.characteristic_length, 1.0)
    q = np.random.default_rng(5).uniform(-0.05, 0.05, (60, len(unit))) * unit
    found = m.poses.survey(q, ("pose", "joint"))
    assert found.reached.sum() >= 20
    pose, joint = (found.values[key].T[found.reached] for key in ("pose", "joint"))
    return pose, joint


def starts(name: str, size: float, seed: int = 1) -> np.ndarray:
    """Poses off the true ones, and off the contacts."""
    pose = truth(name)[0]
    unit = np.repeat([model(name).characteristic_length, 1.0], 3)
    return pose + np.random.default_rng(seed).uniform(-size, size, pose.shape) * unit


def solved(kernel: Kernel, joint: np.ndarray, start: np.ndarray) -> tuple[np.ndarray, ...]:
    answer = kernel.run({"joint": joint, "start": start})
    return answer.values["pose"].T, answer.values["residual"].T, answer.status


@pytest.mark.parametrize("name", NAMES)
def test_inverts_inverse_kinematics(name: str) -> None:
    """Also from where the contacts do not hold, and with whole turns of joints that turn."""
    pose, joint = truth(name)
    kinds = [FAMILIES[chain.kind].joint_unit for chain in case(name).mechanism.chains]
    turns = 2 * np.pi * np.array([(i % 5 - 2) * (unit == "rad") for i, unit in enumerate(kinds)])
    for size in (0.0, 1e-5, 1e-3):
        found, left, status = solved(model(name).kernel("pose"), joint + turns, starts(name, size))
        assert not status.any()
        np.testing.assert_allclose(found, pose, rtol=0, atol=2e-12)
        assert np.abs(left).max() < 2e-12


@pytest.mark.parametrize("name", ["masticatory", "mixed_k3_n9_curved"])
@pytest.mark.usefixtures("compiler_command")
def test_compiled(name: str) -> None:
    """The same, alone and in batches; what is in doubt too."""
    joint, start = truth(name)[1], starts(name, 1e-3)
    joint = joint + 0
    joint[3] = np.nan
    joint[4] += 3.0
    pose, left, status = solved(model(name).kernel("pose"), joint, start)
    kernel = model(name, "compiled").kernel("pose")
    again = solved(kernel, joint, start)
    assert status[3] == AGAIN and status[4] == AGAIN and not status[5:].any()
    np.testing.assert_array_equal(again[2], status)
    np.testing.assert_allclose(again[0][5:], pose[5:], rtol=0, atol=1e-12)
    np.testing.assert_allclose(again[1][5:], left[5:], rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["masticatory", "mixed_k2_n8", "all_kinds"])
def test_encoders_that_disagree_meet_in_least_squares(name: str) -> None:
    """Against SciPy, by inverse kinematics; angles count by the characteristic length."""
    m, (pose, joint) = model(name), truth(name)
    chains = case(name).mechanism.chains
    turning = np.array([FAMILIES[chain.kind].joint_unit == "rad" for chain in chains])
    length = m.characteristic_length
    joint = joint + 1e-3 * np.random.default_rng(2).normal(size=joint.shape) * np.where(
        turning, 1.0, length
    )
    found, left, status = solved(m.kernel("pose"), joint, pose)
    assert not status.any() and np.abs(left).max() > 1e-5
    columns = ["XYZ".find(c) if c in "XYZ" else 3 + "abg".find(c[0]) for c in m.independent]
    unit = np.where(np.array(columns) < 3, length, 1.0)
    weight = np.where(turning, length, 1.0)
    for row in range(3):

        def off(x: np.ndarray, row: int = row) -> np.ndarray:
            at = m.poses.survey((x * unit)[None], ("joint",)).values["joint"][:, 0]
            return (joint[row] - at) * weight / length

        best = least_squares(off, pose[row, columns] / unit, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        # The least sum is flat: where it is, is known to the root of rounding.
        np.testing.assert_allclose(found[row, columns] / unit, best.x, rtol=0, atol=1e-7)
        np.testing.assert_allclose(left[row] * weight / length, best.fun, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", ["masticatory", "masticatory-curved", "gough-stewart"])
def test_what_is_certain_is_what_the_followed_path_finds(name: str) -> None:
    """From home, near and far; what is doubtful is never called found."""
    m = model(name)
    unit = np.where([c in "XYZ" for c in m.independent], m.characteristic_length, 1.0)
    q = np.random.default_rng(8).uniform(-0.3, 0.3, (400, len(unit))) * unit
    survey = m.poses.survey(q, ("joint",))
    joint = survey.values["joint"].T[survey.reached]
    pose, left, status = solved(m.kernel("pose"), joint, np.zeros((len(joint), 6)))
    followed = ForwardKinematics(m.mechanism).solve(joint)
    reached = followed.status == PoseStatus.OK
    sure = (status == 0) & reached
    assert 10 < (status == 0).sum() < len(joint)
    np.testing.assert_allclose(pose[sure], followed.pose[sure], rtol=0, atol=1e-10)
    assert np.abs(left[status == 0]).max() < 1e-9
    assert reached[status == 0].mean() > 0.95


@pytest.mark.parametrize("name", ["masticatory-curved", "all_kinds"])
def test_rates_and_weights_in_a_question_of_ones_own(name: str) -> None:
    """Joint rates of a motion give its rates back; a chain of no weight has no say."""
    c, m = case(name), model(name)
    structure = structure_of(c.mechanism)
    b = Builder(structure)
    joint, rate, weight = (b.lane_sample(port) for port in ("joint", "joint_rate", "weight"))
    found = pose_from_encoders(b, joint, b.sample("start", 6), weight=weight)
    b.output("q", found.q, "m, rad", structure.m)
    b.output("q1", found.last.rates(rate), "per s", structure.m)
    b.output("sure", found.sure, "1")
    kernel = NumpyKernel(Variants(b.finish()), numbers_of(structure, c.mechanism))
    pose = truth(name)[0]
    q = pose[:, [["X", "Y", "Z", "alpha", "beta", "gamma"].index(x) for x in m.independent]]
    q1 = np.random.default_rng(4).normal(size=q.shape)
    at = m.inverse_dynamics(q, q1, 0 * q, outputs="all")
    given = {"joint": at.configuration.joint, "joint_rate": at.joint_rate, "start": at.pose}
    weights = np.ones_like(at.joint_rate)
    for wrong in (False, True):
        if wrong:  # a blind encoder: the others are enough
            given["joint"][:, 1] += 0.1
            given["joint_rate"][:, 1] = 7.0
            weights[:, 1] = 0.0
        values = kernel.run(given | {"weight": weights}).values
        assert (values["sure"] == 1).all()
        np.testing.assert_allclose(values["q"].T, q, rtol=0, atol=1e-11)
        np.testing.assert_allclose(values["q1"].T, q1, rtol=0, atol=1e-9)
