"""Where a load acts: by name, by coordinates, at several points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import condyle
from condyle.errors import InputError
from condyle.motion import Load, load_place, trial_motion, with_load_point

JAW = condyle.load_mechanism("human-jaw")
A, B = (0.03, 0.02, -0.01), (0.05, -0.01, -0.02)


def written(*points: tuple[float, ...]) -> str:
    return "; ".join(",".join(map(repr, point)) for point in points)


def test_coordinates_are_a_point_of_that_place() -> None:
    named = JAW.set("platform.points.spot", A)
    motion, load = trial_motion(JAW), Load.constant([5.0, 3.0, -40.0], [0.1, 0.2, 0.3])
    how = {"backend": "numpy", "flag": True}
    wanted = condyle.run(named, motion, load, load_point="spot", **how)
    found = condyle.run(JAW, motion, load, load_point=written(A), **how)
    np.testing.assert_array_equal(found["effort"], wanted["effort"])
    name = found.condyle.options["load_point"]
    assert found.condyle.mechanism.platform.points[name] == A
    model = condyle.derive(JAW, backend="numpy")
    again = model.solve(motion, load, load_point=written(A), flag=True)
    np.testing.assert_array_equal(again["effort"], wanted["effort"])
    twice, name = with_load_point(found.condyle.mechanism, written(B))
    assert name == "load_point_2" and twice.platform.points[name] == B


def test_several_points_bear_equal_parts() -> None:
    """Against half the force at each, moved to O_M here."""
    motion, force = trial_motion(JAW), np.array([5.0, 3.0, -40.0])
    model = condyle.derive(JAW, distribution="minimum_norm", backend="numpy")
    found = model.solve(motion, Load.constant(force), load_point=written(A, B))
    pose = found["pose"].values
    turned = [Rotation.from_euler("XYZ", pose[:, 3:]).apply(point) for point in (A, B)]
    moment = sum(np.cross(arm, force / 2) for arm in turned)
    columns = [found[name].sel(coordinate=[*model.independent]).values for name in (
        "pose", "pose_rate", "pose_acceleration")]  # fmt: skip
    wrench = np.hstack([np.tile(force, (len(pose), 1)), moment])
    wanted = model.inverse_dynamics(*columns, wrench)
    np.testing.assert_allclose(found["effort"], wanted.effort, rtol=1e-9, atol=1e-9)
    middle = load_place("right_molar;left_molar", JAW.platform.points)
    points = [JAW.platform.points[f"{side}_molar"] for side in ("left", "right")]
    np.testing.assert_allclose(middle, np.mean(points, axis=0), atol=1e-15)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("1,2", "three numbers"), ("a,b,c", "three numbers"), ("nan,0,0", "three numbers"),
        ("1e9,0,0", "at most 100000"), ("right_molar;", 'no load point ""'),
        ("right_molr;incisor", 'Did you mean "right_molar"'),
    ],
)  # fmt: skip
def test_what_is_no_point(given: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        with_load_point(JAW, given)
