"""Constants in a structure: numbers changed there are those numbers changed in the file."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export.conftest import shared
from support.families import case, close

import condyle
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.export import export
from condyle.questions import Question
from condyle.questions.file_numbers import numbers_of
from condyle.questions.structure import structure_of

BODIES = ["crank", "coupler", "slider", "rod", "cylinder", "piston", "actuator"]
PARTS = {
    "gravity": [f"gravity[{i}]" for i in range(3)],
    "mass": ["platform.mass"],
    "inertia": [f"platform.inertia.{part}" for part in ("xx", "yy", "zz", "xy", "xz", "yz")],
    "contact_surface": ["surface.slope[0]", "surface.slope[1]", "surface.offset"],
    "contact_point": [f"point[{i}]" for i in range(3)],
    "friction": ["friction.coefficient", "friction.smoothing_speed"],
}
STATE = 0.002 * np.array(
    [[1, -2, 1.5, 3, -2, 1], [20, 10, -15, 30, 20, 10], [9, 8, -7, 60, 5, 40.0]]
)
BEGIN = """
int arm_size(int k);
int arm_size(int k) { return (int)(k ? sizeof(arm_constants) : sizeof(arm_numbers)); }
void arm_begin(arm_numbers *n);
void arm_begin(arm_numbers *n) { arm_numbers of = ARM_NUMBERS; *n = of; }
"""


def rough(name: str) -> condyle.Mechanism:
    """One with losses and, where it has contacts, friction; or a bundled one."""
    if name in condyle.bundled_mechanisms():
        return condyle.load_mechanism(name)
    found = case(name).mechanism
    losses = {"rotor_inertia": 1e-5, "gear": 3.0, "viscous": 0.02, "coulomb": 0.03}
    losses |= {"smoothing_speed": 2e-3}
    changes: dict[str, object] = {
        f"chain.{chain}.actuator.{key}": value
        for chain in found.chain_names
        for key, value in losses.items()
    }
    for one in found.contact_names[:1]:
        changes[f"contact.{one}.friction"] = {"coefficient": 0.1, "smoothing_speed": 2e-3}
    return found.set(changes)


def paths(header: str, of: condyle.Mechanism) -> Iterator[str]:
    """Where the file has each number of the structure, in its order; "" where it has it not."""
    text = re.sub(r"/\*.*?\*/", "", header)
    shared, *groups = (
        text.partition("typedef struct {")[2].partition("_numbers;")[0].split("struct {")
    )
    member = re.compile(r"double (\w+)(?:\[(\d+)\])?;")
    for name, size in member.findall(shared):
        kind, _, number = name.rpartition("_")
        owner = f"contact.{of.contact_names[int(number)]}." if number.isdigit() else ""
        parts = PARTS.get(kind if owner else name)
        yield from (owner + part for part in parts) if parts else [""] * int(size or 1)
    for group in groups:
        kind = re.search(r"\} (\w+)\[", group)[1]  # type: ignore[index]
        for chain in (chain for chain in of.chains if chain.kind == kind):
            for name, size in member.findall(group):
                head, _, key = name.partition("_")
                path = f"{head}.{key}" if head in BODIES and name != "crank_tip" else name
                path = f"chain.{chain.name}.{path.replace('joint', 'platform')}"
                yield from (f"{path}[{i}]" for i in range(int(size))) if size else [path]


def changed(of: Any, path: str, by: float) -> Any:
    """A copy with one number moved; nothing is checked again."""
    head, _, rest = path.partition(".")
    if head in ("chain", "contact"):
        own, _, rest = rest.partition(".")
        old = getattr(of, f"{head}s")
        new: Any = tuple(changed(one, rest, by) if one.name == own else one for one in old)
        return of.model_copy(update={f"{head}s": new})
    name, _, index = head.rstrip("]").partition("[")
    old = getattr(of, name)
    if rest:
        new = changed(old, rest, by)
    elif index:
        new = tuple(x + by * (i == int(index)) for i, x in enumerate(old))
    else:
        new = old + by
    return of.model_copy(update={name: new})


@pytest.mark.parametrize("name", ["masticatory", "mixed", pytest.param("k0", marks=pytest.mark.ci)])
def test_numbers_changed_are_those_of_the_file(name: str, tmp_path: Path) -> None:
    """Of every family, with losses and friction: all at once, each by a share of its own, so that
    none stands for another; the same code is that of the nominal and of the changed file."""
    nominal = rough(name)
    exported = export(nominal, ("contact",), constants="struct", prefix="arm")
    (tmp_path / "arm.h").write_text(exported.header)
    (tmp_path / "arm.c").write_text(exported.source + BEGIN)
    library = shared(tmp_path, "arm.c")
    numbers, constants = (np.zeros(library.arm_size(k) // 8) for k in (0, 1))
    library.arm_begin(numbers.ctypes.data_as(ctypes.c_void_p))
    states = dict(zip(("q", "q1", "q2"), STATE[:, : nominal.degrees_of_freedom], strict=True))

    def efforts() -> np.ndarray:
        (f,) = exported.functions
        given = {a.name: np.zeros(a.size) for a in f.arguments}
        for key, values in states.items():
            given[key][:] = values
        arrays = (numbers, constants, *given.values())
        at = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays]
        library.arm_prepare(*at[:2])
        assert getattr(library, f.name)(*at[1:]) == 0
        return given["effort"]

    structure = replace(structure_of(nominal), parallel=False)
    variants = Question.about(structure, "inverse", ("contact",)).variants()
    kernel = NumpyKernel(variants, numbers_of(structure, nominal))
    inputs: dict[str, Any] = {p.name: np.zeros((1, p.size)) for p in kernel.interface.ports}
    inputs |= {key: x[None] for key, x in states.items()}
    before, file = kernel.run(inputs).values["effort"].ravel(), nominal
    close(efforts(), before, 1e-12)
    found = list(paths(exported.header, nominal))
    assert len(found) == len(numbers)
    shares = np.random.default_rng(1).uniform(1e-4, 1e-3, len(found))
    for at, path in enumerate(found):
        if path:
            old = float(numbers[at])
            assert old == pytest.approx(nominal.get(path), abs=1e-15), path
            numbers[at] += shares[at] * (2e-3 if path.startswith("contact.") else abs(old) or 1e-3)
            file = changed(file, path, numbers[at] - old)
    after = kernel.renumbered(numbers_of(structure, file)).run(inputs).values["effort"].ravel()
    close(efforts(), after, 1e-12)
    assert np.abs(after - before).max() > 1e-5 * np.abs(before).max()


def test_a_calibrated_mechanism_is_the_same_code_with_other_numbers() -> None:
    nominal = condyle.load_mechanism("gough-stewart")
    moved = np.add(nominal.chains[2].platform, 1e-3).tolist()
    one, other = (
        export(m, ("inverse",), constants="struct", prefix="arm")
        for m in (nominal, nominal.set({"chain.leg_3.platform": moved}))
    )
    assert one.source == other.source and one.header != other.header
