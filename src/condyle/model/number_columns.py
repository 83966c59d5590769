"""Numbers of the mechanism file that derivatives are taken by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..errors import InputError
from ..graph.graph import reachable
from ..graph.program import Program
from ..mechanism.kept_home import kept_contacts
from ..mechanism.mechanism import Mechanism
from ..mechanism.paths import parsed, value_at, written
from ..mechanism.surface.wall import Wall
from ..questions import Question
from ..questions.file_numbers import file_numbers
from ..questions.number_paths import FileNumbers, NumberPath, named
from ..questions.numbers import Layout
from ..questions.structure import Structure, walls_of
from .system import System

Place = tuple[object, ...]  # of a number: group or -1, index


@dataclass(frozen=True)
class NumberColumns:
    """Numbers of the file, and what they make of the kernel's.

    system: whose kernels take all these numbers.
    J:      derivatives of the kernel's numbers, (K, F);  columns: of each path, in J.
    shapes, units: of each path, also of those that have no columns: they cannot matter.
    home_kept: contacts whose surface follows: see `kept_contacts`.
    """

    system: System
    J: np.ndarray
    columns: dict[str, slice]
    shapes: dict[str, tuple[int, ...]]
    units: dict[str, str]
    home_kept: tuple[str, ...]

    @staticmethod
    def of(
        own: System,
        paths: Sequence[str],
        keep: str,
        zeros: bool,
        terms: Sequence[tuple[str, str, tuple[str, ...]]],
    ) -> NumberColumns:
        """Args: zeros: whether numbers that cannot matter are no error.
        terms: results by name, and the question and its results that they follow from.

        Raises: InputError: for unknown paths, and numbers that cannot matter.
        """
        rubs = any("friction" in path for path in paths)
        system = own.with_friction if rubs else own.unreduced
        structure, mechanism = system.structure, own.mechanism
        followers = kept_contacts(mechanism, paths, keep)
        walls = walls_of(mechanism, structure, followers)
        every, known = FileNumbers(mechanism, structure, walls), dict[str, NumberPath]()
        shapes, units = dict[str, tuple[int, ...]](), dict[str, str]()
        for path in paths:
            try:
                (known[path],) = every.at([path])
                shapes[path], units[path] = known[path].shape, known[path].unit
            except InputError:
                value = value_at(mechanism, path) if "*" not in path else ""
                shape = () if value is None else np.shape(value)
                if isinstance(value, str) or not _numeric(value):
                    raise
                _require(zeros, path, [name for name, *_ in terms])
                shapes[path], units[path] = shape, ""
        every.at(list(known))  # none shares a number with another
        J = np.zeros((_size(system), 0))
        if known:
            J = system.number_jacobian(list(known), keep)
        columns, start = dict[str, slice](), 0
        for path, number in known.items():
            columns[path] = slice(start, start + number.size)
            start += number.size
            for name, question, rows in terms:
                behind = _behind(structure, walls, question, tuple(rows))
                if not any(slot[:2] in behind for slot in number.slots):
                    _require(zeros, path, [name])
        names = tuple(mechanism.contact_names[i] for i in followers)
        return NumberColumns(system, J, columns, shapes, units, names)


def limit_ends(mechanism: Mechanism, path: str) -> tuple[np.ndarray, tuple[int, ...]] | None:
    """Limits of efforts at a path: what they make of the least and then the greatest effort of
    every chain, (2 n, entries), and the path's shape; None for another path.

    Raises: InputError: for chains without such a limit.
    """
    keys = parsed(path)
    if len(keys) < 4 or keys[0] != "chain" or keys[3] not in ("torque_limit", "force_limit"):
        return None
    names, entry = mechanism.chain_names, keys[4:]
    each = names if keys[1] == "*" else [str(named(mechanism, keys)[1])]
    blocks = []
    for name in each:
        value = value_at(mechanism, written(("chain", name, *keys[2:4])))
        if value is None:
            raise InputError(f"wrt: {path}: chain {name} has no limit; give it one first")
        cable = mechanism.chains[names.index(name)].kind == "cable"
        # One number is for both directions; cables push none.
        one = [[1.0, 0.0], [0.0, 1.0]] if np.ndim(value) else [[-1.0 * (not cable), 1.0]]
        for row in one if not entry else [one[int(entry[0])]]:
            block = np.zeros((2, len(names)))
            block[:, names.index(name)] = row
            blocks.append(block.ravel())
    pair = () if entry or len(blocks) == len(each) else (2,)
    return np.array(blocks).T, (*((len(each),) if keys[1] == "*" else ()), *pair)


def _numeric(value: object) -> bool:
    try:
        return value is None or np.asarray(value, dtype=float).size > 0
    except (TypeError, ValueError):
        return False


def _require(zeros: bool, path: str, names: Sequence[str]) -> None:
    if not zeros:
        raise InputError(
            f"wrt: {', '.join(names)} cannot depend on {path}; leave it out, or take --zeros "
            "(zeros=True) for zeros"
        )


def _size(system: System) -> int:
    return system.numbers.parameters.size + sum(a.size for a in system.numbers.lanes)


@lru_cache(maxsize=64)
def _behind(
    structure: Structure, walls: tuple[Wall, ...], question: str, rows: tuple[str, ...]
) -> frozenset[Place]:
    """Numbers of the file that results of a question follow from, even where the slope is 0."""
    program = Question.about(structure, question).variants().main
    found = [e for o in program.outputs if o.name in rows for e in o.entries]
    used = _leaves(program, [v for entry in found for v in entry])
    program, layout = file_numbers(structure, walls), Layout.of(structure)
    values: list[int | None] = []
    for o in program.outputs:
        if o.name in layout.parameters:
            at, (start, _) = -1, layout.parameters[o.name]
        else:
            name, _, group = o.name.rpartition("_")
            at, (start, _) = int(group), layout.lanes[int(group)][name]
        values += [e[max(at, 0)] for i, e in enumerate(o.entries) if (at, start + i) in used]
    return frozenset(_leaves(program, values))


def _leaves(program: Program, values: Sequence[int | None]) -> set[Place]:
    graph = program.graph
    nodes = (graph.nodes[v] for v in reachable(graph, [v for v in values if v is not None]))
    both = {"parameter": lambda data: (-1, *data), "lane": tuple}
    return {both[n.op](n.data) for n in nodes if n.op in both}
