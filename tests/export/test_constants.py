"""Constants in a structure: a number changed there is that number changed in the file."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.families import case, close
from support.tools import run

import condyle
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.export import Exported, export
from condyle.questions import Question
from condyle.questions.file_numbers import numbers_of
from condyle.questions.structure import structure_of

BODIES = ["crank", "coupler", "slider", "rod", "cylinder", "piston", "actuator"]
STATE = 0.002 * np.array(
    [[1, -2, 1.5, 3, -2, 1], [20, 10, -15, 30, 20, 10], [9, 8, -7, 60, 5, 40.0]]
)


def mechanism(name: str) -> condyle.Mechanism:
    """One with losses and, where it has contacts, friction; or a bundled one."""
    if name in condyle.bundled_mechanisms():
        return condyle.load_mechanism(name)
    found = case(name).mechanism
    losses = {"rotor_inertia": 1e-5, "gear": 3.0, "viscous": 0.02, "coulomb": 0.03}
    changes: dict[str, object] = {
        f"chain.{chain.name}.actuator.{key}": value
        for chain in found.chains
        for key, value in (losses | {"smoothing_speed": 2e-3}).items()
    }
    if found.contacts:
        one = found.contacts[0].name
        changes[f"contact.{one}.friction"] = {"coefficient": 0.1, "smoothing_speed": 2e-3}
    return found.set(changes)


def fields(header: str, of: condyle.Mechanism) -> Iterator[tuple[str, int]]:
    """Paths of the file and the place of each in the structure, a double each."""
    text = (
        re.sub(r"/\*.*?\*/", "", header).partition("typedef struct {")[2].partition("_numbers;")[0]
    )
    at = 0
    shared, *groups = text.split("struct {")
    for name, size in re.findall(r"double (\w+)(?:\[(\d+)\])?;", shared):
        for i in range(int(size or 1)):
            yield shared_path(name, i, of, bool(size)), at
            at += 1
    for group in groups:
        kind = re.search(r"\} (\w+)\[", group)[1]  # type: ignore[index]
        for chain in (chain for chain in of.chains if chain.kind == kind):
            for name, size in re.findall(r"double (\w+)(?:\[(\d+)\])?;", group):
                head, _, key = name.partition("_")
                path = f"{head}.{key}" if head in BODIES and name != "crank_tip" else name
                path = path.replace("joint", "platform")
                for i in range(int(size or 1)):
                    yield f"chain.{chain.name}.{path}" + (f"[{i}]" if size else ""), at
                    at += 1


def shared_path(name: str, i: int, of: condyle.Mechanism, several: bool) -> str:
    kind, _, number = name.rpartition("_")
    if name == "inertia":
        return f"platform.inertia.{('xx', 'yy', 'zz', 'xy', 'xz', 'yz')[i]}"
    if not kind:
        return {"gravity": f"gravity[{i}]", "mass": "platform.mass"}.get(name, "")
    contact = f"contact.{of.contacts[int(number)].name}"
    if kind == "contact_surface":
        return f"{contact}.surface." + ("slope[0]", "slope[1]", "offset")[i]
    if kind == "friction":
        return f"{contact}.friction.{('coefficient', 'smoothing_speed')[i]}"
    return f"{contact}.point[{i}]"


def changed(of: object, path: str, by: float) -> object:
    """A copy with one number moved; nothing is checked again."""
    head, _, rest = path.partition(".")
    name, _, index = head.rstrip("]").partition("[")
    old = getattr(of, name if name not in ("chain", "contact") else f"{name}s")
    if name in ("chain", "contact"):
        own, _, rest = rest.partition(".")
        new = tuple(changed(one, rest, by) if one.name == own else one for one in old)
        return of.model_copy(update={f"{name}s": new})  # type: ignore[attr-defined]
    if rest:
        new = changed(old, rest, by)
    elif index:
        new = tuple(x + by * (i == int(index)) for i, x in enumerate(old))
    else:
        new = old + by
    return of.model_copy(update={name: new})  # type: ignore[attr-defined]


class Arm:
    """The code of an export, its numbers, and calls with constants prepared from these."""

    def __init__(self, e: Exported, folder: Path) -> None:
        (folder / "arm.h").write_text(e.header)
        begin = "\nvoid arm_begin(arm_numbers *n) { arm_numbers of = ARM_NUMBERS; *n = of; }\n"
        sizes = "int arm_size(int k) { return k ? sizeof(arm_constants) : sizeof(arm_numbers); }\n"
        (folder / "arm.c").write_text(e.source + begin + sizes)
        flags = ("-std=c99", "-O0", "-shared", "-fPIC")
        run("gcc", *flags, "arm.c", "-o", "arm.so", "-lm", folder=folder)
        self.library, self.exported = ctypes.CDLL(str(folder / "arm.so")), e
        self.numbers, self.constants = (np.zeros(self.library.arm_size(k) // 8) for k in (0, 1))
        self.library.arm_begin(self.numbers.ctypes.data_as(ctypes.c_void_p))

    def effort(self, **states: np.ndarray) -> np.ndarray:
        (f,) = self.exported.functions
        given = {a.name: np.zeros(a.size) for a in f.arguments} | states
        arrays = (self.numbers, self.constants, *given.values())
        at = [a.ctypes.data_as(ctypes.c_void_p) for a in arrays]
        self.library.arm_prepare(*at[:2])
        assert getattr(self.library, f.name)(*at[1:]) == 0
        return given["effort"]


@pytest.mark.parametrize("name", ["masticatory", "mixed", pytest.param("k0", marks=pytest.mark.ci)])
def test_each_number_changed_is_that_of_the_file(name: str, tmp_path: Path) -> None:
    """Of every family, with losses and friction: efforts after `prepare` are the changed file's."""
    nominal = mechanism(name)
    arm = Arm(export(nominal, ("contact",), constants="struct", prefix="arm"), tmp_path)
    paths = dict(fields(arm.exported.header, nominal))
    assert len(arm.numbers) == max(paths.values()) + 1
    states = dict(zip(("q", "q1", "q2"), STATE[:, : nominal.degrees_of_freedom], strict=True))
    states = {key: np.ascontiguousarray(values) for key, values in states.items()}
    structure = replace(structure_of(nominal), parallel=False)
    variants = Question.about(structure, "inverse", ("contact",)).variants()
    kernel = NumpyKernel(variants, numbers_of(structure, nominal))
    zeros = {p.name: np.zeros((1, p.size)) for p in kernel.interface.ports}
    inputs: dict[str, Any] = zeros | {key: x[None] for key, x in states.items()}
    chains = nominal.chains
    one_each = {next(c.name for c in chains if c.kind == kind) for kind in {c.kind for c in chains}}
    for path, at in paths.items():
        if not path or (path.startswith("chain.") and path.split(".")[1] not in one_each):
            continue
        old = float(arm.numbers[at])
        assert old == pytest.approx(nominal.get(path), abs=1e-15), path
        arm.numbers[at] = old + (2e-6 if path.startswith("contact.") else 1e-3 * abs(old) or 1e-6)
        file = numbers_of(structure, changed(nominal, path, arm.numbers[at] - old))
        right = kernel.renumbered(file).run(inputs).values["effort"].ravel()
        close(arm.effort(**states), right, 1e-12)
        arm.numbers[at] = old


def test_a_calibrated_mechanism_is_the_same_code_with_other_numbers(tmp_path: Path) -> None:
    nominal = condyle.load_mechanism("gough-stewart")
    calibrated = nominal.set(
        {"chain.leg_3.platform": np.add(nominal.chains[2].platform, 1e-3).tolist()}
    )
    one, other = (
        export(m, ("inverse",), constants="struct", prefix="arm") for m in (nominal, calibrated)
    )
    assert one.source == other.source and one.header != other.header
    q, zero = np.array([0.01, 0.02, 0.01, 0.1, 0.2, 0.1]), np.zeros(6)
    first, right = (
        condyle.derive(m, backend="numpy").inverse_dynamics(q, zero, zero).effort
        for m in (nominal, calibrated)
    )
    close(Arm(other, tmp_path).effort(q=q), right, 1e-12)
    assert np.abs(right - first).max() > 1e-4 * np.abs(first).max()
