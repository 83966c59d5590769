"""The gate of arrays: by name where they have names, converted where they have units, and never
with what a mask hides."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
import xarray as xr
from support.machines import model

import condyle
from condyle.errors import InputError

OWN = model("masticatory")
NAMES, CHAINS = list(OWN.independent), list(OWN.mechanism.chain_names)
RNG = np.random.default_rng(6)
Q, V, A = (RNG.uniform(-size, size, (5, 4)) for size in (2e-3, 0.1, 1.0))
OTHER = RNG.permutation(4)


def frame(values: np.ndarray, names: list[str]) -> pd.DataFrame:
    return pd.DataFrame(values, columns=names)


def labelled(values: np.ndarray, *dims: str, units: str = "", **names: Any) -> xr.DataArray:
    return xr.DataArray(values, names, dims, attrs={"units": units} if units else {})


# What stands for Q.
LABELLED = {
    "columns": frame(Q, NAMES),
    "columns in another order": frame(Q, NAMES).iloc[:, OTHER],
    "columns that are numbered": pd.DataFrame(Q),
    "a table of pyarrow": pa.table({NAMES[i]: Q[:, i] for i in OTHER}),
    "rows of a frame": [frame(Q, NAMES).iloc[i, OTHER] for i in range(5)],
    "a coordinate": labelled(
        Q[:, OTHER], "t", "independent", independent=np.array(NAMES)[OTHER]
    ),
    "entries first": labelled(Q.T, "coordinate", "time", coordinate=NAMES),
    "entries first, without labels": labelled(Q.T, "coordinate", "time"),
    "units in words": labelled(1e3 * Q, "t", "q", units="mm, mm, mrad, mrad"),
    "nothing masked": np.ma.masked_array(Q),
    "lists": Q.tolist(),
}  # fmt: skip


@pytest.mark.parametrize("given", LABELLED.values(), ids=LABELLED)
def test_entries_are_found_by_name(given: Any) -> None:
    found, right = (OWN.inverse_dynamics(q, V, A).effort for q in (given, Q))
    np.testing.assert_allclose(found, right, rtol=1e-12, atol=1e-14)


def test_names_of_tables_are_known() -> None:
    """Of rates, efforts, joints, loads: as columns of CSV have them."""
    rates, second = ([d + n for n in NAMES] for d in ("d", "dd"))
    wrench = RNG.normal(size=(5, 6))
    load = frame(wrench, ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]).iloc[:, ::-1]
    right = OWN.inverse_dynamics(Q, V, A, wrench)
    states = frame(V, rates).iloc[:, OTHER], frame(A, second).iloc[:, OTHER]
    assert np.allclose(OWN.inverse_dynamics(Q, *states, load).effort, right.effort, rtol=1e-12)
    for names in (CHAINS, [f"tau_{chain}" for chain in CHAINS]):
        effort = frame(right.effort, names).iloc[:, ::-1]
        back = OWN.forward_dynamics(Q, V, effort, wrench).acceleration
        np.testing.assert_allclose(back, A, rtol=1e-6, atol=1e-8)
    joint = labelled(OWN.inverse_kinematics(Q).joint, "time", "chain", chain=CHAINS)
    back = OWN.forward_kinematics(joint.isel(chain=[3, 1, 0, 2, 5, 4])).q
    np.testing.assert_allclose(back, Q, atol=1e-9)
    t = np.linspace(0, 1, 8)
    path = frame(np.column_stack([3 * t, t, 2 * t]), ["z", "x", "y"])
    motion = condyle.Motion.from_arrays(t, path, names=["x", "y", "z"])
    assert motion.value[-1] == pytest.approx([1, 2, 3])
    of_load = condyle.Load.from_arrays(t[:5], load)
    np.testing.assert_array_equal(of_load.wrench, wrench)


def refused(q: Any) -> None:
    OWN.inverse_dynamics(q, V, A)


masked = np.ma.masked_array(Q, np.eye(5, 4, dtype=bool))
REFUSED: dict[str, tuple[Callable[[Any], object], Any, str]] = {
    "a mask": (refused, masked, r"q: 4 of its 20 numbers are masked.*\.filled"),
    "masked rows": (refused, list(masked), "q: 1 of its 4 numbers are masked"),
    "a missing name": (refused, frame(Q[:, :3], NAMES[:3]), 'got numbers of "X", .*expected X, Y'),
    "one too many": (refused, frame(V, [*NAMES[:3], "gamma"]), '"gamma"; expected X, Y'),
    "a name twice": (refused, frame(Q, ["X", "X", "alpha", "beta"]), '"X", "X"'),
    "wrong units": (refused, labelled(Q, "t", "q", units="kg"), "in 'kg'; expected.*m, rad"),
    "a masked direction": (
        lambda x: condyle.largest_bite("human-jaw", direction=x), masked[0, :3], "direction: 1 of",
    ),
    "masked samples": (
        lambda x: condyle.Motion.from_arrays(np.arange(5.0), {"x": x, "y": x, "z": x}),
        masked[:, 0], '"x": 1 of its 5 numbers are masked',
    ),
    "masked variants": (
        lambda x: OWN.variants({"platform.mass": x}), np.ma.masked_less([0.1, 0.2], 0.15), "masked",
    ),
    "a number with a unit": (
        lambda x: OWN.mechanism.set("platform.mass", x),
        SimpleNamespace(units="g", tolist=lambda: 200.0), "plain numbers, in SI",
    ),
    "a list of itself": (refused, (lambda own: own.append(own) or own)([]), "expected numbers"),
}  # fmt: skip


@pytest.mark.parametrize(("call", "given", "said"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_taken_is_named(
    call: Callable[[Any], object], given: Any, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        call(given)


def test_quantities_are_converted() -> None:
    """By their own library; mixed ones as a list of quantities."""
    pint = pytest.importorskip("pint", reason="no pint here")
    unit = pint.UnitRegistry().Quantity
    mixed = [unit(1.5, "mm"), 0.0, unit(2, "deg"), unit(0.01, "rad")]
    plain = [1.5e-3, 0.0, np.radians(2), 0.01]
    kinematics = OWN.inverse_kinematics
    np.testing.assert_allclose(kinematics(mixed).pose, kinematics(plain).pose, rtol=1e-14)
    joint = kinematics(Q).joint
    turned = OWN.forward_kinematics(unit(np.degrees(joint), "deg")).q
    np.testing.assert_allclose(turned, Q, atol=1e-9)
    g = unit(np.array([0.0, 0.0, -981.0]), "cm/s^2")
    found, right = (OWN.inverse_dynamics(Q, V, A, gravity=x).effort for x in (g, [0, 0, -9.81]))
    np.testing.assert_allclose(found, right, rtol=1e-14)
    t = np.linspace(0, 1, 8)
    path = {"x": unit(t, "mm"), "y": 0 * t, "z": 0 * t}
    motion = condyle.Motion.from_arrays(unit(1e3 * t, "ms"), path)
    assert motion.t[-1] == 1.0 and motion.value[-1] == pytest.approx([1e-3, 0, 0])
    for call, said in (
        (lambda: refused(unit(Q, "mm")), "'millimeter'; expected numbers in m, rad"),
        (lambda: OWN.inverse_dynamics(Q, V, A, gravity=unit(np.ones(3), "kg")), "expected.*m/s"),
        (lambda: condyle.Motion.from_arrays(t, path, units="mm"), "numbers without a unit"),
    ):
        with pytest.raises(InputError, match=said):
            call()
