"""Numbers of a mechanism file by their paths, and the kernel's numbers' derivatives in them.

A path is one as `mechanism.get` takes it: `platform.mass`, `chain.masseter_left.base[2]`,
`contact.left.surface.slope`; `chain.*.actuator.viscous` is that of every chain, one after another.
A table is its entries in the file's order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import accumulate
from typing import Any

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..errors import InputError, few
from ..graph.graph import Value
from ..graph.program import Port, Program, Programs
from ..graph.transform import tangents
from ..kinematics.chain import FAMILIES, Family
from ..mechanism.kept_home import kept_contacts
from ..mechanism.mechanism import Mechanism
from ..mechanism.paths import Path, parsed, value_at, written
from ..mechanism.surface.wall import Wall
from .file_numbers import file_numbers, numbers_of_file
from .numbers import INERTIA, Layout
from .structure import Structure, walls_of

Slot = tuple[int, int, int]  # group or -1, index, lane
ENTRIES = tuple("xyz"[i] + "xyz"[j] for i, j in INERTIA)
FRICTION = {"coefficient": "", "smoothing_speed": "m/s"}
SURFACES = {  # units of what is not in metres
    **dict.fromkeys(("slope", "direction", "axis"), ""),
    **dict.fromkeys(("xx", "xy", "yy"), "1/m"),
    "rotation": "rad",
}
PARTS: dict[str, Callable[[Mechanism], tuple[str, ...]]] = {
    "chain": lambda mechanism: mechanism.chain_names,
    "contact": lambda mechanism: mechanism.contact_names,
    "ligament": lambda mechanism: mechanism.ligament_names,
    "wall": lambda mechanism: mechanism.wall_names,
}
LIGAMENTS = {"base": "m", "platform": "m", "slack_length": "m", "damping": "N s/m"}


@dataclass(frozen=True)
class NumberPath:
    """Numbers of a mechanism file, and where they stand.

    unit:  of each, SI; empty for plain numbers.
    shape: () for one number; a path with `*` has the chains in front.
    slots: of each number, row by row: group (-1: shared), index in `Layout.of_file`, lane.
    """

    path: str
    unit: str
    shape: tuple[int, ...]
    slots: tuple[Slot, ...]

    @property
    def size(self) -> int:
        """How many numbers."""
        return math.prod(self.shape)


@dataclass(frozen=True)
class FileNumbers:
    """Where every number of a mechanism's file stands in `Layout.of_file`.

    structure: of the kernel's numbers;  walls: see `walls_of`;
    landmark: the platform's point among the numbers, if one is.
    """

    mechanism: Mechanism
    structure: Structure
    walls: tuple[Wall, ...]
    landmark: str | None = None

    def at(self, paths: Sequence[str]) -> list[NumberPath]:
        """The numbers at some paths.

        Raises: InputError: for an unknown path, one that has no number of this kernel's, or two
                that share a number.
        """
        found = [self._at(path) for path in paths]
        owner: dict[Slot, str] = {}
        for one in found:
            for slot in one.slots:
                if slot in owner:
                    raise InputError(
                        f"{one.path}: shares numbers with {owner[slot]}; give each number once"
                    )
                owner[slot] = one.path
        return found

    def _at(self, path: str) -> NumberPath:
        keys = parsed(path)
        if keys[0] in PARTS and keys[1:2] == ("*",):
            return self._of_each(path, keys)
        value, keys = value_at(self.mechanism, path), named(self.mechanism, keys)
        leaves = dict(self._leaves(keys))
        for leaf, (unit, slots) in leaves.items():
            if keys[: len(leaf)] == leaf:
                whole = np.shape(value_at(self.mechanism, written(leaf)))
                entry = tuple(int(key) for key in keys[len(leaf) :])
                at = np.arange(len(slots)).reshape(whole)[entry]
                return NumberPath(path, unit, np.shape(at), tuple(slots[i] for i in np.ravel(at)))
        inside = [leaf for leaf in leaves if leaf[:-1] == keys]
        if not inside:
            why = "it is left out, and has no default" if value is None else "it has no such number"
            raise InputError(
                f"{path}: expected a number or vector that this kernel knows; {why}. Available: "
                f"{few(written(leaf) for leaf in leaves)}"
            )
        every = tuple(slot for leaf in inside for slot in leaves[leaf][1])
        return NumberPath(path, _one(leaves[leaf][0] for leaf in inside), (len(every),), every)

    def _of_each(self, path: str, keys: Path) -> NumberPath:
        names = PARTS[str(keys[0])](self.mechanism)
        each = [self._at(written((keys[0], name, *keys[2:]))) for name in names]
        if len({one.shape for one in each}) != 1:
            sizes = few(f"{name} {one.size}" for name, one in zip(names, each, strict=True))
            raise InputError(f"{path}: expected as many numbers of each {keys[0]}, got {sizes}")
        slots = tuple(slot for one in each for slot in one.slots)
        return NumberPath(path, _one(o.unit for o in each), (len(each), *each[0].shape), slots)

    def _leaves(self, keys: Path) -> Iterator[tuple[Path, tuple[str, list[Slot]]]]:
        """Keys of numbers and vectors in the part of the mechanism that some keys are in."""
        layout = self._layout
        if keys[0] in ("gravity", "platform"):
            yield ("gravity",), ("m/s^2", self._shared("gravity"))
            yield ("platform", "mass"), ("kg", self._shared("mass"))
            yield ("platform", "com"), ("m", self._shared("com"))
            for i, name in enumerate(ENTRIES):
                yield ("platform", "inertia", name), ("kg m^2", self._shared("inertia", i, 1))
            if self.landmark is not None:
                yield ("platform", "points", self.landmark), ("m", self._shared("landmark"))
        if keys[0] == "contact" and len(keys) > 1:
            i = self.mechanism.contact_names.index(str(keys[1]))
            contact, wall, at = ("contact", keys[1]), self.walls[i], 0
            yield (*contact, "point"), ("m", self._shared(f"contact_point_{i}"))
            for name, count in wall.sizes:
                slots = self._shared(f"contact_surface_{i}", at, count)
                yield (*contact, "surface", name), (SURFACES.get(name, "m"), slots)
                at += count
            if wall.push:
                yield (*contact, "ball_radius"), ("m", self._shared(f"contact_ball_{i}"))
            if i in self.structure.friction:
                for j, (name, unit) in enumerate(FRICTION.items()):
                    slots = self._shared(f"friction_{i}", j, 1)
                    yield (*contact, "friction", name), (unit, slots)
        if keys[0] == "ligament" and len(keys) > 1:
            i = self.mechanism.ligament_names.index(str(keys[1]))
            units = LIGAMENTS | {"stiffness": "" if self.structure.ligaments[i] else "N/m"}
            for name, unit in units.items():
                yield ("ligament", keys[1], name), (unit, self._shared(f"ligament_{name}_{i}"))
        enabled = [wall.name for wall in self.mechanism.enabled_walls]
        if keys[0] == "wall" and keys[1:2] and keys[1] in enabled:
            i, beside = enabled.index(str(keys[1])), ("wall", keys[1])
            yield (*beside, "point"), ("m", self._shared(f"wall_point_{i}"))
            yield (*beside, "surface", "slope"), ("", self._shared(f"wall_surface_{i}", 0, 2))
            yield (*beside, "surface", "offset"), ("m", self._shared(f"wall_surface_{i}", 2, 1))
        if keys[0] == "chain" and len(keys) > 1:
            at = self.mechanism.chain_names.index(str(keys[1]))
            own: Any = self.mechanism.chains[at]
            kind = own.kind
            group = self.structure.families.index(kind)
            lane = sum(chain.kind == kind for chain in self.mechanism.chains[:at])
            for path, (start, count) in layout.lanes[group].items():
                if path == "base" and getattr(own, "via", None):
                    continue  # the line starts at the last of them
                slots = [(group, start + i, lane) for i in range(count)]
                yield ("chain", keys[1], *path.split(".")), (_unit(path, FAMILIES[kind]), slots)

    def _shared(self, name: str, first: int = 0, count: int | None = None) -> list[Slot]:
        start, size = self._layout.parameters[name]
        return [(-1, start + first + i, 0) for i in range(size if count is None else count)]

    @cached_property
    def _layout(self) -> Layout:
        return Layout.of_file(self.structure, self.walls)


def named(mechanism: Mechanism, keys: Path) -> Path:
    """Keys with chains, contacts, ligaments and walls by name."""
    if keys[0] not in PARTS or not isinstance(keys[1:2] and keys[1], int):
        return keys
    return (keys[0], PARTS[str(keys[0])](mechanism)[int(keys[1])], *keys[2:])


def _one(units: Iterable[str]) -> str:
    """The unit that all share, if they do."""
    found = set(units)
    return found.pop() if len(found) == 1 else ""


def _unit(path: str, family: Family) -> str:
    """The unit of a number of a chain."""
    slides = family.joint_unit == "m"
    own = {
        "axis": "",
        "mass": "kg",
        "com": "m" if path.startswith(("crank", "cylinder", "piston")) else "",
        **dict.fromkeys(("inertia", "rotor_inertia", "transverse", "axial"), "kg m^2"),
        "gear": "rad/m" if slides else "",
        "zero": family.joint_unit,
        "viscous": "N s/m" if slides else "N m s/rad",
        "coulomb": family.effort_unit,
        "smoothing_speed": f"{family.joint_unit}/s",
    }
    return own.get(path.rpartition(".")[2], "m")


def number_jacobian(
    mechanism: Mechanism, structure: Structure, paths: Sequence[str], keep: str = "home"
) -> np.ndarray:
    """Derivatives of the kernel's numbers by numbers of the file, (K, F), exact.

    Rows are the parameters of `Layout.of(structure)`, then the numbers of each group's lanes, those
    of all lanes side by side, as in `Numbers`. Columns are those of the paths, one after another.

    Args:   keep: `home`: contacts stay on their surfaces, see `Wall`; `all`: all else is held.
    Raises: InputError: for unknown paths, or numbers that this structure has not.
    """
    walls = walls_of(mechanism, structure, kept_contacts(mechanism, paths, keep))
    found = FileNumbers(mechanism, structure, walls).at(paths)
    slots = [slot for one in found for slot in one.slots]
    program = _tangents(structure, walls, tuple(sorted({slot[:2] for slot in slots})))
    own = numbers_of_file(mechanism, structure, walls)
    order = tuple(range(len(own.order)))  # lanes group by group
    kernel = NumpyKernel(Programs(program), replace(own, order=order))
    first = np.cumsum([0, *structure.counts])
    inputs = {
        port.name: np.zeros((len(slots), len(order) if port.lanes else 1)) for port in program.ports
    }
    for f, (group, i, lane) in enumerate(slots):
        inputs[f"{group}_{i}"][f, first[group] + lane if group >= 0 else 0] = 1.0
    values, layout = kernel.run(inputs).values, Layout.of(structure)
    names = [name for name, (_, count) in layout.parameters.items() if count]
    names += [f"{name}_{group}" for group, lane in enumerate(layout.lanes) for name in lane]
    return np.concatenate([values[name].reshape(-1, len(slots)) for name in names])


@lru_cache(maxsize=64)
def _tangents(
    structure: Structure, walls: tuple[Wall, ...], places: tuple[tuple[int, int], ...]
) -> Program:
    """Derivatives of the kernel's numbers along a direction: a port for each place."""
    program = file_numbers(structure, walls)
    graph, columns, ports = program.graph, 0, []
    seeds: dict[Value, Value] = {}
    before = [0, *accumulate(program.counts)]
    for group, i in places:
        ports.append(Port(f"{group}_{i}", 1, "", group >= 0, columns))
        if group < 0:
            seeds[graph.leaf("parameter", i)] = graph.leaf("input", columns)
            columns += 1
        else:
            at = columns + before[group]
            along = graph.leaf("lane_input", group, at, group=group)
            seeds[graph.leaf("lane", group, i, group=group)] = along
            columns += before[-1]
    values = [v for o in program.outputs for entry in o.entries for v in entry if v is not None]
    found: dict[Value | None, Value] = dict(
        zip(values, tangents(graph, values, seeds), strict=True)
    )
    return replace(program, columns=columns, ports=tuple(ports), checks=()).moved(graph, found)
