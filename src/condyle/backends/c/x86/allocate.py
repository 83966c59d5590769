"""Registers for values, and places on the stack for those that have to wait (Belady, 1966).

When registers run out, the value that is wanted last gives up its own. It is stored once, if it
stands nowhere in memory yet, and comes back either into a register, or, where its next use is far,
as an operand straight from memory.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

from .listing import Instruction, Name, uses

NEVER = 1 << 60
SOON = 20  # instructions to the next use, within which a value from memory takes a register

# Operations that may read an argument from memory: which ones.
ANY = ("add", "mul", "and", "or", "xor", "fma", "fnma", "fms", "sqrt", "spread")
SECOND = ("sub", "div", "min", "max", "lt", "le", "eq", "ne")
LOGIC = ("and", "or", "xor")  # of one number too they read two, of which a slot has one
FUSED = ("fma", "fnma", "fms")
CALLS = ("mend", "call")
OVERWRITING = (*FUSED, *CALLS)  # what leaves its result in the register of an argument


class Place(NamedTuple):
    """Where an operand is: kind "register", "slot" (on the stack) or "home" (see `Listing`)."""

    kind: str
    number: int


class Move(NamedTuple):
    """One step of a processor.

    op:   "load", "store", "copy", or an instruction's.
    to:   the register or slot it writes; None for an output.
    args: what it reads, in the instruction's order.
    data, lanes: as of `Instruction`; of moves the lanes of the value.
    """

    op: str
    to: Place | None
    args: tuple[Place, ...]
    data: object = None
    lanes: int = 0


class Allocation(NamedTuple):
    """moves: everything in order;  slots: places on the stack that it takes."""

    moves: list[Move]
    slots: int


def allocated(code: Sequence[Instruction], registers: int) -> Allocation:
    """The instructions on registers and memory.

    What an operation of `OVERWRITING` writes is the register of one of its arguments, of `CALLS`
    the first; at most one argument is in memory, and only where `ANY` and `SECOND` have it.
    """
    return _Allocator(code, registers).run()


class _Allocator:
    """State at one instruction: which register holds what, and what stands on the stack."""

    def __init__(self, code: Sequence[Instruction], registers: int) -> None:
        self.code = code
        self.uses = uses(code)
        self.lanes = {i.to: i.lanes for i in code if i.to is not None}
        self.held: list[Name | None] = [None] * registers
        self.register: dict[Name, int] = {}
        self.slot: dict[Name, int] = {}
        self.free: list[int] = []
        self.slots = 0
        self.moves: list[Move] = []
        self.here = 0

    def run(self) -> Allocation:
        for here, instruction in enumerate(self.code):
            self.here = here
            self._place(instruction)
        return Allocation(self.moves, self.slots)

    def _place(self, instruction: Instruction) -> None:
        op, to, args, data, lanes = instruction
        memory = self._from_memory(instruction)
        for a in args:
            if a != memory:
                self._fetch(a, args)
        if op in OVERWRITING:
            self._overwrite(instruction, memory)
            return
        places = tuple(self._operand(a) for a in args)
        self._end(args)
        target = None
        if to is not None:
            target = Place("register", self._vacant(args))
            self._hold(to, target.number)
        self.moves.append(Move(op, target, places, data, lanes))
        self._leave(args)

    def _overwrite(self, instruction: Instruction, memory: Name | None) -> None:
        """An instruction whose result takes an argument's register, rather of one that may go."""
        op, to, args, data, lanes = instruction
        assert to is not None
        places = [self._operand(a) for a in args]
        first = args[:1] if op in CALLS else (args[2], *args[:2])
        victim = next((a for a in first if a != memory and self._may_go(a)), None)
        if victim is None:
            # Nothing may go: an argument has a second register.
            fresh = Place("register", self._vacant(args))
            source = first[0] if op in CALLS or memory is None else memory
            chosen = args.index(source)
            self._move("load" if source == memory else "copy", source, fresh, places[chosen])
            places[chosen] = fresh
            target = fresh.number
        else:
            target = self.register[victim]
            self._drop(target)
        self._end(args)
        self._hold(to, target)
        self.moves.append(Move(op, Place("register", target), tuple(places), data, lanes))
        self._leave(args)

    def _may_go(self, value: Name) -> bool:
        """Whether a value's register can be overwritten without a loss."""
        wanted = self._next(value)
        return wanted == NEVER or (self._in_memory(value) and wanted > self.here + SOON)

    # -- operands ----------------------------------------------------------------------------

    def _move(self, op: str, value: Name, to: Place, source: Place) -> None:
        self.moves.append(Move(op, to, (source,), None, self.lanes.get(value, 0)))

    def _from_memory(self, instruction: Instruction) -> Name | None:
        """The argument that is read where it stands in memory, if any."""
        op, _, args, _, lanes = instruction
        able = args if op in ANY else args[1:2] if op in SECOND else ()
        able = tuple(a for a in able if a not in self.register and args.count(a) == 1)
        if op in LOGIC and lanes == 1:
            able = tuple(a for a in able if a < 0)
        if not able:
            return None
        last = max(able, key=self._next)
        wanted = self._next(last)
        if wanted > self.here + SOON:
            return last
        if None in self.held:
            return None
        others = (v for v in self.held if v is not None and v not in args)
        return last if max(map(self._next, others)) <= wanted else None

    def _operand(self, value: Name) -> Place:
        if value in self.register:
            return Place("register", self.register[value])
        return self._memory(value)

    def _memory(self, value: Name) -> Place:
        return Place("home", value) if value < 0 else Place("slot", self.slot[value])

    def _fetch(self, value: Name, keep: tuple[Name, ...]) -> None:
        """Bring a value into a register."""
        if value not in self.register:
            target = self._vacant(keep)
            self._move("load", value, Place("register", target), self._memory(value))
            self._hold(value, target)

    # -- registers and slots -----------------------------------------------------------------

    def _vacant(self, keep: tuple[Name, ...]) -> int:
        """A free register; the value that is wanted last makes room, one in memory rather."""
        if None in self.held:
            return self.held.index(None)
        choice = [(k, v) for k, v in enumerate(self.held) if v is not None and v not in keep]
        target, value = max(choice, key=lambda c: (self._next(c[1]), self._in_memory(c[1])))
        if not self._in_memory(value):
            if not self.free:
                self.free.append(self.slots)
                self.slots += 1
            self.slot[value] = self.free.pop()
            self._move("store", value, self._memory(value), Place("register", target))
        self._drop(target)
        return target

    def _hold(self, value: Name, register: int) -> None:
        self.held[register] = value
        self.register[value] = register

    def _drop(self, register: int) -> None:
        value = self.held[register]
        assert value is not None
        self.held[register] = None
        del self.register[value]

    def _end(self, args: tuple[Name, ...]) -> None:
        """Values that are read here for the last time leave their registers."""
        for a in set(args):
            if a in self.register and self._next(a) == NEVER:
                self._drop(self.register[a])

    def _leave(self, args: tuple[Name, ...]) -> None:
        """They leave their slots too, which nothing may be stored in before they are read."""
        for a in set(args):
            if a in self.slot and self._next(a) == NEVER:
                self.free.append(self.slot.pop(a))

    def _in_memory(self, value: Name) -> bool:
        return value < 0 or value in self.slot

    def _next(self, value: Name) -> int:
        """The instruction after this one that reads a value."""
        own = self.uses.get(value, [])
        k = bisect_right(own, self.here)
        return own[k] if k < len(own) else NEVER
