"""Assembly for AVX2 and AVX-512, as a C compiler takes it at file scope (AT&T's order of operands).

    step(table, in, at, out, literals)    in rdi, rsi, rdx, rcx, r8

AVX-512 spreads a number from memory over the lanes as it reads it; for AVX2, table and literals
stand spread in memory.
"""

from __future__ import annotations

from collections.abc import Iterator

from .allocate import CALLS, Move, Place, allocated
from .listing import Home, Listing
from .order import ordered

THREE = {"add": "vaddpd", "sub": "vsubpd", "mul": "vmulpd", "div": "vdivpd", "sqrt": "vsqrtpd"}
THREE |= {"min": "vminpd", "max": "vmaxpd", "and": "vandpd", "or": "vorpd", "xor": "vxorpd"}
THREE |= {"rsqrt": "vrsqrt14pd"}
FUSED = {"fma": "vfmadd", "fnma": "vfnmadd", "fms": "vfmsub"}
PREDICATE = {"lt": 1, "le": 2, "eq": 0, "ne": 4}
COMMUTATIVE = ("add", "mul", "and", "or", "xor")
SAVED = ("%rdi", "%rsi", "%rdx", "%rcx", "%r8")
REGISTERS = {4: 16, 8: 32}


def is_spread(width: int) -> bool:
    """Whether table and literals have each number for every lane."""
    return width != 8


