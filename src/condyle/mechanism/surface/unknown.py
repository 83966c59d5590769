"""What a file keeps of a surface that was written in Python: that there was one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NoReturn

from ...errors import InputError
from .smooth import Smooth


@dataclass(frozen=True)
class Unknown(Smooth):
    """The place of an `Expression` in the mechanism of a solution that came from a file.

    It says what the surface was called and whether it was `closed`; whatever asks for its equation
    gets an InputError.
    """

    closed: bool = False

    kind: ClassVar[str] = "expression"
    known: ClassVar[bool] = False

    def phi(self, point: Any, constants: Any = None) -> NoReturn:
        raise InputError(
            "this mechanism comes from a solution and had a surface written in Python, of which a "
            "file keeps only a note. To compute with it, build it again in Python, or put the "
            "Expression back with mechanism.replace(contacts=...)"
        )

    def constants(self) -> NoReturn:
        self.phi(None)

    @property
    def form(self) -> NoReturn:
        self.phi(None)

    def parallel(self, distance: float, point: Any) -> NoReturn:
        self.phi(None)
