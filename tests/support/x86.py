"""Code for x86: small listings made at random, and machines that run what became of a listing.

One machine knows values by name, and finds out whether each stands where it is read; the other
knows them as numbers.
"""

from __future__ import annotations

import struct
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from condyle.backends.c.loops import Loops
from condyle.backends.c.x86.allocate import Allocation, Move, Place
from condyle.backends.c.x86.listing import Home, Instruction, Listing, Name
from condyle.backends.kernel import arranged, columns_of
from condyle.backends.numpy import NumpyKernel
from condyle.graph.operations import OPERATIONS
from condyle.graph.program import Numbers, Output, Variants

NEVER = 1 << 62
FUSED, CALLS = ("fma", "fnma", "fms"), ("mend", "call")
# Which operand may stand in memory: the last of what Intel's manual lists, where the order of the
# others is free.
IN_MEMORY = {
    **dict.fromkeys(("add", "mul", "and", "or", "xor"), (0, 1)),
    **dict.fromkeys(("sub", "div", "min", "max", "lt", "le", "eq", "ne"), (1,)),
    **dict.fromkeys(FUSED, (0, 1, 2)),
    **dict.fromkeys(("sqrt", "spread"), (0,)),
}
ARITY = {name: 1 for name in ("sqrt", "spread", "rsqrt", "shift", "output")}
ARITY |= {name: 3 for name in (*FUSED, "choose", "mend")}


def random_listing(rng: np.random.Generator, count: int, homes: int = 6) -> list[Instruction]:
    """Every kind of instruction on values near and far; every value is wanted."""
    operations = ("shift", "rsqrt", "choose", "call", *FUSED, "mend", *IN_MEMORY)
    code: list[Instruction] = []
    unread: list[Name] = []
    for to in range(1, count + 1):
        op = str(rng.choice(operations))
        near = [*range(max(1, to - 4), to), *rng.integers(1, to, size=2 if to > 1 else 0).tolist()]
        choice = [*near, *rng.integers(-homes, 0, size=2).tolist()]
        args = tuple(int(rng.choice(choice)) for _ in range(ARITY.get(op, 2)))
        if op == "call":
            args = (args[0], *args)
        if op == "mend" and rng.random() < 0.5:
            args = (*args, int(rng.choice(choice)))
        lanes = int(rng.choice((0, 1, 2, 4)))
        code.append(Instruction(op, to, args, 63 if op == "shift" else "f", lanes))
        unread = [*(v for v in unread if v not in args), to]
    stored = [*unread, -1]
    return [*code, *(Instruction("output", None, (v,), i) for i, v in enumerate(stored))]


class Reads:
    """Where each value is read."""

    def __init__(self, code: Sequence[Instruction]) -> None:
        self.at: dict[Name, list[int]] = {}
        for i, instruction in enumerate(code):
            for a in set(instruction.args):
                self.at.setdefault(a, []).append(i)

    def after(self, value: Name, i: int) -> int:
        """The first instruction from the i-th on that reads a value."""
        own = self.at.get(value, [])
        k = bisect_left(own, i)
        return own[k] if k < len(own) else NEVER


def run_by_name(code: Sequence[Instruction], allocation: Allocation, registers: int) -> None:
    """Runs moves on the names of values: each instruction gets what it asks for."""
    reads = Reads(code)
    stands: dict[Place, Name] = {}
    stored: set[Name] = set()
    i = 0
    value: Name | None
    for move in allocation.moves:
        op, to, args = move[:3]
        given = tuple(a.number if a.kind == "home" else stands[a] for a in args)
        if op == "store":
            assert to is not None and to.kind == "slot" and 0 <= to.number < allocation.slots
            assert args[0].kind == "register" and given[0] > 0
            assert given[0] not in stored, "a value is stored once"
            assert to not in stands or reads.after(stands[to], i) == NEVER, "two lives overlap"
            stored.add(given[0])
            stands[to] = given[0]
            continue
        if op in ("load", "copy"):
            assert (args[0].kind == "register") == (op == "copy")
            value, freed = given[0], i
        else:
            assert (op, given, *move[3:]) == (code[i].op, code[i].args, *code[i][3:])
            check_operands(move)
            value, freed = code[i].to, i + 1
            i += 1
        assert (to is None) == (value is None)
        if to is None or value is None:
            continue
        assert to.kind == "register" and 0 <= to.number < registers
        if op not in (*FUSED, *CALLS):
            kept = code[i].args if op in ("load", "copy") else given
            check_dropped(to, stands, reads, freed, kept)
        stands[to] = value
    assert i == len(code)


def check_operands(move: Move) -> None:
    """One operand in memory at most, where it may be; what overwrites takes an argument's place."""
    memory = [k for k, a in enumerate(move.args) if a.kind != "register"]
    assert len(memory) <= 1
    if move.op in ("and", "or", "xor") and move.lanes == 1:
        assert all(move.args[k].kind == "home" for k in memory), "a slot has one number, not two"
    assert all(k in IN_MEMORY.get(move.op, ()) for k in memory)
    if move.op in FUSED:
        assert move.to in move.args
    if move.op in CALLS:
        assert move.to == move.args[0]