class Assembly:
    """A listing for registers of `width` lanes, 4 or 8.

    Attributes: moves: what is printed;  slots: places on the stack;  called: functions of the C
                library that it asks for, and how many arguments they take.
    """

    def __init__(self, listing: Listing, width: int) -> None:
        self.listing, self.width = listing, width
        self.registers = REGISTERS[width]
        self.moves, self.slots = allocated(ordered(listing.code, self.registers), self.registers)
        self.literals = [home.number for home in listing.homes if home.kind == "literal"]
        self._at = {bits: i for i, bits in enumerate(self.literals)}
        self.called = {str(m.data): len(_given(m)) for m in self.moves if m.op in CALLS}

    def text(self, name: str) -> str:
        """C in which `name` is a function (table, in, at, out)."""
        copies = self.width if is_spread(self.width) else 1
        literals = ", ".join(f"{bits:#x}" for bits in self.literals for _ in range(copies))
        arguments = "const double *table, const double *const *in, size_t at, vec *out"
        return "\n".join(
            [
                *(self._lanewise(*called) for called in self.called.items()),
                *("__asm__(", *(f'"{line}\\n"' for line in self.lines(f"condyle_{name}")), ");"),
                f"HIDDEN void {name}_({arguments}, const uint64_t *literals)",
                f'    __asm__("condyle_{name}");',
                f"static const uint64_t literals[] __attribute__((aligned(64))) = {{{literals}}};",
                f"INLINE void {name}({arguments}) {{ {name}_(table, in, at, out, literals); }}",
                "",
            ]
        )

    def _lanewise(self, name: str, arity: int) -> str:
        """C's function of each lane that is not plain."""
        function = name if name in ("sin", "cos") else f"{name}_s"
        given = ", ".join(f"{argument}[i]" for argument in ("x", "y")[:arity])
        return (
            f"HIDDEN void mend_{name}(double *, const int64_t *, const double *, const double *)\n"
            f'    __asm__("condyle_mend_{name}");\n'
            f"void mend_{name}(double *value, const int64_t *plain, const double *x,"
            " const double *y) {\n"
            "    (void)y;\n"
            "    for (int i = 0; i < W; i++)\n"
            f"        if (!plain || plain[i] >= 0) value[i] = {function}({given});\n"
            "}"
        )

    def lines(self, name: str) -> Iterator[str]:
        """The function, and what it does seldom behind it."""
        size = 8 * self.width
        area = size * self.slots
        frame = area + (size * self.registers + 8 * len(SAVED) if self.called else 0)
        yield from (".text", ".p2align 6", f".globl {name}", f"{name}:")
        yield from ("pushq %rbp", "movq %rsp, %rbp", f"subq ${frame}, %rsp", "andq $-64, %rsp")
        seldom: list[str] = []
        for move in self.moves:
            if move.op in CALLS:
                label = f"{len(seldom)}{name}"
                yield from self._asked(move, label)
                seldom += [*self._call(move, label, area)]
            else:
                yield from self._printed(move)
        yield from ("leave", "ret", *seldom)

    def _printed(self, move: Move) -> Iterator[str]:
        op, to, args, data = move
        yield from (self._pointer(self._home(a)) for a in args if self._is_input(a))
        source = [self._operand(a) for a in args]
        if to is None:
            yield f"vmovupd {source[0]}, {8 * self.width * _integer(data)}(%rcx)"
            return
        target = self._operand(to)
        if op in ("load", "store", "copy"):
            spread = "{" in source[0]
            word = "vbroadcastsd" if spread else "vmovupd" if op == "load" else "vmovapd"
            yield f"{word} {source[0].split('{')[0] if spread else source[0]}, {target}"
        elif op in FUSED:
            yield self._fused(move, source, target)
        elif op in PREDICATE:
            mask = "%k1" if self.width == 8 else target
            yield f"vcmppd ${PREDICATE[op]}, {source[1]}, {source[0]}, {mask}"
            if self.width == 8:
                yield f"vpmovm2q %k1, {target}"
        elif op == "choose":
            mask, one, other = source
            if self.width == 8:
                yield f"vpmovq2m {mask}, %k1"
                yield f"vblendmpd {one}, {other}, {target}{{%k1}}"
            else:
                yield f"vblendvpd {mask}, {one}, {other}, {target}"
        elif op == "shift":
            yield f"vpsllq ${data}, {source[0]}, {target}"
        else:
            if op in COMMUTATIVE and args[0].kind != "register":
                source.reverse()
            yield f"{THREE[op]} {', '.join([*reversed(source), target])}"

    def _fused(self, move: Move, source: list[str], target: str) -> str:
        """a b + c, in the form whose result stands where one of the three stood."""
        a, b, c = source
        word = FUSED[move.op]
        if c == target:
            if move.args[0].kind != "register":
                a, b = b, a
            return f"{word}231pd {b}, {a}, {target}"
        other = b if a == target else a
        in_memory = move.args[1 if a == target else 0].kind != "register"
        form, last, middle = ("132", other, c) if in_memory else ("213", c, other)
        return f"{word}{form}pd {last}, {middle}, {target}"

    # -- what is asked of the C library ------------------------------------------------------

    def _asked(self, move: Move, label: str) -> Iterator[str]:
        """A jump aside: always, or where a lane of the mask is not set."""
        if move.op == "call":
            yield f"jmp .Lcall{label}"
        elif self.width == 8:
            yield f"vpmovq2m {self._operand(move.args[1])}, %k1"
            yield from ("kmovb %k1, %eax", "cmpb $-1, %al", f"jne .Lcall{label}")
        else:
            yield f"vmovmskpd {self._operand(move.args[1])}, %eax"
            yield from ("cmpl $15, %eax", f"jne .Lcall{label}")
        yield f".Lback{label}:"

    def _call(self, move: Move, label: str, area: int) -> Iterator[str]:
        """The function changes the saved image of its first argument, lane by lane."""
        size = 8 * self.width
        above = area + size * self.registers
        mask = move.args[1:2] if move.op == "mend" else ()
        images = zip(("%rdx", "%rcx"), _given(move), strict=False)
        yield f".Lcall{label}:"
        for k in range(self.registers):
            yield f"vmovupd {self._register(k)}, {area + size * k}(%rsp)"
        yield from (f"movq {r}, {above + 8 * i}(%rsp)" for i, r in enumerate(SAVED))
        yield "xorl %esi, %esi"
        for register, place in (("%rdi", move.args[0]), *(("%rsi", m) for m in mask), *images):
            yield f"leaq {area + size * place.number}(%rsp), {register}"
        yield from ("vzeroupper", f"call condyle_mend_{move.data}")
        yield from (f"movq {above + 8 * i}(%rsp), {r}" for i, r in enumerate(SAVED))
        for k in range(self.registers):
            yield f"vmovupd {area + size * k}(%rsp), {self._register(k)}"
        yield f"jmp .Lback{label}"

    # -- operands ----------------------------------------------------------------------------

    def _register(self, number: int) -> str:
        return f"%{'zmm' if self.width == 8 else 'ymm'}{number}"

    def _home(self, place: Place) -> Home:
        return self.listing.home(place.number)

    def _is_input(self, place: Place) -> bool:
        return place.kind == "home" and self._home(place).kind == "input"

    def _pointer(self, home: Home) -> str:
        return f"movq {8 * home.number}(%rsi), %rax"

    def _operand(self, place: Place) -> str:
        if place.kind == "register":
            return self._register(place.number)
        if place.kind == "slot":
            return f"{8 * self.width * place.number}(%rsp)"
        kind, number = self._home(place)
        if kind == "input":
            return "(%rax,%rdx,8)"
        base, at = ("%rdi", number) if kind == "table" else ("%r8", self._at[number])
        return f"{8 * at}({base}){{1to8}}" if self.width == 8 else f"{32 * at}({base})"


def _given(move: Move) -> tuple[Place, ...]:
    """What a function of the C library is given: all but the value that it mends, and the mask."""
    return move.args[2 if move.op == "mend" else 1 :]


def _integer(data: object) -> int:
    assert isinstance(data, int)
    return data
