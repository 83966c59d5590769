"""Assembly for AVX2 and AVX-512, as a C compiler takes it at file scope (AT&T's order of operands).

    batch:  step(table, in, at, out, literals)     in rdi, rsi, rdx, rcx, r8
    single: quick(table, in, out, literals)        in rdi, rsi, rdx, rcx

AVX-512 spreads a number from memory over the lanes as it reads it; for AVX2 literals, and the table
of a batch, stand spread in memory.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator

from .allocate import CALLS, LOGIC, Move, Place, allocated
from .listing import Home, Listing
from .order import ordered

THREE = {"add": "vadd", "sub": "vsub", "mul": "vmul", "div": "vdiv", "min": "vmin", "max": "vmax"}
THREE |= {"and": "vand", "or": "vor", "xor": "vxor"}
FUSED = {"fma": "vfmadd", "fnma": "vfnmadd", "fms": "vfmsub"}
PREDICATE = {"lt": 1, "le": 2, "eq": 0, "ne": 4}
COMMUTATIVE = ("add", "mul", "and", "or", "xor")
REGISTERS = {4: 16, 8: 32}
NAMES = {1: "xmm", 2: "xmm", 4: "ymm", 8: "zmm"}
HALVES = {0: "0x20", 3: "0x31"}  # AVX2's names of AVX-512's choices


def is_spread(width: int) -> bool:
    """Whether literals, and the table of a batch, have each number for every lane."""
    return width != 8


class Assembly(ABC):
    """A listing for registers of `width` lanes, 4 or 8.

    Attributes: moves: what is printed;  slots: places on the stack;  called: functions of the C
                library that it asks for, and how many arguments they take.
    """

    hurried: bool  # see `ordered`
    parameters: str  # of the C function, without the literals
    saved: tuple[str, ...]  # registers of the function's arguments

    def __init__(self, listing: Listing, width: int) -> None:
        self.listing, self.width = listing, width
        self.registers = REGISTERS[width]
        order = ordered(listing.code, self.registers, self.hurried)
        self.moves, self.slots = allocated(order, self.registers)
        self.literals = [home.number for home in listing.homes if home.kind == "literal"]
        self._at = {bits: i for i, bits in enumerate(self.literals)}
        self.called = {str(m.data): len(_given(m)) for m in self.moves if m.op in CALLS}

    def text(self, name: str) -> str:
        """C in which the function `name`_ is, and its literals."""
        copies = self.width if is_spread(self.width) else 1
        literals = ", ".join(f"{bits:#x}" for bits in self.literals for _ in range(copies))
        return "\n".join(
            [
                *(self._lanewise(name, *called) for called in self.called.items()),
                *("__asm__(", *(f'"{line}\\n"' for line in self.lines(f"condyle_{name}")), ");"),
                f"HIDDEN void {name}_({self.parameters}, const uint64_t *literals)",
                f'    __asm__("condyle_{name}");',
                f"static const uint64_t {name}_literals[] __attribute__((aligned(64))) = ",
                f"    {{{literals or 0}}};",
                "",
            ]
        )

    def lines(self, name: str) -> Iterator[str]:
        """The function, and what it does seldom behind it."""
        size = 8 * self.width
        area = size * self.slots
        frame = area + (size * self.registers + 8 * len(self.saved) if self.called else 0)
        yield from (".text", ".p2align 6", f".globl {name}", f"{name}:")
        yield from ("pushq %rbp", "movq %rsp, %rbp", f"subq ${frame}, %rsp", "andq $-64, %rsp")
        seldom: list[str] = []
        for move in self.moves:
            if move.op in CALLS:
                label = f"{len(seldom)}{name}"
                yield from self._asked(move, label)
                seldom += [*self._call(name, move, label, area)]
            else:
                yield from self._printed(move)
        yield from ("vzeroupper", "leave", "ret", *seldom)

    def _printed(self, move: Move) -> Iterator[str]:
        op, to, args, data, lanes = move
        yield from (line for a in args for line in self._pointer(a))
        # Logic of one number is that of two.
        source = [self._operand(a, 2 if op in LOGIC and lanes == 1 else lanes) for a in args]
        if to is None:
            yield f"{self._move(lanes)} {source[0]}, {self.output(_integer(data))}"
            return
        target = self._operand(to, lanes)
        last = ", ".join([*reversed(source), target])
        word = "sd" if lanes == 1 else "pd"
        if op in ("load", "store", "copy"):
            yield self._moved(move, source[0], target)
        elif op in FUSED:
            yield self._fused(move, source, target)
        elif op in PREDICATE:
            mask = "%k1" if self.width == 8 else target
            yield f"vcmp{word} ${PREDICATE[op]}, {source[1]}, {source[0]}, {mask}"
            if self.width == 8:
                yield f"vpmovm2q %k1, {target}"
        elif op == "choose":
            if self.width == 8:
                yield f"vpmovq2m {source[0]}, %k1"
                yield f"vblendmpd {source[1]}, {source[2]}, {target}{{%k1}}"
            else:
                yield f"vblendvpd {', '.join(source)}, {target}"
        elif op == "shift":
            yield f"vpsllq ${data}, {last}"
        elif op == "sqrt":
            # Of one number the rest of the register comes from an operand: one that is there.
            first = f"{source[0]}, " if lanes == 1 and args[0].kind == "register" else ""
            first = first or (f"{target}, " if lanes == 1 else "")
            yield f"vsqrt{word} {source[0]}, {first}{target}"
        elif op == "rsqrt":
            yield f"vrsqrt14pd {last}"
        elif op == "spread":
            yield f"vbroadcastsd {self._operand(args[0], 1)}, {target}"
        elif op == "unpack":
            yield f"vunpck{'h' if data else 'l'}pd {last}"
        elif op == "extract":
            yield self._extracted(lanes, args[0], target)
        elif op == "halves":
            which = data if self.width == 8 else HALVES[_integer(data)]
            yield f"{'vshuff64x2' if self.width == 8 else 'vperm2f128'} ${which}, {last}"
        else:
            if op in COMMUTATIVE and args[0].kind != "register":
                source.reverse()
            word = "pd" if op in LOGIC else word
            yield f"{THREE[op]}{word} {', '.join([*reversed(source), target])}"

    def _extracted(self, lanes: int, source: Place, target: str) -> str:
        """The upper half of twice the lanes."""
        word = "vextractf64x4" if lanes == 4 else "vextractf128"
        word = "vextractf64x2" if lanes == 2 and self.width == 8 else word
        return f"{word} $1, {self._register(source.number, 2 * lanes)}, {target}"

    def _move(self, lanes: int) -> str:
        return "vmovsd" if lanes == 1 else "vmovupd"

    def _moved(self, move: Move, source: str, target: str) -> str:
        """A value that goes from one place to another; of copies the whole register."""
        assert move.to is not None
        if move.op == "copy":
            whole = (self._register(p.number, 0) for p in (move.args[0], move.to))
            return f"vmovapd {', '.join(whole)}"
        if move.args[0].kind == "home":
            return self.loaded(self._home(move.args[0]), move.to.number)
        return f"{self._move(move.lanes)} {source}, {target}"

    def _fused(self, move: Move, source: list[str], target: str) -> str:
        """a b + c, in the form whose result stands where one of the three stood."""
        a, b, c = source
        word, kind = FUSED[move.op], "sd" if move.lanes == 1 else "pd"
        if c == target:
            if move.args[0].kind != "register":
                a, b = b, a
            return f"{word}231{kind} {b}, {a}, {target}"
        other = b if a == target else a
        in_memory = move.args[1 if a == target else 0].kind != "register"
        form, last, middle = ("132", other, c) if in_memory else ("213", c, other)
        return f"{word}{form}{kind} {last}, {middle}, {target}"

    # -- what is asked of the C library ------------------------------------------------------

    def _lanewise(self, name: str, called: str, arity: int) -> str:
        """C's function of each lane that is not plain."""
        function = called if called in ("sin", "cos") else f"{called}_s"
        given = ", ".join(f"{argument}[i]" for argument in ("x", "y")[:arity])
        own, arguments = f"{name}_mend_{called}", "const int64_t *plain, const double *x,"
        return (
            f"HIDDEN void {own}(double *, {arguments} const double *, int)\n"
            f'    __asm__("condyle_{own}");\n'
            f"void {own}(double *value, {arguments} const double *y, int lanes) {{\n"
            "    (void)y;\n"
            "    for (int i = 0; i < lanes; i++)\n"
            f"        if (!plain || plain[i] >= 0) value[i] = {function}({given});\n"
            "}"
        )

    def _asked(self, move: Move, label: str) -> Iterator[str]:
        """A jump aside: always, or where a lane of the mask is not set."""
        if move.op == "call":
            yield f"jmp .Lcall{label}"
        else:
            mask, lanes = self._operand(move.args[1], move.lanes), move.lanes or self.width
            if self.width == 8:
                yield from (f"vpmovq2m {mask}, %k1", "kmovb %k1, %eax")
            else:
                yield f"vmovmskpd {mask}, %eax"
            yield from ("notl %eax", f"testb ${(1 << lanes) - 1}, %al", f"jne .Lcall{label}")
        yield f".Lback{label}:"

    def _call(self, name: str, move: Move, label: str, area: int) -> Iterator[str]:
        """The function changes the saved image of its first argument, lane by lane."""
        size = 8 * self.width
        above = area + size * self.registers
        mask = move.args[1:2] if move.op == "mend" else ()
        images = zip(("%rdx", "%rcx"), _given(move), strict=False)
        yield f".Lcall{label}:"
        for k in range(self.registers):
            yield f"vmovupd {self._register(k, 0)}, {area + size * k}(%rsp)"
        yield from (f"movq {r}, {above + 8 * i}(%rsp)" for i, r in enumerate(self.saved))
        yield "xorl %esi, %esi"
        for register, place in (("%rdi", move.args[0]), *(("%rsi", m) for m in mask), *images):
            yield f"leaq {area + size * place.number}(%rsp), {register}"
        yield f"movl ${move.lanes or self.width}, %r8d"
        yield from ("vzeroupper", f"call {name}_mend_{move.data}")
        yield from (f"movq {above + 8 * i}(%rsp), {r}" for i, r in enumerate(self.saved))
        for k in range(self.registers):
            yield f"vmovupd {area + size * k}(%rsp), {self._register(k, 0)}"
        yield f"jmp .Lback{label}"

    # -- operands ----------------------------------------------------------------------------

    @abstractmethod
    def output(self, number: int) -> str:
        """Where an output goes."""

    @abstractmethod
    def address(self, home: Home) -> str:
        """Where a number, or a vector, is."""

    @abstractmethod
    def is_number(self, home: Home) -> bool:
        """Whether a place has one number alone, which has to be spread for more lanes."""

    def loaded(self, home: Home, register: int) -> str:
        """What stands in memory from the start, in a register: in all lanes."""
        word = "vbroadcastsd" if self.is_number(home) else "vmovupd"
        return f"{word} {self.address(home)}, {self._register(register, 0)}"

    def literal(self, bits: int, base: str) -> str:
        return f"{(8 * self.width if is_spread(self.width) else 8) * self._at[bits]}({base})"

    def _register(self, number: int, lanes: int) -> str:
        return f"%{NAMES[lanes or self.width]}{number}"

    def _home(self, place: Place) -> Home:
        return self.listing.home(place.number)

    def _pointer(self, place: Place) -> Iterator[str]:
        """Instructions that `address` needs before it."""
        yield from ()

    def _operand(self, place: Place, lanes: int) -> str:
        if place.kind == "register":
            return self._register(place.number, lanes)
        if place.kind == "slot":
            return f"{8 * self.width * place.number}(%rsp)"
        home, lanes = self._home(place), lanes or self.width
        spread = self.width == 8 and self.is_number(home)
        return self.address(home) + (f"{{1to{lanes}}}" if spread and lanes > 1 else "")