def check_dropped(
    to: Place, stands: dict[Place, Name], reads: Reads, i: int, kept: Sequence[Name]
) -> None:
    """Belady: of the values in registers none is wanted later than one that makes room."""
    wanted = reads.after(stands[to], i) if to in stands else NEVER
    if wanted != NEVER:
        others = (v for p, v in stands.items() if p.kind == "register" and v not in kept)
        assert all(reads.after(v, i) <= wanted for v in others)


def loads(moves: Sequence[Move]) -> int:
    return sum(move.op == "load" for move in moves)


# -- numbers -----------------------------------------------------------------------------------


def _bits(function: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    return lambda *args: function(*(a.view(np.uint64) for a in args)).view(np.float64)


def _mask(compare: Callable[..., np.ndarray]) -> Callable[..., np.ndarray]:
    return lambda a, b: np.where(compare(a, b), ~np.uint64(0), np.uint64(0)).view(np.float64)


def _estimate(a: np.ndarray) -> np.ndarray:
    """1 / sqrt(a) in 14 bits."""
    rough = np.uint64((1 << 64) - (1 << 38))
    return ((1 / np.sqrt(a)).view(np.uint64) & rough).view(np.float64)


def _set(mask: np.ndarray) -> np.ndarray:
    return np.signbit(mask)


DO: dict[str, Callable[..., Any]] = {
    **{name: OPERATIONS[name].numpy for name in ("add", "sub", "mul", "div", "sqrt")},
    **{name: OPERATIONS[name].numpy for name in ("fma", "fnma")},
    "fms": lambda a, b, c: a * b - c,
    "min": lambda a, b: np.where(a < b, a, b),
    "max": lambda a, b: np.where(a > b, a, b),
    "rsqrt": _estimate,
    "and": _bits(np.bitwise_and),
    "or": _bits(np.bitwise_or),
    "xor": _bits(np.bitwise_xor),
    "lt": _mask(np.less),
    "le": _mask(np.less_equal),
    "eq": _mask(np.equal),
    "ne": _mask(np.not_equal),
    "choose": lambda mask, a, b: np.where(_set(mask), a, b),
}


def run_by_number(
    moves: Sequence[Move], home: Callable[[Name], np.ndarray], rows: int
) -> np.ndarray:
    """Outputs, (rows, N), of moves on numbers; products in sums are rounded by themselves."""
    stands: dict[Place, np.ndarray] = {}
    found: list[np.ndarray | None] = [None] * rows
    with np.errstate(all="ignore"):
        for op, to, places, data, _ in moves:
            args = [home(p.number) if p.kind == "home" else stands[p] for p in places]
            if op == "output":
                assert isinstance(data, int) and found[data] is None
                found[data] = args[0]
                continue
            assert to is not None
            if op in ("load", "store", "copy"):
                value = args[0]
            elif op == "shift":
                assert isinstance(data, int)
                value = (args[0].view(np.uint64) << np.uint64(data)).view(np.float64)
            elif op == "mend":
                own = OPERATIONS[str(data)].numpy(*args[2:])
                value = np.where(_set(args[1]), args[0], own)
            elif op == "call":
                value = OPERATIONS[str(data)].numpy(*args[1:])
            else:
                value = DO[op](*args)
            stands[to] = value
    assert all(row is not None for row in found)
    return np.array(found)


class Step:
    """A batch step of a program on one mechanism's numbers, and samples of it."""

    def __init__(self, loops: Loops, numbers: Numbers, inputs: dict[str, np.ndarray]) -> None:
        self.loops, self.program = loops, loops.program
        self.order = numbers.order
        self.count, columns = columns_of(self.program.interface, inputs, numbers.order)
        self.columns = [np.ascontiguousarray(column) for column in columns]
        self.table = _table(loops, numbers, inputs)

    def home(self, listing: Listing) -> Callable[[Name], np.ndarray]:
        def value(name: Name) -> np.ndarray:
            kind, number = listing.home(name)
            if kind == "sample":
                return self.columns[number]
            x = self.table[number] if kind == "table" else as_float(Home(kind, number))
            return np.full(self.count, x)

        return value

    def values(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Results by name, as a kernel returns them."""
        found, start, face = {}, 0, self.program.interface
        for r in face.results:
            width = face.width(r)
            found[r.name] = arranged(face, r, rows[start : start + width], self.order)
            start += width
        return found


def as_float(literal: Home) -> float:
    return struct.unpack("<d", struct.pack("<Q", literal.number))[0]


def _table(loops: Loops, numbers: Numbers, inputs: dict[str, np.ndarray]) -> np.ndarray:
    """What `prepare` computes, by numpy: the results of a program of the table's values."""
    p, outputs, slots = loops.program, [], []
    for group, own in ((None, loops.table.shared), *enumerate(loops.table.lanes)):
        for v in own:
            entry = tuple(v if g == group else None for g in range(len(p.counts)))
            entry = (v,) if group is None else entry
            outputs.append(Output(str(v), (), "", group is not None, (entry,)))
            lanes = 1 if group is None else p.counts[group]
            slots.append([loops.slot(v, lane) for lane in range(lanes)])
    fixed = replace(p, outputs=tuple(outputs), checks=())
    numbers = replace(numbers, order=tuple(range(len(numbers.order))))
    values = NumpyKernel(Variants(fixed), numbers).run(inputs).values.values()
    table = np.full(loops.table_size, np.nan)
    for at, value in zip(slots, values, strict=True):
        table[at] = value[..., 0]
    return table
