"""Constants in a structure: a number changed there is that number changed in the file."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.families import case
from support.tools import run

import condyle
from condyle.backends.numpy_kernel import NumpyKernel
from condyle.export import export
from condyle.export.c_package import FLAGS
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


@pytest.mark.slow
@pytest.mark.parametrize("name", ["masticatory", "mixed", "k0"])
def test_each_number_changed_is_that_of_the_file(name: str, tmp_path: Path) -> None:
    """Of every family, with losses and friction: efforts after `prepare` are the changed file's."""
    nominal = mechanism(name)
    e = export(nominal, ("contact",), constants="struct", prefix="arm")
    (tmp_path / "arm.h").write_text(e.header)
    begin = "\nvoid arm_begin(arm_numbers *n) { arm_numbers of = ARM_NUMBERS; *n = of; }\n"
    sizes = "int arm_size(void) { return sizeof(arm_constants); }\n"
    (tmp_path / "arm.c").write_text(e.source + begin + sizes)
    run("gcc", *FLAGS, "-shared", "-fPIC", "arm.c", "-o", "arm.so", "-lm", folder=tmp_path)
    library = ctypes.CDLL(str(tmp_path / "arm.so"))
    paths = dict(fields(e.header, nominal))
    numbers, constants = np.zeros(max(paths.values()) + 1), np.zeros(library.arm_size() // 8)
    library.arm_begin(numbers.ctypes.data_as(ctypes.c_void_p))
    states = dict(zip(("q", "q1", "q2"), STATE[:, : nominal.degrees_of_freedom], strict=True))
    states = {key: np.ascontiguousarray(values) for key, values in states.items()}
    structure = replace(structure_of(nominal), parallel=False)
    kernel = NumpyKernel(
        Question.about(structure, "inverse", ("contact",)).variants(),
        numbers_of(structure, nominal),
    )
    ports, chains = kernel.interface.ports, nominal.chains
    one_each = {next(c.name for c in chains if c.kind == kind) for kind in {c.kind for c in chains}}
    for path, at in paths.items():
        if not path or (path.startswith("chain.") and path.split(".")[1] not in one_each):
            continue
        old = float(numbers[at])
        assert old == pytest.approx(nominal.get(path), abs=1e-15), path
        new = old + (2e-6 if path.startswith("contact.") else 1e-3 * abs(old) or 1e-6)
        given = {a.name: np.zeros(a.size) for a in e["contact"].arguments} | states
        numbers[at] = new
        library.arm_prepare(*(x.ctypes.data_as(ctypes.c_void_p) for x in (numbers, constants)))
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (constants, *given.values())]
        assert library.arm_contact(*pointers) == 0, path
        numbers[at] = old
        file = numbers_of(structure, changed(nominal, path, new - old))
        asked = {k: v[None] for k, v in given.items() if k in [p.name for p in ports]}
        right = kernel.renumbered(file).run(asked).values["effort"].ravel()
        np.testing.assert_allclose(
            given["effort"], right, rtol=0, atol=1e-12 * np.abs(right).max(), err_msg=path
        )
