"""Studies: what a file may say, and one clear line for each that is wrong."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import condyle
from condyle.analysis.sweep import Study, json_schema, read_study
from condyle.analysis.sweep.job import prepared

MASS = {"what": "platform.mass", "range": [0.2, 0.3], "count": 3}
TEXT = """
mechanism = "masticatory"
motion = [{ file = "path.csv", units = "mm" }, "reference"]
load = "none"
[[vary]]
what = "chain.masseter_left.base[1]"
mirror = "-chain.masseter_right.base[1]"
scale = [0.9, 1.1]
[[vary]]
what = "platform.mass"
normal = [0.2, 0.01]
mirror = ["chain.masseter_left.coupler.mass", { what = "gravity[2]", times = 2, plus = 1.0 }]
[sampling]
kind = "sobol"
count = 8
[measure]
peak = { of = "effort", take = "max_abs", better = "less" }
"""


def test_a_file_says_what_varies_and_what_is_measured(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(TEXT)
    study = read_study(tmp_path / "study.toml")
    left, mass = study.vary
    assert left.scale == (0.9, 1.1) and mass.normal == (0.2, 0.01)
    assert [(f.what, f.times, f.plus) for f in left.mirror] == [
        ("chain.masseter_right.base[1]", -1.0, 0.0)
    ]
    assert [(f.what, f.times, f.plus) for f in mass.mirror] == [
        ("chain.masseter_left.coupler.mass", 1.0, 0.0),
        ("gravity[2]", 2.0, 1.0),
    ]
    # Files are looked for beside the study.
    assert [m.file for m in study.motion] == [str(tmp_path / "path.csv"), "reference"]
    assert study.measure["peak"].better == "less"


def test_a_study_survives_its_own_data() -> None:
    study = Study.checked({"vary": [MASS], "load": "none"}, "study")
    assert Study.checked(study.data(), "study") == study


def test_the_schema_knows_the_tables() -> None:
    schema = json_schema()
    assert {"vary", "sampling", "measure", "motion"} <= schema["properties"].keys()
    assert "mirror" in schema["$defs"]["Vary"]["properties"]


def spoiled(**changes: Any) -> dict[str, Any]:
    return {"load": "none", "motion": {"file": "trial", "rate": 4.0}, "vary": [MASS]} | changes


def vary(**changes: Any) -> dict[str, Any]:
    return spoiled(vary=[{**MASS, **changes}])


def measure(**one: Any) -> dict[str, Any]:
    return spoiled(measure={"m": one})


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "no such path": (vary(what="platform.maas"), 'has no "maas".*Did you mean "mass"'),
    "a table": (vary(what="platform"), "not a single number"),
    "a point": (vary(what="chain.masseter_left.base"), r"base\[0\]"),
    "left out": (vary(what="contact.left_condyle.ball_radius"), "not set"),
    "a mirror that is not there": (vary(mirror="chain.nope.base[2]"), 'called "nope"'),
    "twice the same": (vary(mirror="platform.mass"), "twice"),
    "reversed": (vary(range=[0.3, 0.2]), "lower < upper"),
    "units": (vary(range=["200 g", "300 g"]), 'numbers in SI .*"200 g"'),
    "infinite": (vary(range=[0.2, float("inf")]), "finite"),
    "two ways": (vary(scale=[0.9, 1.1]), "got range and scale"),
    "no deviation": (vary(range=None, normal=[0.2, 0.0]), "standard deviation > 0"),
    "no count": (vary(count=None), "count is required"),
    "a count of values": (vary(range=None, values=[0.2]), "not allowed with values"),
    "nothing varies": (spoiled(vary=[]), "at least 1"),
    "no such kind": (spoiled(sampling={"kind": "sobl"}), "expected 'grid'"),
    "no count of samples": (
        spoiled(vary=[{**MASS, "count": None}], sampling={"kind": "sobol"}),
        "count is required",
    ),
    "two counts": (spoiled(sampling={"kind": "latin", "count": 4}), "count is for a grid"),
    "too many": (
        spoiled(vary=[{**MASS, "count": None}], sampling={"kind": "latin", "count": 10**8}),
        "maximum of",
    ),
    "no variable": (measure(take="max"), "of: is missing"),
    "a variable that is not there": (measure(of="efort", take="max"), 'Did you mean "effort"'),
    "one that others have": (measure(of="sliding_speed", take="max"), "have no sliding_speed"),
    "no such reduction": (measure(of="effort", take="maximum"), "take"),
    "no such chain": (measure(of="effort", take="max", chain="masseter"), "masseter_left"),
    "a dimension it has not": (measure(of="effort", take="max", contact="x"), "no contact"),
    "over nothing it has": (measure(of="effort", take="max", over=["axis"]), "over has"),
    "not over time": (measure(of="effort", take="max", over=["chain"]), 'must have "time"'),
    "a key that is none": (spoiled(vari=[]), "vari: is not a key"),
    "no such motion": (spoiled(motion="nowhere.csv"), "nowhere.csv"),
    "units of the reference": (spoiled(motion={"file": "reference", "units": "mm"}), "units"),
    "no such mechanism": (spoiled(mechanism="mastikatory"), "masticatory"),
    "no such formulation": (spoiled(formulation="newton"), "formulation"),
    "no such distribution": (spoiled(distribution="least"), "distribution"),
    "a name that is taken": (
        spoiled(measure={"status": {"of": "effort", "take": "max"}}),
        "two col",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_study_gets_one_clear_line(case: str) -> None:
    tables, message = WRONG[case]
    given = copy.deepcopy(tables)
    for one in given["vary"]:
        for key in [key for key, value in one.items() if value is None]:
            del one[key]
    with pytest.raises(condyle.CondyleError, match=message) as caught:
        prepared(read_study(given))
    assert "\n" not in str(caught.value)


def test_python_may_give_numpy_arrays() -> None:
    import numpy as np

    study = Study.checked({"vary": [{"what": "platform.mass", "values": np.ones(2)}]}, "study")
    assert study.vary[0].values == (1.0, 1.0)


@pytest.mark.parametrize("make", [lambda f: f / "none.toml", lambda f: f])
def test_a_file_that_is_none(make: Callable[[Path], Path], tmp_path: Path) -> None:
    with pytest.raises(condyle.InputError, match="no such file"):
        read_study(make(tmp_path))


def test_what_follows_moves_with_what_varies() -> None:
    y = "chain.masseter_{}.base[1]".format
    mirror = [f"-{y('right')}", {"what": "gravity[2]", "times": 2.0, "plus": -10.0}]
    left = condyle.load_mechanism("masticatory").get(y("left"))
    vary = [{"what": y("left"), "values": [left, left + 1e-4], "mirror": mirror}]
    job = prepared(read_study(spoiled(vary=vary)))
    columns = job.columns(job.design.rows(1, 2))
    assert columns == {
        y("left"): [left + 1e-4],
        y("right"): [-left - 1e-4],
        "gravity[2]": [2.0 * (left + 1e-4) - 10.0],
    }
