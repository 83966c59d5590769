"""A subject's eminence: planted at another slope than the mechanism's, and found."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from support import recorded_jaw
from support.recorded_session import movements, write_session

import condyle
from condyle.errors import InputError
from condyle.mechanism import dumps
from condyle.report.measured_session import MeasuredSession

PLANTED = {"left_condyle": 28.0, "right_condyle": 33.0}  # degrees; the file's are 40


def planted(folder: Path, noise: float = 1e-4, **tables: Any) -> MeasuredSession:
    jaw = condyle.load_mechanism("human-jaw")
    falls = {
        f"contact.{name}.surface.slope": [-float(np.tan(np.radians(slope))), 0.0]
        for name, slope in PLANTED.items()
    }
    own = folder / "own.toml"
    own.write_text(dumps(jaw.set(falls, keep="home")))
    path, _ = write_session(
        folder, 1, 2.6, jaw={"mechanism": str(own), "noise": noise}, mechanism="human-jaw", **tables
    )
    return condyle.measure_session(path)


def table(found: MeasuredSession, name: str) -> list[dict[str, Any]]:
    (one,) = [t for t in found.report_tables if t.name == name]
    return one.records


def slopes_of(found: MeasuredSession) -> list[float]:
    mechanism = found.solutions["chewing1"].condyle.mechanism
    return [float(np.degrees(np.arctan(-c.surface.slope[0]))) for c in mechanism.contacts]


def test_a_planted_slope_is_found(tmp_path: Path) -> None:
    found = planted(tmp_path, eminence={"fit": True})
    for record, (name, slope) in zip(table(found, "eminence"), PLANTED.items(), strict=True):
        assert record["contact"] == name
        error = np.degrees(record["slope"]) - slope
        assert abs(error) < 2.0 and abs(error) < 4 * np.degrees(record["deviation"]) < 8.0
        assert record["travel"] > 3e-3
        assert all(record[f"load_{word}"] >= 0 for word in ("the mechanism's", "used", "used + SD"))
    np.testing.assert_allclose(slopes_of(found), [*PLANTED.values()], atol=2.0)
    # A flatter eminence loads the working joint less (100 N on the right molar).
    right = table(found, "eminence")[1]
    assert right["load_used"] < 0.8 * right["load_the mechanism's"]
    assert max(record["rms"] for record in table(found, "surfaces")) < 1e-3


def test_distances_from_surfaces_show_a_slope_that_is_not_the_subjects(tmp_path: Path) -> None:
    far = table(planted(tmp_path, noise=0.0), "surfaces")
    near = table(planted(tmp_path, noise=0.0, eminence={"slope": PLANTED}), "surfaces")
    assert all(record["rms"] < 1e-5 for record in near)
    assert all(record["rms"] > 20 * 1e-5 for record in far)


def test_a_planted_curve_is_found(tmp_path: Path) -> None:
    """The cubic of human-jaw-curved, on planes of 40 degrees: from protrusion, and with opening."""
    protrusion = movements(2, 0.5, 0.5, 0.8)[:, None] * [0.009, 0.0, 0.0]
    opening = protrusion * [0.8, 1.0, 1.0] + protrusion[:, :1] * [0.0, 0.0, 6.0]
    for number, path in enumerate((protrusion, opening), 1):
        jaw = recorded_jaw.record(
            mechanism="human-jaw-curved", path=path, head=0.3, noise=3e-5, seed=0
        )
        jaw.write(tmp_path / f"curved{number}.c3d")
    path, _ = write_session(
        *(tmp_path, 1, 1.0),
        jaw={"mechanism": "human-jaw"},
        register=jaw.register,
        vertical={"up": jaw.A[:, 2].tolist()},
        eminence={"fit": "profile"},
        trial=[{"file": "curved1.c3d"}, {"file": "curved2.c3d"}],
    )
    found = condyle.measure_session(path)
    curve = Polynomial([0.0, 0.69813, -0.026733, 0.00027313])  # mm down by mm forward
    for joint in table(found, "eminence"):
        error = np.degrees(joint["slope"] - np.arctan(curve.deriv()(0.0)))
        assert abs(error) < 2.0 and abs(error) < 3 * np.degrees(joint["deviation"]) < 9.0
        assert joint["load_used"] != pytest.approx(joint["load_the mechanism's"], rel=0.1)
    for row in table(found, "profiles"):
        forward, down, deviation = (1e3 * row[key] for key in ("forward", "down", "deviation"))
        assert abs(down - curve(forward)) < min(0.1, 0.02 + 3 * deviation)
    assert max(row["forward"] for row in table(found, "profiles")) > 8e-3
    # The surface that is used has that slope, where 40 degrees were.
    for contact in found.mechanism.contacts:
        x, y, z = contact.point
        ahead = [-float(contact.surface.phi((x + step, y, 0.0))) for step in (0.0, 2e-3, 6e-3)]
        np.testing.assert_allclose(ahead[0], z, atol=1e-6)
        np.testing.assert_allclose(
            z - np.array(ahead[1:]), curve(np.array([2.0, 6.0])) / 1e3, atol=1e-4
        )


def test_profiles_are_curves_through_home(tmp_path: Path) -> None:
    falls = [[s, s * np.tan(np.radians(28))] for s in (-4.0, 0.0, 4.0, 8.0, 12.0)]
    left = {"left_condyle": falls}
    found = planted(tmp_path, noise=0.0, eminence={"profile": left})
    assert table(found, "surfaces")[0]["rms"] < 1e-5 < table(found, "surfaces")[1]["rms"]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"fit": True, "slope": 30.0}, "one of slope, profile and fit"),
        ({"slope": {"ear": 30.0}}, "left_condyle"),
        ({"fit": True, "trials": ["chewing9"]}, "chewing1"),
        ({"fit": "line"}, "profile"),
        ({"slope": 30.0, "trials": ["chewing1"]}, "fit = true"),
    ],
)
def test_what_it_refuses(tmp_path: Path, given: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        planted(tmp_path, noise=0.0, eminence=given)
