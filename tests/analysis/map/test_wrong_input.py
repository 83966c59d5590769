"""What cannot be mapped is refused in one line, before any work; maps in files, or none."""

from pathlib import Path
from typing import Any

import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.analysis.map import compute

X = "X=-5:5:10 mm"
STIFF = "stiffness"
OVER = ["X=-6:14:9 mm", "beta=-15:35:8 deg"]
QUANTITIES = ["pose", "ratio", "effort"]
WRONG: list[tuple[dict[str, Any], str]] = [
    ({"over": []}, "one to three coordinates, got 0"),
    ({"over": [X, "Y=0:1:3", "alpha=0:1:3", "beta=0:1:3"]}, "got 4"),
    ({"over": "Q=0:1:3"}, '"Q" is not a coordinate'),
    ({"over": "betta=0:1:3"}, 'Did you mean "beta"'),
    ({"over": "Z=0:1:3 mm"}, "Z is determined by the contacts"),
    ({"over": "X=5:-5:10 mm"}, "must be increasing"),
    ({"over": "X=5:5:10 mm"}, "must be increasing"),
    ({"over": "X=-5:5:10 deg"}, '"deg" is not a unit of length'),
    ({"over": "beta=-5:5:10 mm"}, '"mm" is not a unit of angle'),
    ({"over": "X=-5:5:1 mm"}, "whole count of at least 2"),
    ({"over": "X=-5:5:2.5 mm"}, "whole count of at least 2"),
    ({"over": "X=-5:5:ten mm"}, "over: X: count: expected a number, got 'ten'"),
    ({"over": "X=-5:inf:9 mm"}, "finite number"),
    ({"over": "X=-5..5"}, "expected name=low:high:count unit"), ({"over": [X, X]}, "twice"),
    ({"over": ["X=0:1:1e6", "Y=0:1:1e6"]}, "at most 1e\\+10"),
    ({"over": {"X": (0, 1)}}, r"expected \(low, high, count\)"),
    ({"hold": "X=1 mm"}, "X is an axis of the map too"),
    ({"hold": "gamma=1 deg"}, "gamma is determined by the contacts"),
    ({"hold": "Y=1 deg"}, '"deg" is not a unit of length'),
    ({"hold": "Y=1 mm,Y=2 mm"}, "given twice"), ({"hold": "Y"}, "expected name=value unit"),
    ({"hold": "W=1"}, 'hold: unknown name "W"'),
    ({"quantities": "ratoi"}, 'no quantity "ratoi".* Did you mean "ratio"'),
    ({"quantities": "load_limit"}, "--direction"), ({"quantities": STIFF}, "--stiffness"),
    ({"quantities": "load_limit", "direction": "0,0"}, "expected three numbers"),
    ({"quantities": "load_limit", "direction": "0,0,0"}, "expected a length"),
    ({"quantities": STIFF, STIFF: -1.0}, "above 0"),
    ({"quantities": STIFF, STIFF: {"nobody": 1.0}}, 'no chain "nobody"'),
    ({"quantities": STIFF, STIFF: {"masseter_left": 1.0}}, "have none"),
    ({"load": "Fz=-50 mm"}, '"mm" is not a unit of force'),
    ({"load": "Fq=-50"}, 'load: unknown name "Fq"'),
    ({"load": "Fz=-50", "load_point": "toe"}, "toe"),
    ({"stroke": "leg_*=-1:1"}, 'no chain is called "leg_\\*"'),
    ({"stroke": "masseter_*=1:2 rad"}, "range about home"),
    ({"stroke": "masseter_*=-1:2 mm"}, '"mm" is not a unit of angle'),
    ({"stroke": "masseter_*"}, "expected chain=low:high unit"),
    ({"over": 3}, "over: expected a name or several, got 3"),
    ({"hold": 3}, "expected text such as"),
    ({"load": [1.0, 2.0]}, "expected text such as"),
    ({"quantities": 3}, "quantities: expected a name or several, got 3"),
    ({"quantities": STIFF, STIFF: "stiff"}, "stiffness: expected a number, got 'stiff'"),
    ({"quantities": "load_limit", "direction": 3}, "direction"), ({"load_point": 3}, "3"),
    ({"stroke": 3}, "stroke"), ({"out": 3}, "out: expected the path of a file, got 3"),
    ({"threads": "two"}, "threads"), ({"scheduler": 3}, "scheduler"),
    ({"scheduler": "nobody"}, "expected processes, threads, or"),
    ({"model": 3}, "model: expected a model"),
    ({"model": "gough-stewart", "quantities": "bounds"}, "contacts with bounds"),
    ({"model": "gough-stewart", "quantities": "contact_force"}, "needs contacts"),
    ({"model": "gough-stewart", "quantities": "speed"}, "speed_limit"),
    ({"model": "gough-stewart", "quantities": "load_limit", "direction": "0,0,1"},
     "efforts with limits"),
]  # fmt: skip


def test_one_clear_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(compute, "fill", lambda *_: pytest.fail("it began to work"))
    for given, words in WRONG:
        machine = given.get("model", "masticatory")
        asked = {"over": X, **given, "model": machine if machine == 3 else model(machine)}
        with pytest.raises(condyle.InputError, match=words) as caught:
            condyle.workspace_map(**asked)
        assert "\n" not in str(caught.value), given
    over = ["X=-6:14:100000 mm", "beta=-15:35:100000 deg"]
    with pytest.raises(condyle.InputError, match=r"takes .* GiB, and .* GiB are free"):
        condyle.workspace_map(model("masticatory"), over, out=tmp_path / "a.nc")
    assert [*tmp_path.iterdir()] == []


def test_units_and_si_are_the_same() -> None:
    given = (["X=-5:5:3 mm", "beta=0:90:2 deg"], "Y = 1 mm")
    si = ({"X": (-5e-3, 5e-3, 3), "beta": (0, 1.5707963267948966, 2)}, {"Y": 1e-3})
    robot = model("masticatory")
    text, plain = (condyle.workspace_map(robot, over, hold=hold) for over, hold in (given, si))
    assert text.equals(plain) and text.attrs["held"] == plain.attrs["held"]


def test_the_file_is_the_map_whoever_computes_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """In blocks, by processes and threads: the same; what fails leaves what was there."""
    robot, place = model("masticatory"), tmp_path / "a.nc"
    right = condyle.workspace_map(robot, OVER, QUANTITIES, out=tmp_path / "a")
    assert {"ratio", "kind", "status", "cause", "effort"} <= set(right)
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]
    xr.testing.assert_identical(condyle.open_map(place), right)
    monkeypatch.setattr(compute, "BLOCK", 16)
    for how in ({}, *({"workers": 2, "scheduler": s} for s in ("processes", "threads"))):
        xr.testing.assert_identical(condyle.workspace_map(robot, OVER, QUANTITIES, **how), right)
    blocks, own = iter(range(3)), compute.Block

    def failing(*args: object) -> object:
        if next(blocks) == 2:
            raise KeyboardInterrupt
        return own(*args)

    monkeypatch.setattr(compute, "Block", failing)
    with pytest.raises(KeyboardInterrupt):
        condyle.workspace_map(robot, OVER, "ratio", out=place)
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]
    xr.testing.assert_identical(condyle.open_map(place), right)
