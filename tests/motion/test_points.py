"""Where a load acts: by name, by coordinates, at several points."""

from pathlib import Path

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


def test_variants_take_the_same_places() -> None:
    """A point that varies moves the middle of several; coordinates stay."""
    motion, load = trial_motion(JAW, rate=5), Load.constant([5.0, 3.0, -40.0])
    lower = np.array([0.01, 0.0])
    table = {"platform.points.right_molar[2]": lower, "platform.mass": [0.2, 0.25]}
    model = condyle.derive(JAW, distribution="minimum_norm", backend="numpy")
    variants = model.variants(table)
    for given in (written(A), "right_molar; " + written(B)):
        found = variants.solve(motion, load, load_point=given)
        for i, machine in enumerate(map(variants.alone, range(2))):
            wanted = machine.solve(motion, load, load_point=given)
            np.testing.assert_allclose(found["effort"][i], wanted["effort"], rtol=1e-9, atol=1e-9)
    with pytest.raises(InputError, match="three numbers"):
        variants.solve(motion, load, load_point="1,2")


def test_a_law_measures_its_force_at_the_same_place() -> None:
    """By coordinates as by name, with the load at these coordinates."""
    machine, name = condyle.derive("masticatory", backend="numpy"), "right_molar"
    place = written(machine.mechanism.platform.points[name])

    def run(point: str) -> np.ndarray:
        law = {"kind": "bite_force", "stiffness": 900.0, "force": 30.0, "rate": 500.0}
        spring = {"kind": "spring", "stiffness": 3e3, "damping": 2.0, "rest": 2e-3}
        loads = [spring | {"point": "left_molar"}, spring | {"point": point}]
        tables = {"duration": 0.04, "controller": law | {"point": point}, "load": loads}
        found = condyle.simulate(machine, tables)
        assert np.abs(found["bite_force"]).max() > 1.0
        return found["effort"].values

    np.testing.assert_array_equal(run(place), run(name))


def test_a_log_bears_its_load_there(tmp_path: Path) -> None:
    machine = condyle.load_mechanism("masticatory")
    heavy, motion = machine.set("platform.mass", 0.23), trial_motion(machine, rate=100)
    load = Load.constant([5.0, 3.0, -40.0], point="right_molar")
    run = condyle.derive(heavy, backend="numpy").solve(motion, load, load_point=written(A))
    log = tmp_path / "log.csv"
    condyle.write_log(run, log)
    study = {"numbers": ["platform.mass"], "options": {"load_point": written(A)}}
    study["noise"] = {"effort": 1e-3, "encoder": 1e-5}
    found = condyle.identify(machine, log, study, backend="numpy")
    assert found.numbers[0].value == pytest.approx(0.23, abs=1e-4)
    assert found.mechanism.platform.points == machine.platform.points
