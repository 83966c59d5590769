"""What an export is: C, and all that a caller of it must know.

Other targets (MEX files, FMUs) are written on this: they call `Function`s by their arguments and
never look into the source.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Precision = Literal["double", "float"]


@dataclass(frozen=True)
class Argument:
    """An array of a C function, one dimension, in the order of `labels`.

    name:   in C.
    text:   what it is, in a few words.
    labels: name of each entry, as the mechanism file has it.
    units:  of each entry.
    given:  whether it goes in; else it is written.
    port:   name of the input or result of the question, if it is one.
    """

    name: str
    text: str
    labels: tuple[str, ...]
    units: tuple[str, ...]
    given: bool
    port: str = ""

    @property
    def size(self) -> int:
        return len(self.labels)

    @property
    def unit(self) -> str:
        """One unit where all are alike, else one for each entry."""
        return self.units[0] if len(set(self.units)) == 1 else ", ".join(self.units)

    def declared(self, real: str) -> str:
        """As a parameter in C."""
        return f"{'const ' if self.given else ''}{real} {self.name}[{self.size}]"


@dataclass(frozen=True)
class Function:
    """One exported question.

    name:       in C.
    question:   in the catalogue (`inverse`, `motion` ..).
    text:       what it answers.
    iterations: so many steps, or at most; 0 where nothing is iterated.
    operations: floating-point operations, sine and cosine as one.
    statuses:   what it may return besides ok: name -> why.
    """

    name: str
    question: str
    text: str
    arguments: tuple[Argument, ...]
    iterations: int
    operations: int
    statuses: Mapping[str, str]

    @property
    def inputs(self) -> tuple[Argument, ...]:
        return tuple(a for a in self.arguments if a.given)

    @property
    def outputs(self) -> tuple[Argument, ...]:
        return tuple(a for a in self.arguments if not a.given)


@dataclass(frozen=True)
class Exported:
    """A mechanism in C.

    prefix:    what every name begins with.
    source:    text of `prefix`.c, C99.
    header:    text of `prefix`.h, C99 and C++.
    names:     names of chains, contacts and points -> their identifiers in C.
    struct:    whether constants stand in a structure that is given to every function, in place of
               inside.
    lanes:     width of the vector types, 0 where there are none.
    symbols:   functions of the C library that the source may call.
    recipe:    how the model is made that these functions are of: keywords of `condyle.derive`.
    """

    prefix: str
    source: str
    header: str
    functions: tuple[Function, ...]
    precision: Precision
    names: Mapping[str, str]
    struct: bool
    lanes: int
    symbols: tuple[str, ...]
    recipe: Mapping[str, Any]

    def __getitem__(self, question: str) -> Function:
        return next(f for f in self.functions if f.question == question)

    @property
    def context(self) -> str:
        """The first parameter of every function, where constants are a structure."""
        return f"const {self.prefix}_constants *constants" if self.struct else ""

    def prototype(self, function: Function) -> str:
        """Declaration of a function, without the semicolon."""
        parts = [a.declared(self.precision) for a in function.arguments]
        return f"int {function.name}({', '.join([self.context] * self.struct + parts)})"
