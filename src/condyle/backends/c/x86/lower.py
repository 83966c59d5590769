"""Values of a program as instructions: what one evaluation and a batch have in common.

Functions become the instructions that `vector.h` has for them. Where those would be far off (an
angle of a million, what is not finite), `mend` asks the C library, lane by lane; `call` does so for
functions that there are no instructions for.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

from ....graph.graph import Value
from ....graph.operations import REDUCTIONS
from ..printer import Printer
from .listing import Listing, Name

# Minimax polynomials of sine and cosine, lowest power first (Cephes), and pi / 2 in three parts.
SINE = (
    *(-1.66666666666666307295e-1, 8.33333333332211858878e-3, -1.98412698295895385996e-4),
    *(2.75573136213857245213e-6, -2.50507477628578072866e-8, 1.58962301576546568060e-10),
)
COSINE = (
    *(4.16666666666665929218e-2, -1.38888888888730564116e-3, 2.48015872888517045348e-5),
    *(-2.75573141792967388112e-7, 2.08757008419747316778e-9, -1.13585365213876817300e-11),
)
QUARTER_TURN = (1.57079625129699707031, 7.54978941586159635335e-8, 5.39030285815811905290e-15)
TURNS = 6.36619772367581382433e-1
WHOLE = 6755399441055744.0  # 1.5 * 2^52: a number that is added becomes whole
TURNS_LIMIT = 1048576.0
SIGN, SIZE = 1 << 63, (1 << 63) - 1  # bits of a number's sign, and of the rest
# atan(t) in t^2 for |t| <= 1/2, lowest power first, and an eighth of a turn in two parts.
ARC = (
    *(-3.33333333333333315e-1, 1.99999999999994849e-1, -1.42857142855987407e-1),
    *(1.11111111008817611e-1, -9.09090861886538707e-2, 7.69229467748263467e-2),
    *(-6.66643514414314322e-2, 5.87957310779968419e-2, -5.24006415441106853e-2),
    *(4.62787008641868395e-2, -3.80622479499668698e-2, 2.49996895075213673e-2),
    -9.21106350462792581e-3,
)
EIGHTH_TURN = (0.7853981633974483, 3.061616997868383e-17)
PLAIN = {"add": "add", "sub": "sub", "mul": "mul", "fma": "fma", "fnma": "fnma", "sqrt": "sqrt"}
PLAIN |= {"fmin": "min", "fmax": "max"}
# Functions that there are instructions for: which method has them.
FUNCTIONS = {"neg": "neg", "fabs": "fabs", "copysign": "copysign", "not": "negation", "and": "both"}
FUNCTIONS |= {"or": "either", "where": "where", "sin": "sine", "cos": "cosine", "atan2": "arc"}
COMPARED = ("lt", "le", "eq", "ne")


class Turned(NamedTuple):
    """Sine and cosine of an angle less its quarter turns, whose number stands in the last bits of
    `turns`; near: whether that is accurate."""

    sine: Name
    cosine: Name
    turns: Name
    near: Name


class Lowering(ABC):
    """What each value of the program became, by value and copy."""

    def __init__(self, printer: Printer) -> None:
        self.printer, self.nodes = printer, printer.g.nodes
        self.listing = Listing()
        self.found: dict[tuple[Value, int | None], Name] = {}
        self.turned: dict[Name, Turned] = {}

    @abstractmethod
    def add(self, op: str, *args: Name, data: object = None) -> Name:
        """The value of one more instruction."""

    @abstractmethod
    def fixed(self, v: Value, copy: int) -> Name:
        """A value of the table."""

    @abstractmethod
    def given(self, v: Value, copy: int) -> Name:
        """An input."""

    @abstractmethod
    def reduction(self, v: Value) -> Name:
        """A sum or minimum over the chains."""

    @abstractmethod
    def estimates(self) -> bool:
        """Whether inverse roots begin with the processor's estimate."""

    def define(self, v: Value, copy: int) -> None:
        key = v, None if self.nodes[v].group is None else copy
        if key not in self.found:
            self.found[key] = self._value(v, copy)

    def named(self, v: Value, copy: int) -> Name:
        """A value that was defined, or stands in memory."""
        node = self.nodes[v]
        if node.op == "const":
            assert isinstance(node.data[0], float)
            return self.listing.number(node.data[0])
        if not node.varies:
            return self.fixed(v, copy)
        return self.found[v, None if node.group is None else copy]

    def _value(self, v: Value, copy: int) -> Name:
        node, add = self.nodes[v], self.add
        if node.op in ("input", "lane_input"):
            return self.given(v, copy)
        if node.op in REDUCTIONS:
            return self.reduction(v)
        args = [self.named(a, copy) for a in node.args]
        if node.op == "div" and self.printer.is_inverse_root(v) and self.estimates():
            return self._inverse_root(self.named(self.nodes[node.args[1]].args[0], copy))
        if node.op in PLAIN or node.op == "div":
            return add(PLAIN.get(node.op, node.op), *args)
        if node.op in COMPARED:
            return self.truth(add(node.op, *args))
        if node.op in FUNCTIONS:
            return getattr(self, FUNCTIONS[node.op])(*args)
        return add("call", args[0], *args, data=node.op)

    def plus(self, total: Name | None, sign: int, args: list[Name]) -> Name:
        """A number or a product more, or less, than the total."""
        if total is not None and len(args) == 2:
            return self.add("fma" if sign > 0 else "fnma", *args, total)
        if total is not None:
            return self.add("add" if sign > 0 else "sub", total, *args)
        own = self.add("mul", *args) if len(args) == 2 else args[0]
        return own if sign > 0 else self.neg(own)

    def with_shared(self, v: Value, total: Name | None) -> Name:
        """A reduction with its terms that are the same in all chains."""
        for count, term in self.printer.shared_terms(v):
            own = self.named(term, 0)
            if self.nodes[v].op == "sum":
                total = self.plus(total, 1, [self.listing.number(float(count)), own])
            else:
                total = own if total is None else self.add("min", total, own)
        assert total is not None
        return total

    # -- functions ---------------------------------------------------------------------------

    def truth(self, mask: Name) -> Name:
        return self.add("and", mask, self.listing.number(1.0))

    def neg(self, a: Name) -> Name:
        return self.add("xor", a, self.listing.bits(SIGN))

    def fabs(self, a: Name) -> Name:
        return self.add("and", a, self.listing.bits(SIZE))

    def copysign(self, a: Name, b: Name) -> Name:
        sign = self.add("and", b, self.listing.bits(SIGN))
        return self.add("or", self.fabs(a), sign)

    def _not_zero(self, a: Name) -> Name:
        return self.add("ne", a, self.listing.number(0.0))

    def negation(self, a: Name) -> Name:
        return self.truth(self.add("eq", a, self.listing.number(0.0)))

    def both(self, a: Name, b: Name) -> Name:
        return self.truth(self.add("and", self._not_zero(a), self._not_zero(b)))

    def either(self, a: Name, b: Name) -> Name:
        return self.truth(self.add("or", self._not_zero(a), self._not_zero(b)))

    def where(self, a: Name, b: Name) -> Name:
        return self.add("and", self._not_zero(a), b)

    def _inverse_root(self, a: Name) -> Name:
        """An estimate of 14 bits and two steps of Newton."""
        add, number = self.add, self.listing.number
        y, half = add("rsqrt", a), add("mul", number(0.5), a)
        y = add("mul", y, add("fnma", add("mul", half, y), y, number(1.5)))
        return add("fma", y, add("fnma", add("mul", half, y), y, number(0.5)), y)

    def polynomial(self, z: Name, coefficients: Sequence[float]) -> Name:
        number = self.listing.number
        total = number(coefficients[-1])
        for c in coefficients[-2::-1]:
            total = self.add("fma", total, z, number(c))
        return total

    def sine(self, x: Name) -> Name:
        t = self._turned(x)
        return self._settled("sin", x, t, t.sine, t.cosine, self._sign(t, 62))

    def cosine(self, x: Name) -> Name:
        t = self._turned(x)
        sign = self.add("xor", self._sign(t, 62), self._sign(t, 63))
        return self._settled("cos", x, t, t.cosine, t.sine, sign)

    def _settled(
        self, name: str, x: Name, turned: Turned, even: Name, odd: Name, sign: Name
    ) -> Name:
        """A sine or cosine, which is the other one of what is left after an odd number of turns."""
        add = self.add
        value = add("choose", add("shift", turned.turns, data=63), odd, even)
        return add("mend", add("xor", value, sign), turned.near, x, data=name)

    def _sign(self, turned: Turned, bit: int) -> Name:
        """Bit 0 (by 63) or bit 1 (by 62) of the number of quarter turns, as a sign."""
        moved = self.add("shift", turned.turns, data=bit)
        return self.add("and", moved, self.listing.bits(SIGN))

    def _turned(self, x: Name) -> Turned:
        if x not in self.turned:
            add, number = self.add, self.listing.number
            turns = add("fma", x, number(TURNS), number(WHOLE))
            n, r = add("sub", turns, number(WHOLE)), x
            for part in QUARTER_TURN:
                r = add("fnma", n, number(part), r)
            sine, cosine = self.polynomials(r, add("mul", r, r))
            near = add("lt", self.fabs(x), number(TURNS_LIMIT))
            self.turned[x] = Turned(sine, cosine, turns, near)
        return self.turned[x]

    def polynomials(self, r: Name, z: Name) -> tuple[Name, Name]:
        """Sine and cosine of an angle within a quarter turn about zero, z its square."""
        add, number = self.add, self.listing.number
        sine = add("fma", add("mul", r, z), self.polynomial(z, SINE), r)
        most = add("fnma", number(0.5), z, number(1.0))
        return sine, add("fma", add("mul", z, z), self.polynomial(z, COSINE), most)

    def arc(self, y: Name, x: Name) -> Name:
        """As `atan2_v`: the arc of lesser over greater coordinate, and eighths of a turn."""
        add, number, bits = self.add, self.listing.number, self.listing.bits
        across, along = self.fabs(y), self.fabs(x)
        total = add("add", across, along)
        steep, back = add("lt", along, across), add("lt", x, number(0.0))
        most, least = add("choose", steep, across, along), add("choose", steep, along, across)
        wide = add("lt", add("mul", number(0.5), most), least)
        top = add("choose", wide, add("sub", least, most), least)
        t = add("div", top, add("choose", wide, total, most))
        z = add("mul", t, t)
        zz = add("mul", z, z)
        odd, even = self.polynomial(zz, ARC[1::2]), self.polynomial(zz, ARC[::2])
        arc = add("fma", t, add("mul", z, add("fma", z, odd, even)), t)
        eighths = self.truth(wide)
        eighths = add("choose", steep, add("sub", number(2.0), eighths), eighths)
        eighths = add("choose", back, add("sub", number(4.0), eighths), eighths)
        turned = add("and", add("xor", steep, back), bits(SIGN))
        arc = add("fma", eighths, number(EIGHTH_TURN[1]), add("xor", arc, turned))
        arc = self.copysign(add("fma", eighths, number(EIGHTH_TURN[0]), arc), y)
        plain = add("and", add("lt", number(0.0), total), add("lt", total, number(1e308)))
        return add("mend", arc, plain, y, x, data="atan2")


def integer(data: object) -> int:
    assert isinstance(data, int)
    return data
