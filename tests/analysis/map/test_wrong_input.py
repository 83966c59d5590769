"""What cannot be mapped is refused in one line, before any work."""

from __future__ import annotations

from typing import Any

import pytest

import condyle
from condyle.analysis.map import compute

from .conftest import Models

X = "X=-5:5:10 mm"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"over": []}, "one to three coordinates, got 0"),
        ({"over": [X, "Y=0:1:3", "alpha=0:1:3", "beta=0:1:3"]}, "got 4"),
        ({"over": "Q=0:1:3"}, '"Q" is not a coordinate'),
        ({"over": "betta=0:1:3"}, 'Did you mean "beta"'),
        ({"over": "Z=0:1:3 mm"}, "Z is determined by the contacts"),
        ({"over": "X=5:-5:10 mm"}, "must be increasing"),
        ({"over": "X=5:5:10 mm"}, "must be increasing"),
        ({"over": "X=-5:5:10 deg"}, '"deg" is not a unit of length'),
        ({"over": "beta=-5:5:10 mm"}, '"mm" is not a unit of angle'),
        ({"over": "X=-5:5:1 mm"}, "count of at least 2"),
        ({"over": "X=-5:5:2.5 mm"}, "count of at least 2"),
        ({"over": "X=-5:5:ten mm"}, "'ten' is not a number"),
        ({"over": "X=-5:inf:9 mm"}, "finite number"),
        ({"over": "X=-5..5"}, "expected name=low:high:count unit"),
        ({"over": [X, X]}, "twice"),
        ({"over": ["X=0:1:1e6", "Y=0:1:1e6"]}, "maximum is 1e\\+10"),
        ({"over": {"X": (0, 1)}}, r"expected \(low, high, count\)"),
        ({"hold": "X=1 mm"}, "X is an axis of the map too"),
        ({"hold": "gamma=1 deg"}, "gamma is determined by the contacts"),
        ({"hold": "Y=1 deg"}, '"deg" is not a unit of length'),
        ({"hold": "Y=1 mm,Y=2 mm"}, "given twice"),
        ({"hold": "Y"}, "expected name=value unit"),
        ({"hold": "W=1"}, 'hold: there is no "W"'),
        ({"quantities": "ratoi"}, 'no quantity "ratoi".* Did you mean "ratio"'),
        ({"quantities": "load_limit"}, "--direction"),
        ({"quantities": "stiffness"}, "--stiffness"),
        ({"quantities": "load_limit", "direction": "0,0"}, "expected three numbers"),
        ({"quantities": "load_limit", "direction": "0,0,0"}, "expected a length"),
        ({"quantities": "stiffness", "stiffness": -1.0}, "above 0"),
        ({"quantities": "stiffness", "stiffness": {"nobody": 1.0}}, 'no chain "nobody"'),
        ({"quantities": "stiffness", "stiffness": {"masseter_left": 1.0}}, "have none"),
        ({"load": "Fz=-50 mm"}, '"mm" is not a unit of force'),
        ({"load": "Fq=-50"}, 'load: there is no "Fq"'),
        ({"load": "Fz=-50", "load_point": "toe"}, "toe"),
        ({"stroke": "leg_*=-1:1"}, 'no chain is called "leg_\\*"'),
        ({"stroke": "masseter_*=1:2 rad"}, "range about home"),
        ({"stroke": "masseter_*=-1:2 mm"}, '"mm" is not a unit of angle'),
        ({"stroke": "masseter_*"}, "expected chain=low:high unit"),
        ({"over": 3}, "over: expected a name or several, got 3"),
        ({"hold": 3}, "expected text such as"),
        ({"load": [1.0, 2.0]}, "expected text such as"),
        ({"quantities": 3}, "quantities: expected a name or several, got 3"),
        ({"quantities": "stiffness", "stiffness": "stiff"}, "is not a number"),
        ({"quantities": "load_limit", "direction": 3}, "direction"),
        ({"load_point": 3}, "3"),
        ({"stroke": 3}, "stroke"),
        ({"out": 3}, "out: expected the path of a file, got 3"),
        ({"threads": "two"}, "threads"),
        ({"scheduler": 3}, "scheduler"),
        ({"model": 3}, "model: expected a model"),
    ],
)
def test_one_clear_line(
    model_of: Models, monkeypatch: pytest.MonkeyPatch, arguments: dict[str, Any], words: str
) -> None:
    monkeypatch.setattr(compute, "fill", lambda *_: pytest.fail("it began to work"))
    with pytest.raises(condyle.InputError, match=words) as caught:
        condyle.workspace_map(**{"model": model_of("masticatory"), "over": X} | arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "quantity", "words"),
    [
        ("gough-stewart", "bounds", "contacts with bounds"),
        ("gough-stewart", "contact_force", "needs contacts"),
        ("gough-stewart", "speed", "speed_limit"),
        ("gough-stewart", "load_limit", "efforts with limits"),
    ],
)
def test_what_a_mechanism_has_not(model_of: Models, name: str, quantity: str, words: str) -> None:
    with pytest.raises(condyle.InputError, match=words):
        condyle.workspace_map(model_of(name), "X=0:1:3", quantity, direction="0,0,1")


def test_units_and_si_are_the_same(model_of: Models) -> None:
    model = model_of("masticatory")
    text = condyle.workspace_map(model, ["X=-5:5:3 mm", "beta=0:90:2 deg"], hold="Y = 1 mm")
    plain = condyle.workspace_map(
        model, {"X": (-5e-3, 5e-3, 3), "beta": (0, 1.5707963267948966, 2)}, hold={"Y": 1e-3}
    )
    assert text.equals(plain) and text.attrs["held"] == plain.attrs["held"]
