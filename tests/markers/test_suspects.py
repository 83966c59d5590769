"""Which marker of a frame is the odd one out."""

from __future__ import annotations

import numpy as np
import pytest

from condyle.markers.marker_checks import outlier

SHAPE = np.array([[80, 30, 20], [50, 45, 25], [82, -28, 22], [48, -44, 35.0]]) * 1e-3


@pytest.mark.parametrize("odd", range(4))
def test_the_odd_one_is_the_one_without_which_the_others_fit_best(odd: int) -> None:
    """Also where the limit is so wide that without others the rest would be within it too."""
    points = SHAPE + np.array([0.3, -0.2, 1.0])
    points[odd] += [0.004, 0.008, -0.008]
    found = outlier(SHAPE, points, within=0.05)
    assert found is not None and found[0] == odd
    assert found[1] == pytest.approx(0.012, rel=1e-9)


def test_three_markers_do_not_tell() -> None:
    points = SHAPE.copy()
    points[0] += 0.02
    points[3] = np.nan
    assert outlier(SHAPE, points, within=2e-3) is None
