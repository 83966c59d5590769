"""Numbers of a mechanism file by their paths, and the kernel's numbers' derivatives in them.

A path is one as `mechanism.get` takes it: `platform.mass`, `chain.masseter_left.base[2]`,
`contact.left.surface.slope`; `chain.*.actuator.viscous` is that of every chain, one after another.
A table is its entries in the file's order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ..backends.numpy_kernel import NumpyKernel
from ..errors import InputError, join
from ..graph.program import Program, Programs
from ..graph.transform import LANE_NUMBERS, NUMBERS, number_ports
from ..mechanism.bodies import Inertia
from ..mechanism.kept_home import kept_contacts
from ..mechanism.mechanism import Mechanism
from ..mechanism.paths import Path, parsed, value_at, written
from ..mechanism.quantities import Unit
from ..mechanism.surface.wall import Wall
from .derivative import PREFIX, directional
from .file_numbers import file_numbers, numbers_of_file
from .numbers import LANDMARK, Layout, lane_numbers, shared_numbers, tables
from .structure import Structure, walls_of

Slot = tuple[int, int, int]  # group or -1, index, lane
ENTRIES = tuple(Inertia.model_fields)
PARTS: dict[str, Callable[[Mechanism], tuple[str, ...]]] = {
    "chain": lambda mechanism: mechanism.chain_names,
    "contact": lambda mechanism: mechanism.contact_names,
    "ligament": lambda mechanism: mechanism.ligament_names,
    "wall": lambda mechanism: mechanism.wall_names,
}


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
        places = [self._at(path) for path in paths]
        owner: dict[Slot, str] = {}
        for place in places:
            for slot in place.slots:
                if slot in owner:
                    raise InputError(
                        f"{place.path}: shares numbers with {owner[slot]}; give each number once"
                    )
                owner[slot] = place.path
        return places

    def _at(self, path: str) -> NumberPath:
        keys = parsed(path)
        if keys[0] in PARTS and keys[1:2] == ("*",):
            return self._of_each(path, keys)
        value, keys = value_at(self.mechanism, path), named(self.mechanism, keys)
        part = keys[:2] if keys[0] in PARTS else ()
        leaves = {
            leaf: found
            for leaf, found in self.leaves.items()
            if (leaf[:2] if leaf[0] in PARTS else ()) == part
        }
        for leaf, (own, slots) in leaves.items():
            if keys[: len(leaf)] == leaf and value is not None:
                whole = np.shape(value_at(self.mechanism, written(leaf)))
                entry = tuple(int(key) for key in keys[len(leaf) :])
                at = np.arange(len(slots)).reshape(whole)[entry]
                some = tuple(slots[i] for i in np.ravel(at))
                return NumberPath(path, own.unit, np.shape(at), some)
        inside = [leaf for leaf in leaves if leaf[:-1] == keys]
        if not inside:
            why = "it is left out, and has no default" if value is None else "it has no such number"
            raise InputError(
                f"{path}: expected a number or vector that this kernel knows; {why}. Available: "
                f"{join(written(leaf) for leaf in leaves)}"
            )
        every = tuple(slot for leaf in inside for slot in leaves[leaf][1])
        unit = _common_unit(leaves[leaf][0].unit for leaf in inside)
        return NumberPath(path, unit, (len(every),), every)

    def _of_each(self, path: str, keys: Path) -> NumberPath:
        names = PARTS[str(keys[0])](self.mechanism)
        each = [self._at(written((keys[0], name, *keys[2:]))) for name in names]
        if len({one.shape for one in each}) != 1:
            sizes = join(f"{name} {one.size}" for name, one in zip(names, each, strict=True))
            raise InputError(f"{path}: expected as many numbers of each {keys[0]}, got {sizes}")
        slots = tuple(slot for one in each for slot in one.slots)
        return NumberPath(
            path, _common_unit(o.unit for o in each), (len(each), *each[0].shape), slots
        )

    @cached_property
    def row(self) -> np.ndarray:
        """All numbers as the ports of `file_numbers` take them, (F,): shared ones, then those of
        lanes, (most, n), chains in the order of the file; 0 where a chain has no such number."""
        own = numbers_of_file(self.mechanism, self.structure, self.walls, self.landmark)
        return np.concatenate([part.ravel() for part in number_ports(own).values()])

    def place(self, slot: Slot) -> int:
        """Where a number stands in `row`."""
        group, i, lane = slot
        if group < 0:
            return i
        kind, chains = self.structure.families[group], self.mechanism.chains
        chain = [k for k, chain in enumerate(chains) if chain.kind == kind][lane]
        return self._layout.sizes[0] + i * len(chains) + chain

    @cached_property
    def _layout(self) -> Layout:
        return Layout.of_file(self.structure, self.walls)

    @cached_property
    def leaves(self) -> dict[Path, tuple[Unit, list[Slot]]]:
        """Keys of every number and vector of the file -> unit and range, and slots."""
        table: dict[Path, tuple[Unit, list[Slot]]] = {}
        start = 0
        for number in shared_numbers(self.structure, self.walls):
            own: Path = tuple(number.path.split("."))
            if number.part:
                own = (number.part, tables(self.mechanism, number.part)[number.at].name, *own)
            elif number.path == LANDMARK and self.landmark is not None:
                own = (*own, self.landmark)
            if number.path and (number.path != LANDMARK or self.landmark is not None):
                slots = [(-1, start + i, 0) for i in range(number.field.size)]
                table[own] = number.field.unit, slots
            start += number.field.size
        for group, kind in enumerate(self.structure.families):
            chains = [chain for chain in self.mechanism.chains if chain.kind == kind]
            for lane, chain in enumerate(chains):
                start = 0
                for path, field in lane_numbers(self.structure, group).items():
                    slots = [(group, start + i, lane) for i in range(field.size)]
                    start += field.size
                    if path != "base" or not getattr(chain, "via", None):  # the last is its start
                        table["chain", chain.name, *path.split(".")] = field.unit, slots
        return table

    @cached_property
    def names(self) -> dict[Slot, str]:
        """Path of every single number."""
        paths: dict[Slot, str] = {}
        for leaf, (_, slots) in self.leaves.items():
            path = written(leaf)
            each = entry_names(path, np.shape(value_at(self.mechanism, path)))
            paths |= zip(slots, each, strict=True)
        return paths


def named(mechanism: Mechanism, keys: Path) -> Path:
    """Keys with chains, contacts, ligaments and walls by name."""
    if keys[0] not in PARTS or not isinstance(keys[1:2] and keys[1], int):
        return keys
    return (keys[0], PARTS[str(keys[0])](mechanism)[int(keys[1])], *keys[2:])


def entry_names(path: str, shape: tuple[int, ...]) -> list[str]:
    """Paths of the numbers at a path, one after another."""
    if path.endswith(".inertia") and shape == (len(ENTRIES),):
        return [f"{path}.{entry}" for entry in ENTRIES]
    return [path + "".join(f"[{i}]" for i in entry) for entry in np.ndindex(*shape)]


def _common_unit(units: Iterable[str]) -> str:
    """The unit that all share, if they do."""
    found = set(units)
    return found.pop() if len(found) == 1 else ""


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
    file = FileNumbers(mechanism, structure, walls)
    places = [file.place(slot) for one in file.at(paths) for slot in one.slots]
    directions = np.zeros((len(places), file.row.size))
    directions[range(len(places)), places] = 1.0
    own = numbers_of_file(mechanism, structure, walls)
    kernel = NumpyKernel(Programs(_tangents(structure, walls)), own)
    inputs, start = {}, 0
    for port in kernel.interface.ports:
        shape = (port.size, len(own.order)) if port.lanes else (port.size,)
        size = math.prod(shape)
        inputs[port.name] = directions[:, start : start + size].reshape(-1, *shape)
        start += size
    values, layout = kernel.run(inputs).values, Layout.of(structure)
    names = [name for name, (_, count) in layout.parameters.items() if count]
    names += [f"{name}_{group}" for group, lane in enumerate(layout.lanes) for name in lane]
    return np.concatenate([values[PREFIX + name].reshape(-1, len(places)) for name in names])


@lru_cache(maxsize=64)
def _tangents(structure: Structure, walls: tuple[Wall, ...]) -> Program:
    """Derivatives of the kernel's numbers along a direction of the file's."""
    program, layout = file_numbers(structure, walls), Layout.of_file(structure, walls)
    names = [output.name for output in program.outputs]
    return directional(program, (NUMBERS, LANE_NUMBERS), names, layout)
