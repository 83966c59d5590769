"""Exceptions: each says what was got, what was expected and what to do.

Every error of the library derives from `CondyleError`; the command line prints its message on
stderr and exits with status 2. The facts behind a message are attributes of the exception, and
`to_dict` gives them for programs.
"""

from __future__ import annotations

import difflib
import os
import reprlib
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any, ClassVar

MANY = 10  # names of a list that a message shows
LONGEST = 3900  # characters of a message
LONGEST_NAME, MANY_CHOICES = 200, 5000  # limits of the search for a similar name

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 60
_SHORT.maxlevel = 3


class CondyleError(Exception):
    """Base of all errors of condyle.

    Whatever a file holds, the message can go to a terminal: see `printable`.

    Attributes: message: the problem;  hint: the remedy, where that is a sentence of
                its own. `str` of the error is both.
    """

    facts: ClassVar[tuple[str, ...]] = ()  # names of the attributes that `to_dict` gives besides

    def __init__(self, message: str = "", hint: str = "") -> None:
        self.message: str = printable(message)
        self.hint: str = printable(hint)
        whole = f"{self.message} {self.hint}" if hint else self.message
        super().__init__(shortened(whole, LONGEST))

    @property
    def kind(self) -> str:
        """ "unreachable" of an UnreachableError: for programs."""
        return type(self).__name__.removesuffix("Error").lower()

    def to_dict(self) -> dict[str, Any]:
        """Kind, message, hint, and the facts that are known, as JSON has them."""
        known = {name: getattr(self, name) for name in self.facts}
        said = {"kind": self.kind, "message": self.message, "hint": self.hint}
        return said | {name: value for name, value in known.items() if value not in (None, [])}

    def __reduce__(self) -> tuple[Callable[..., CondyleError], tuple[Any, ...]]:
        """Errors cross processes whole, whatever their `__init__` takes."""
        return _again, (type(self), self.args, self.__dict__)


def _again(kind: type[CondyleError], said: tuple[str, ...], facts: dict[str, Any]) -> CondyleError:
    error = kind.__new__(kind)
    error.args = said
    error.__dict__.update(facts)
    return error


class InputError(CondyleError):
    """A file, column, option or argument that cannot be used as given."""


class ProblemsError(InputError):
    """A file that breaks the rules of its format.

    Attributes: source: the file;  problems: one line each, all that were found; the message shows
                as many as a person reads.
    """

    facts: ClassVar[tuple[str, ...]] = ("source", "problems")

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source: str = short(source, 200)
        self.problems: list[str] = [short(p, 380) for p in problems]
        count = "1 problem" if len(self.problems) == 1 else f"{len(self.problems)} problems"
        super().__init__("\n".join([f"{self.source}: {count}", *self._lines()]))

    def _lines(self) -> list[str]:
        """The problems in rows, as long as there is room for them."""
        lines: list[str] = []
        room = LONGEST - 300
        for k, problem in enumerate(self.problems):
            room -= len(problem) + 5
            if room < 0:
                return [*lines, f"  - and {len(self.problems) - k} more"]
            lines.append(f"  - {problem}")
        return lines


class MechanismError(ProblemsError):
    """A mechanism that breaks the rules of the file format."""


class ScenarioError(ProblemsError):
    """A scenario that breaks the rules of the file format, or does not fit its mechanism."""


class UnsupportedError(CondyleError):
    """Options that cannot be combined; the message names some that can."""


class WarningError(CondyleError):
    """Warnings as errors (`--strict`).

    Attributes: warnings: all of them.
    """

    facts: ClassVar[tuple[str, ...]] = ("warnings",)

    def __init__(self, warnings: Iterable[str]) -> None:
        self.warnings: list[str] = list(warnings)
        super().__init__("; ".join(self.warnings) + ".", "Without --strict this is a warning")


class CondyleWarning(UserWarning):
    """Python's warning of what is valid and suggests a slip, such as a wrong unit.

    `warnings.simplefilter("ignore", CondyleWarning)` silences it.
    """


class MissingExtraError(CondyleError):
    """A package that is not installed, because only part of condyle needs it.

    Attributes: package;  extra: what to install with, as in `pip install "condyle[view]"`.
    """

    facts: ClassVar[tuple[str, ...]] = ("package", "extra")

    def __init__(self, package: str, extra: str) -> None:
        self.package: str = package
        self.extra: str = extra
        super().__init__(
            f"this needs {package}, which is not installed.",
            f'Install it: pip install "condyle[{extra}]"',
        )


class SampleError(CondyleError):
    """Samples that cannot be computed.

    Attributes: samples: their indices, in order; what follows is of the first:
                chain, contact: name of the one that is the cause;  time: [s], along a motion;
                row: of a table, from 1;
                value, bound, unit: the value got, and its limit.
    """

    facts: ClassVar[tuple[str, ...]] = (
        *("sample", "count", "time", "row", "chain", "contact", "value", "bound", "unit"),
    )

    def __init__(
        self,
        message: str,
        samples: Sequence[int] = (),
        *,
        hint: str = "",
        chain: str | None = None,
        contact: str | None = None,
        time: float | None = None,
        row: int | None = None,
        value: float | None = None,
        bound: float | None = None,
        unit: str | None = None,
    ) -> None:
        self.samples: list[int] = list(samples)
        self.chain: str | None = chain
        self.contact: str | None = contact
        self.time: float | None = time
        self.row: int | None = row
        self.value: float | None = value
        self.bound: float | None = bound
        self.unit: str | None = unit
        super().__init__(message, hint)

    @property
    def sample(self) -> int | None:
        """Index of the first sample."""
        return self.samples[0] if self.samples else None

    @property
    def count(self) -> int:
        """How many samples."""
        return len(self.samples)


