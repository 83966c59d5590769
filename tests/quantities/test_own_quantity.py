"""A row and its equation are all that a quantity needs, from outside the package too."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from quantities.platform_speed import add
from support.machines import model

import condyle
from condyle.errors import InputError
from condyle.export import export
from condyle.export.catalogue import CATALOGUE
from condyle.quantities import QUANTITIES
from condyle.questions import QUESTIONS
from condyle.report.figures.registry import PLOTS
from condyle.report.panel import PANEL_GROUPS, panels_of

OWN = model("masticatory")
T = np.linspace(0.0, 0.5, 9)
COLUMNS = {"X": 1e-3 * np.sin(4 * T), "Y": 0 * T, "alpha": 0 * T, "beta": 0.05 * T}
MOTION = condyle.Motion.from_arrays(T, COLUMNS)


@pytest.fixture
def _added() -> Iterator[None]:
    registries = [QUANTITIES, QUESTIONS, CATALOGUE, PANEL_GROUPS, PLOTS]
    before = [dict(one) for one in registries]
    add()
    yield
    for one, entries in zip(registries, before, strict=True):
        one.clear()
        one.update(entries)


@pytest.mark.usefixtures("_added")
def test_a_row_is_a_variable_a_column_a_figure_and_an_output_in_c(tmp_path: Path) -> None:
    solution = OWN.solve(MOTION)
    right = np.linalg.norm(solution["pose_rate"].values[:, :3], axis=1)
    found = solution["platform_speed"]
    np.testing.assert_allclose(found, right, rtol=1e-12)
    assert found.attrs == {"units": "m/s", "long_name": "speed of the platform's origin"}
    solution.condyle.save(tmp_path / "run.csv", tmp_path / "run.nc")
    assert "platform_speed" in (tmp_path / "run.csv").read_text().partition("\n")[0].split(",")
    assert condyle.open_solution(tmp_path / "run.nc")["platform_speed"].attrs == found.attrs
    kept = OWN.variants({"platform.mass": [0.2, 0.3]}).solve(MOTION, keep="platform_speed")
    np.testing.assert_allclose(kept["platform_speed"][1], right, rtol=1e-12)
    axes = solution.condyle.plot.platform_speed().axes[0]
    assert axes.get_ylabel() == "platform speed [m/s]"
    assert ("motion", "platform_speed") in {(section, p.id) for section, p in panels_of(solution)}
    [output] = export(OWN.mechanism, questions=["platform_speed"])["platform_speed"].outputs
    assert (output.text, output.unit) == ("speed of the platform's origin", "m/s")
    with pytest.raises(InputError, match='a quantity "platform_speed" already'):
        add()


def test_units_go_by_the_machine() -> None:
    """A rail's effort is a force, whatever others' are; without a machine both are named."""
    effort, rate = QUANTITIES["effort"], QUANTITIES["joint_rate"]
    hexaglide = condyle.load_mechanism("hexaglide")
    assert {*effort.units(OWN.mechanism)} == {"N m"} and {*effort.units(hexaglide)} == {"N"}
    assert {*rate.units(hexaglide)} == {"m/s"} and rate.any_unit() == "rad/s or m/s"
    assert QUANTITIES["v"].any_unit() == "m/s, rad/s"
    assert QUANTITIES["contact_point"].columns(OWN.mechanism)[1] == "point_left_condyle_y"
