"""Variants judged together: statuses and numbers are those of `mechanism.set`, one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.file_paths import machine_of, one_each

from condyle.errors import CondyleError
from condyle.mechanism import Mechanism
from condyle.questions.file_numbers import numbers_of
from condyle.questions.structure import structure_of
from condyle.questions.variant_numbers import variant_numbers
from condyle.status import Status

COUNT = 60


def alone(machine: Mechanism, changes: dict[str, Any], keep: str) -> Mechanism | Status:
    """One variant, or the status that it is refused with."""
    try:
        return machine.set(changes, keep=keep)
    except CondyleError as error:
        problems = getattr(error, "problems", [""])
        held = all(one.startswith(("contact: ", "dependent: ")) for one in problems)
        return Status.singular if held else Status.refused


def compare(machine: Mechanism, table: dict[str, np.ndarray], keep: str, backend: str) -> list[int]:
    """Statuses of variants, which agree; those in doubt may have any."""
    structure = structure_of(machine)
    found = variant_numbers(machine, structure, table, keep, backend)
    assert (np.flatnonzero(found.status == 255) == found.doubt).all()
    for i, status in enumerate(found.status):
        made = alone(machine, {path: v[i].tolist() for path, v in table.items()}, keep)
        if i in found.doubt:
            continue
        assert status == (0 if isinstance(made, Mechanism) else made)
        if isinstance(made, Mechanism):
            wanted, got = numbers_of(structure, made), found.numbers.single(i)
            for a, b in zip(
                (wanted.parameters, *wanted.lanes, *wanted.padding),
                (got.parameters, *got.lanes, *got.padding),
                strict=True,
            ):
                np.testing.assert_allclose(b, a, rtol=0, atol=1e-12 * np.abs(a).max())
    return found.status.tolist()


@pytest.mark.parametrize(
    ("name", "backend"),
    [
        ("masticatory", "numpy"),
        pytest.param("masticatory", "compiled", marks=pytest.mark.slow),
        pytest.param("every_family", "numpy", marks=pytest.mark.slow),
        pytest.param("every_kind", "numpy", marks=pytest.mark.ci),
        pytest.param("balls", "numpy", marks=pytest.mark.ci),
    ],
)
def test_hundreds_of_random_variants(name: str, backend: str) -> None:
    machine, rng = machine_of(name), np.random.default_rng(len(name))
    statuses, paths = [], one_each(machine)
    for turn in range(3):
        table = {}
        for path in rng.choice(paths, size=6, replace=False):
            value = np.asarray(machine.get(path), dtype=float)
            step = 10 ** rng.uniform(-5, 0, (COUNT, *(1,) * value.ndim))
            step = step * (np.abs(value).max() or 1e-3) * (rng.random(step.shape) < 0.3)
            table[path] = value + step * rng.standard_normal((COUNT, *value.shape))
        statuses += compare(machine, table, ("home", "all")[turn % 2], backend)
    assert statuses.count(0) > 60
    assert statuses.count(255) < 10


def test_every_reason() -> None:
    """One variant is none, one is refused for each reason that there is."""
    jaw = machine_of("masticatory")
    left, right = (f"contact.{name}" for name in jaw.contact_names)
    first = f"chain.{jaw.chain_names[0]}"
    jaw = jaw.set(f"{first}.crank.mass", 0.1)
    xx, yy, zz = (jaw.get(f"platform.inertia.{key}") for key in ("xx", "yy", "zz"))
    tip, base = (np.array(jaw.get(f"{first}.{key}")) for key in ("crank_tip", "base"))
    axis = np.array(jaw.get(f"{first}.axis"))
    along = axis + 0.05 * np.linalg.norm(axis) * (tip - base) / np.linalg.norm(tip - base)
    bad: dict[str, tuple[Any, int]] = {
        "platform.mass": (-0.1, Status.refused),
        "platform.inertia.zz": (xx + yy + zz, Status.refused),
        "platform.inertia.xy": (2 * max(xx, yy), Status.refused),
        "gravity": ((0.0, np.nan, -9.81), Status.refused),
        f"{first}.crank.inertia": (0.0, Status.refused),
        f"{first}.coupler.com": (1.01, Status.refused),
        "platform.com": ((0.0, np.nan, 0.0), Status.refused),
        f"{first}.crank.com": (0.5, Status.refused),
        f"{first}.coupler.axial": (1.0, Status.refused),
        f"{first}.coupler.transverse": (1e-19, Status.refused),
        f"{first}.axis": (along, Status.refused),
        f"{first}.base": (tip, Status.refused),
        f"{first}.platform": (tip, Status.refused),
        f"{first}.actuator.gear": (np.inf, Status.refused),
        f"{left}.friction.smoothing_speed": (0.0, Status.refused),
        f"{left}.surface.offset": (jaw.get(f"{left}.surface.offset") + 2e-5, Status.refused),
        f"{right}.point": (jaw.get(f"{left}.point"), Status.singular),
    }
    for path, (value, status) in bad.items():
        good = np.asarray(jaw.get(path), dtype=float)
        table = {path: np.stack([good, np.asarray(value, dtype=float)])}
        assert compare(jaw, table, "home", "numpy") == [0, status], path


@pytest.mark.slow
def test_balls_and_splines() -> None:
    balls, profile = machine_of("balls_round"), machine_of("balls_profile")
    [inside] = [f"contact.{c.name}" for c in balls.contacts if c.side == "inside"]
    room = balls.get(f"{inside}.surface.radius")
    table = {f"{inside}.ball_radius": np.array([0.003, 0.999 * room, room])}
    assert compare(balls, table, "home", "numpy") == [0, 0, Status.refused]
    surface = f"contact.{profile.contact_names[0]}.surface"
    points, direction = (np.array(profile.get(f"{surface}.{k}")) for k in ("points", "direction"))
    swapped = points.copy()
    swapped[[1, 2], 0] = swapped[[2, 1], 0]
    for key, good, bad in (("points", points, swapped), ("direction", direction, (1.0, 0.01))):
        table = {f"{surface}.{key}": np.stack([good, bad])}
        assert compare(profile, table, "home", "numpy") == [0, Status.refused]
    ball = next(c.name for c in profile.contacts if c.ball_radius is not None)
    table = {f"contact.{ball}.ball_radius": np.geomspace(0.001, 0.3, 40)}
    assert 0 in compare(profile, table, "home", "numpy")