class Batch(Assembly):
    """A step of a batch: samples stand in columns, whose addresses are in `in`."""

    hurried = False
    parameters = "const double *table, const double *const *in, size_t at, vec *out"
    saved = ("%rdi", "%rsi", "%rdx", "%rcx", "%r8")

    def text(self, name: str) -> str:
        call = f"{name}_(table, in, at, out, {name}_literals)"
        inline = f"INLINE void {name}({self.parameters}) {{ {call}; }}\n"
        return super().text(name) + inline

    def output(self, number: int) -> str:
        return f"{8 * self.width * number}(%rcx)"

    def address(self, home: Home) -> str:
        if home.kind == "sample":
            return "(%rax,%rdx,8)"
        if home.kind == "literal":
            return self.literal(home.number, "%r8")
        return f"{8 * home.number * (self.width if is_spread(self.width) else 1)}(%rdi)"

    def is_number(self, home: Home) -> bool:
        return self.width == 8 and home.kind != "sample"

    def _pointer(self, place: Place) -> Iterator[str]:
        if place.kind == "home" and self._home(place).kind == "sample":
            yield f"movq {8 * self._home(place).number}(%rsi), %rax"


class Single(Assembly):
    """One evaluation: `int name(table, in, out)`, whether every check is met beyond doubt."""

    hurried = True
    parameters = "const double *table, const double *in, double *out"
    saved = ("%rdi", "%rsi", "%rdx", "%rcx")

    def text(self, name: str) -> str:
        return super().text(name) + (
            f"HIDDEN int {name}({self.parameters}) {{\n"
            f"    {name}_(table, in, out, {name}_literals);\n"
            "    return sure(out + OUTPUTS);\n"
            "}\n"
        )

    def output(self, number: int) -> str:
        return f"{8 * number}(%rdx)"

    def address(self, home: Home) -> str:
        if home.kind == "literal":
            return self.literal(home.number, "%rcx")
        return f"{8 * home.number}({'%rsi' if home.kind in ('given', 'given_row') else '%rdi'})"

    def is_number(self, home: Home) -> bool:
        return home.kind in ("table", "given") or (home.kind == "literal" and self.width == 8)

    def loaded(self, home: Home, register: int) -> str:
        if self.width != 8 and self.is_number(home):
            return f"vmovsd {self.address(home)}, {self._register(register, 1)}"
        return super().loaded(home, register)


def _given(move: Move) -> tuple[Place, ...]:
    """What a function of the C library is given: all but the value that it mends, and the mask."""
    return move.args[2 if move.op == "mend" else 1 :]


def _integer(data: object) -> int:
    assert isinstance(data, int)
    return data
