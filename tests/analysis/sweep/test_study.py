"""Studies: what a file may say, and one clear line for each that is wrong."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import condyle
from condyle.analysis.sweep import Study
from condyle.analysis.sweep.job import prepared

from .conftest import MACHINE

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
    """Files are looked for beside the study; it survives its own data."""
    (tmp_path / "study.toml").write_text(TEXT)
    study = Study.read(tmp_path / "study.toml")
    left, mass = study.vary
    assert left.scale == (0.9, 1.1) and mass.normal == (0.2, 0.01)
    follow = [[(f.what, f.times, f.plus) for f in one.mirror] for one in study.vary]
    assert follow == [
        [("chain.masseter_right.base[1]", -1.0, 0.0)],
        [("chain.masseter_left.coupler.mass", 1.0, 0.0), ("gravity[2]", 2.0, 1.0)],
    ]
    assert [m.file for m in study.motion] == [str(tmp_path / "path.csv"), "reference"]
    assert study.measure["peak"].better == "less"
    assert Study.checked(study.data(), "study") == study
    arrays = {"vary": [{"what": "platform.mass", "values": np.ones(2)}]}
    assert Study.checked(arrays, "study").vary[0].values == (1.0, 1.0)
    schema = condyle.schema("study")
    assert {"vary", "sampling", "measure", "motion"} <= schema["properties"].keys()
    assert "mirror" in schema["$defs"]["Vary"]["properties"]
    for file, said in ((tmp_path / "none.toml", "no such file"), (tmp_path, "is a folder")):
        with pytest.raises(condyle.InputError, match=said):
            Study.read(file)


def test_what_follows_moves_with_what_varies() -> None:
    y = "chain.masseter_{}.base[1]".format
    mirror = [f"-{y('right')}", {"what": "gravity[2]", "times": 2.0, "plus": -10.0}]
    left = MACHINE.get(y("left")) + 1e-4
    vary = [{"what": y("left"), "values": [left - 1e-4, left], "mirror": mirror}]
    job = prepared(Study.read(spoiled(vary=vary)))
    columns = job.columns(job.design.rows(1, 2))
    assert columns == {y("left"): [left], y("right"): [-left], "gravity[2]": [2.0 * left - 10.0]}


def spoiled(**changes: Any) -> dict[str, Any]:
    return {"load": "none", "motion": {"file": "trial", "rate": 4.0}, "vary": [MASS]} | changes


def vary(**changes: Any) -> dict[str, Any]:
    """None: without that key."""
    one = {key: value for key, value in (MASS | changes).items() if value is not None}
    return spoiled(vary=[one])


def counted(**sampling: Any) -> dict[str, Any]:
    return vary(count=None) | {"sampling": sampling}


def measure(take: str = "max", **one: Any) -> dict[str, Any]:
    return spoiled(measure={"m": {"of": "effort", "take": take} | one})


TAKEN = {"status": {"of": "effort", "take": "max"}}
WRONG: list[tuple[dict[str, Any], str]] = [
    (vary(what="platform.maas"), 'has no "maas".*Did you mean "mass"'),
    (vary(what="platform"), "not a single number"),
    (vary(what="contact.left_condyle.restitution"), "simulations alone"),
    (vary(what="chain.masseter_left.base"), r"base\[0\]"),
    (vary(what="contact.left_condyle.ball_radius"), "not set"),
    (vary(mirror="chain.nope.base[2]"), 'called "nope"'), (vary(mirror="platform.mass"), "twice"),
    (vary(range=[0.3, 0.2]), "lower < upper"),
    (vary(range=["200 g", "300 g"]), "numbers in SI .*'200 g'"),
    (vary(range=[0.2, float("inf")]), "finite"), (vary(scale=[0.9, 1.1]), "got range and scale"),
    (vary(range=None, normal=[0.2, 0.0]), "standard deviation > 0"),
    (vary(count=None), "count is required"),
    (vary(range=None, values=[0.2]), "not allowed with values"), (spoiled(vary=[]), "at least 1"),
    (spoiled(sampling={"kind": "sobl"}), "expected 'grid'"),
    (counted(kind="sobol"), "count is required"),
    (spoiled(sampling={"kind": "latin", "count": 4}), "count is for a grid"),
    (counted(kind="latin", count=10**8), "maximum of"),
    (spoiled(measure={"m": {"take": "max"}}), "of: is missing"),
    (measure(of="efort"), 'Did you mean "effort"'),
    (measure(of="sliding_speed"), "have no sliding_speed"), (measure(take="maximum"), "take"),
    (measure(chain="masseter"), "masseter_left"), (measure(contact="x"), "no contact"),
    (measure(over=["axis"]), "over has"), (measure(over=["chain"]), 'must have "time"'),
    (spoiled(vari=[]), "vari: is not a key"), (spoiled(motion="nowhere.csv"), "nowhere.csv"),
    (spoiled(motion={"file": "reference", "units": "mm"}), "units"),
    (spoiled(mechanism="mastikatory"), "masticatory"),
    (spoiled(formulation="newton"), "formulation"),
    (spoiled(distribution="least"), "distribution"), (spoiled(measure=TAKEN), "two col"),
]  # fmt: skip


def test_a_wrong_study_has_one_clear_problem() -> None:
    for tables, message in WRONG:
        with pytest.raises(condyle.CondyleError, match=message) as caught:
            prepared(Study.read(tables))
        assert str(caught.value).count("\n") <= 1, tables
