import math

import pytest

from condyle.errors import InputError
from condyle.motion.column_units import Units, parse_units


@pytest.mark.parametrize(
    ("text", "length", "angle"),
    [
        ("m,rad", 1, 1),
        ("mm,deg", 1e-3, math.pi / 180),
        (" deg , cm ", 1e-2, math.pi / 180),
        ("mm", 1e-3, 1),
        ("deg", 1, math.pi / 180),
    ],
)
def test_units_are_read_in_either_order(text, length, angle):
    assert parse_units(text) == Units(length, angle)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mm,degs", '"degs" is not a unit. Did you mean "deg"'),
        ("mm,cm", "two units of length"),
        ("deg,rad", "two units of angle"),
        ("", '"" is not a unit'),
    ],
)
def test_other_units_are_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_units(text)


def test_lengths_and_angles_scale_with_their_rates_and_all_else_stays():
    units = Units(2.0, 3.0)
    lengths = ["X", "Y", "Z", "x", "y", "z", "dX", "ddZ", "dx"]
    angles = ["alpha", "beta", "gamma", "dalpha", "ddgamma"]
    assert {units.scale(name) for name in lengths} == {2.0}
    assert {units.scale(name) for name in angles} == {3.0}
    assert {units.scale(name) for name in ["t", "Fx", "Mz"]} == {1.0}
