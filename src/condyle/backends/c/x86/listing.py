"""What processors do, in the order in which they do it: vector instructions on numbered values."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

Name = int  # of a value that an instruction defines; negative: what stands in memory from the start


class Home(NamedTuple):
    """Where a value stands in memory from the start.

    kind:   table or literal, a number each; sample, a vector of samples (in a batch); given, a
            number of the sample, row, a vector of numbers of the table, and given_row, one of the
            sample (in one evaluation).
    number: which one; of a literal its bits, so that 0 and -0 are two.
    """

    kind: str
    number: int


class Instruction(NamedTuple):
    """One operation on vectors.

    to:    the value that it defines; None for what only stores.
    args:  values, or places in memory.
    data:  which output is stored, how far is shifted, which halves are taken, or what is called.
    lanes: how many numbers it is about, the first of its registers'; 0 for all.
    """

    op: str
    to: Name | None
    args: tuple[Name, ...]
    data: object = None
    lanes: int = 0


@dataclass
class Listing:
    """Instructions, and the places in memory that they read: number -1 - i is the i-th."""

    code: list[Instruction] = field(default_factory=list)
    homes: list[Home] = field(default_factory=list)
    _known: dict[Home, Name] = field(default_factory=dict)
    _last: int = 0

    def add(self, op: str, *args: Name, data: object = None, lanes: int = 0) -> Name:
        """The value of one more instruction."""
        self._last += 1
        self.code.append(Instruction(op, self._last, args, data, lanes))
        return self._last

    def store(self, output: int, value: Name, lanes: int = 0) -> None:
        self.code.append(Instruction("output", None, (value,), output, lanes))

    def place(self, kind: str, number: int) -> Name:
        """A value of the table or of the sample."""
        home = Home(kind, number)
        if home not in self._known:
            self.homes.append(home)
            self._known[home] = -len(self.homes)
        return self._known[home]

    def number(self, value: float) -> Name:
        return self.place("literal", struct.unpack("<Q", struct.pack("<d", value))[0])

    def bits(self, pattern: int) -> Name:
        return self.place("literal", pattern)

    def home(self, value: Name) -> Home:
        return self.homes[-1 - value]


def uses(code: Iterable[Instruction]) -> dict[Name, list[int]]:
    """Where each value is read, in order."""
    found: dict[Name, list[int]] = {}
    for i, instruction in enumerate(code):
        for a in dict.fromkeys(instruction.args):
            found.setdefault(a, []).append(i)
    return found


def contracted(code: list[Instruction]) -> list[Instruction]:
    """Products that one sum alone wants join it, and what nobody wants goes."""
    read = uses(code)
    made = {i.to: i for i in code if i.to is not None}

    def product(value: Name, lanes: int) -> Instruction | None:
        found = made.get(value)
        alone = found and found.op == "mul" and found.lanes == lanes and len(read[value]) == 1
        return found if alone else None

    joined = [_joined(i, product) for i in code]
    wanted: set[Name] = set()
    kept = []
    for instruction in reversed(joined):
        if instruction.to is None or instruction.to in wanted:
            kept.append(instruction)
            wanted.update(instruction.args)
    return kept[::-1]


def _joined(own: Instruction, product: Callable[[Name, int], Instruction | None]) -> Instruction:
    if own.op not in ("add", "sub") or len(set(own.args)) == 1:
        return own
    a, b = own.args
    if p := product(b, own.lanes):
        return own._replace(op="fma" if own.op == "add" else "fnma", args=(*p.args, a))
    if p := product(a, own.lanes):
        return own._replace(op="fma" if own.op == "add" else "fms", args=(*p.args, b))
    return own