class UnreachableError(SampleError):
    """A pose that a chain or the contacts cannot reach."""


class OverlapError(UnreachableError):
    """A pose at which the ball of a contact overlaps its surface beside where it touches."""


class LostError(SampleError):
    """Joint coordinates whose assembly mode is ambiguous."""


class InconsistentError(SampleError):
    """Joint coordinates for which forward kinematics did not converge."""


class SingularError(SampleError):
    """A pose at which the efforts are not determined."""


class NumberRangeError(SingularError):
    """Rates, accelerations or a load so large that the efforts are not finite."""

    @property
    def kind(self) -> str:
        return "overflow"


class InfeasibleError(SampleError):
    """A sample that efforts within the limits cannot balance.

    Attributes: value: smallest factor on all limits that would make it feasible, inf where there is
                none;  bound: 1.
    """


class JammedError(SampleError):
    """A sample at which Coulomb friction has no solution: the mechanism jams."""


class AmbiguousError(SampleError):
    """A sample at which several motions follow from the same efforts, under Coulomb friction."""


class UncertifiedError(SampleError):
    """Efforts that could not be certified to the stated accuracy."""


class AccuracyError(SampleError):
    """A sample that is less accurate than required.

    Attributes: value: the bound of its relative error;  bound: the one that is required.
    """


class GimbalLockError(SampleError):
    """A pose at which the rates of the Bryant angles do not determine the angular velocity's."""


def did_you_mean(name: object, available: Iterable[str]) -> str:
    """' Did you mean "x"? Available: ...' for a name that is not among `available`."""
    choices = sorted(available)
    near = nearest(name, choices) if isinstance(name, str) else []
    guess = f' Did you mean "{join(near[:1])}"?' if near else ""
    listed = f" Available: {join(choices)}." if choices else " None is available."
    return guess + listed


def texts_of(argument: str, given: object, separated: bool = True) -> tuple[str, ...]:
    """One text or several; `separated`: by commas too.

    Raises: InputError: for anything else.
    """
    texts = [given] if isinstance(given, str) else given
    if not isinstance(texts, list | tuple) or not all(isinstance(one, str) for one in texts):
        raise InputError(f"{argument}: expected a name or several, got {brief(given)}")
    parts = (text.split(",") if separated else [text] for text in texts)
    return tuple(part.strip() for group in parts for part in group)


def join(names: Iterable[str], quote: str = "") -> str:
    """'a, b, c' of names, each between quotes, and of many the first ten."""
    names = list(names)
    more = f" and {len(names) - MANY} more" if len(names) > MANY else ""
    return ", ".join(f"{quote}{short(name, 80)}{quote}" for name in names[:MANY]) + more


def quoted(names: Iterable[str]) -> str:
    """'"a", "b"' of names, and of many the first ten."""
    return join(names, '"')


def printable(text: object, lines: bool = True) -> str:
    """Text whose control characters are escaped: it cannot move a cursor or hide its neighbours.

    Args: lines: whether it may have more than one.
    """
    allowed = "\n" if lines else ""
    text = str(text)
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in allowed else c.encode("unicode_escape").decode() for c in text
    )


def shortened(text: str, length: int) -> str:
    """Text of at most `length` characters; a longer one ends in dots."""
    return text if len(text) <= length else f"{text[: length - 3]}..."


def short(text: object, length: int = 40) -> str:
    """The beginning of a text in one line of a message."""
    return shortened(printable(text, lines=False), length)


def brief(value: object) -> str:
    """A value in one line of a message, at most 60 characters of it."""
    try:
        return short(" ".join(_SHORT.repr(value).split()), 60)
    except Exception:  # integers of thousands of digits, objects whose repr fails
        return f"an {type(value).__name__} that cannot be shown"


def nearest(name: str, available: Iterable[str]) -> list[str]:
    """Up to three names like `name`, the most alike first; the same in other letters counts."""
    choices = sorted(available)
    same = [choice for choice in choices if choice.casefold() == name.casefold()]
    if same or len(name) > LONGEST_NAME or len(choices) > MANY_CHOICES:
        return same  # the search for near ones takes the time of all pairs of letters
    return difflib.get_close_matches(name, choices, n=3)


def as_path(given: Any, name: str = "path", expected: str = "the path of a file") -> str:
    """The path of a file, as text; `name` is the argument's.

    Raises: InputError: for anything but the name of a file.
    """
    with suppress(TypeError, ValueError):
        path = os.fspath(given)
        if isinstance(path, str) and path and "\0" not in path and os.fsencode(path):
            return path
    raise InputError(f"{name}: expected {expected}, got {brief(given)}")


def as_name(given: Any, argument: str) -> str:
    """A name, as text; which ones there are is the caller's to check.

    Raises: InputError: for anything but text.
    """
    if isinstance(given, str):
        return given
    raise InputError(f"{argument}: expected a name, got {brief(given)}")


def as_flag(given: Any, name: str) -> bool:
    """True or False.

    Raises: InputError: for anything else, such as an array.
    """
    with suppress(Exception):
        return bool(given)
    raise InputError(f"{name}: expected True or False, got {brief(given)}")
