"""Numbers of the file by their paths, and the kernel's numbers' derivatives in them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.file_paths import SURFACES, machine_of, numbers, one_each, wide

import condyle
from condyle.errors import InputError
from condyle.mechanism import Mechanism
from condyle.questions.file_numbers import numbers_of
from condyle.questions.number_paths import number_jacobian
from condyle.questions.numbers import Layout
from condyle.questions.structure import Structure, smooth_forms, walls_of
from condyle.status import Status

CARRIERS = ("surface.offset", "surface.centre", "surface.point", "surface.points")


def flat(structure: Structure, mechanism: Mechanism) -> np.ndarray:
    found = numbers_of(structure, mechanism)
    return np.concatenate([found.parameters.ravel(), *(lane.ravel() for lane in found.lanes)])


def test_where_numbers_stand() -> None:
    jaw = condyle.load_mechanism("masticatory")
    paths = ["platform.mass", "platform.inertia", "chain[0].base", "chain.*.actuator.viscous"]
    one, inertia, base, viscous, entry = numbers(jaw).at(
        [*paths, f"chain.{jaw.chain_names[2]}.crank_tip[2]"]
    )
    layout = Layout.of_file(wide(jaw), walls_of(jaw, wide(jaw)))
    assert (one.unit, one.shape, one.size) == ("kg", (), 1)
    assert one.slots == ((-1, layout.parameters["mass"][0], 0),)
    assert inertia.shape == (6,) and base.shape == (3,) and entry.shape == ()
    assert [slot[2] for slot in base.slots] == [0, 0, 0] and entry.slots[0][2] == 2
    assert viscous.shape == (6,) and viscous.unit == "N m s/rad"
    assert [slot[2] for slot in viscous.slots] == list(range(6))


def test_refusals() -> None:
    jaw = condyle.load_mechanism("masticatory")
    for path, text in {
        "platform.weight": 'has no "weight"',
        "platform.points": "no such number. Available: gravity, platform.mass",
        "chain.*.actuator.torque_limit": "it has no such number",
        "contact[0].ball_radius": "left out, and has no default",
        "chain[0].name": "expected a number or vector",
    }.items():
        with pytest.raises(InputError, match=text):
            numbers(jaw).at([path])
    with pytest.raises(InputError, match=r"shares numbers with chain\.\*\.base"):
        numbers(jaw).at(["chain.*.base", "chain[1].base[0]"])
    with pytest.raises(InputError, match='keep: expected "home" or "all"'):
        number_jacobian(jaw, wide(jaw), ["platform.mass"], "none")


def differences(
    machine: Mechanism, structure: Structure, path: str, keep: str
) -> tuple[np.ndarray, np.ndarray]:
    """d (numbers of the kernel) / d (numbers at a path), by differences of fourth order.

    Returns: also what rounding makes of them.
    """
    value = np.asarray(machine.get(path), dtype=float)
    h = 3e-5 * (float(np.abs(value).max()) or 1e-3)
    if path.endswith("direction"):
        h = 2e-7  # its length is checked, and does not matter
    if keep == "all":
        h = min(h, 5e-7)  # home stays within what is accepted
    columns = []
    for i in range(value.size):
        total: Any = 0.0
        for step, weight in ((1, 2 / 3), (-1, -2 / 3), (2, -1 / 12), (-2, 1 / 12)):
            new = value.copy()
            new.flat[i] += step * h
            moved = flat(structure, machine.set(path, new.tolist(), keep=keep))
            total = total + weight * moved / h
        columns.append(total)
    size = np.abs(flat(structure, machine))
    for name, (start, count) in Layout.of(structure).parameters.items():
        if "surface" in name:  # a spline's coefficients are third differences
            size[start : start + count] += 3e5 if count > 30 else 0.0
    return np.stack(columns, axis=1), 1e-15 * size[:, None] / h


@pytest.mark.parametrize(
    "name",
    [
        "gough-stewart",
        pytest.param("every_family", marks=pytest.mark.slow),
        pytest.param("balls_round", marks=pytest.mark.slow),
        *(pytest.param(name, marks=pytest.mark.ci) for name in SURFACES if name != "balls_round"),
    ],
)
def test_derivatives_of_the_kernels_numbers(name: str) -> None:
    machine = machine_of(name)
    structure = wide(machine)
    only = "contact" if name in SURFACES else ""  # their chains are those of every family
    for path in (one for one in one_each(machine) if one.startswith(only)):
        keep = "all" if path.endswith(CARRIERS) else "home"
        got = number_jacobian(machine, structure, [path])
        want, noise = differences(machine, structure, path, keep)
        off = np.abs(got - want) - noise
        worst, largest = float(off.max()), float(np.abs(want).max())
        assert worst <= 1e-9 * max(1.0, largest), path


def test_a_round_paraboloid() -> None:
    """A ball on one has no principal axes to differentiate: its general form has derivatives."""
    machine = condyle.load_mechanism("masticatory-curved")
    name = machine.contact_names[0]
    at = f"contact.{name}"
    round_one = {f"{at}.surface.xx": 3.0, f"{at}.surface.yy": 3.0, f"{at}.surface.xy": 0.0}
    machine = machine.set(round_one, keep="home")
    machine = machine.set({f"{at}.ball_radius": 0.004, f"{at}.side": "below"}, keep="home")
    plain = wide(machine)
    assert plain.contacts[0][0] == "parallel-quadric"
    structure = replace(plain, contacts=smooth_forms(machine))
    for key in ("xy", "xx"):
        path = f"{at}.surface.{key}"
        got = number_jacobian(machine, structure, [path])
        want, noise = differences(machine, structure, path, "home")
        assert (np.abs(got - want) - noise).max() <= 1e-9 * np.abs(want).max()


def test_all_else_held() -> None:
    """A point alone moves nothing of its surface, and an offset among those changed stays."""
    machine = machine_of("masticatory")
    name, structure = machine.contact_names[0], wide(machine)
    at = Layout.of(structure).parameters["contact_surface_0"][0] + 2
    point, offset = f"contact.{name}.point", f"contact.{name}.surface.offset"
    assert not number_jacobian(machine, structure, [point], keep="all")[at].any()
    slope = np.array(machine.contacts[0].surface.slope)
    kept = number_jacobian(machine, structure, [point])[at]
    np.testing.assert_allclose(kept, [*-slope, 1.0], rtol=0, atol=1e-15)
    both = number_jacobian(machine, structure, [point, offset])[at]
    np.testing.assert_allclose(both, [0, 0, 0, 1], rtol=0, atol=1e-15)


LINES = {  # one each: of a chain's crank, and of a surface
    "bodies.py": ("inertia: Moment = ", 'guide: Mass = Field(default=1.0, description="new")'),
    "surface/plane.py": ("offset: Length", "rough: Number = 0.0"),
}
USE = """
import condyle, json
import numpy as np
from condyle.export import export
from condyle.mechanism import Mechanism
from condyle.mechanism.table_schema import schema_of
from condyle.questions.variant_numbers import variant_numbers
from condyle.questions.number_paths import FileNumbers
from condyle.questions.structure import structure_of, walls_of

machine = condyle.load_mechanism("masticatory")
crank = f"chain.{machine.chain_names[0]}.crank.guide"
plane = f"contact.{machine.contact_names[0]}.surface.rough"
moved = machine.set({crank: 2.0, plane: 0.5})
structure = structure_of(moved)
numbers = FileNumbers(moved, structure, walls_of(moved, structure))
table = {crank: np.array([1.0, -1.0, 1.0]), plane: np.array([0.1, 0.1, 2e6])}
schema = schema_of(Mechanism)["$defs"]
print(json.dumps({
    "values": [moved.get(crank), moved.get(plane)],
    "units": [path.unit for path in numbers.at([*table])],
    "status": variant_numbers(moved, structure, table, backend="numpy").status.tolist(),
    "schema": [schema["Crank"]["properties"]["guide"], schema["Plane"]["properties"]["rough"]],
    "header": export(moved, ("joints",), constants="struct").header,
}))
"""


@pytest.mark.slow
def test_a_new_key_is_one_line(tmp_path: Path) -> None:
    """It is got and set, judged where it varies, described, and a constant of exported C."""
    source = Path(condyle.__file__).parent
    shutil.copytree(source, tmp_path / "condyle", ignore=shutil.ignore_patterns("__pycache__"))
    for name, (before, line) in LINES.items():
        file = tmp_path / "condyle" / "mechanism" / name
        file.write_text(file.read_text().replace(before, f"{line}\n    {before}", 1))
    path = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", USE],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr
    found = json.loads(done.stdout)
    assert found["values"] == [2.0, 0.5] and found["units"] == ["kg", ""]
    assert found["status"] == [0, Status.refused, Status.refused]
    crank, plane = found["schema"]
    assert (crank["description"], crank["exclusiveMinimum"], plane["default"]) == ("kg, new", 0, 0)
    assert "double crank_guide; /* kg, new */" in found["header"]
    assert "slope, rough, offset [m] */" in found["header"]
