"""What can go wrong, each said in a way that helps: what was got, what was expected, what to do.

Every error of the library derives from `CondyleError`; the command line prints its message on
stderr and exits with status 2. The facts behind a message are attributes of the exception.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

MANY = 10  # names of a list that a message shows
LONGEST = 3900  # characters of a message
LONGEST_NAME, MANY_CHOICES = 200, 5000  # among which a name that is alike is looked for


class CondyleError(Exception):
    """Base of all errors that condyle raises on purpose.

    Whatever a file holds, the message can go to a terminal: see `printable`.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(shortened(printable(message), LONGEST))


class InputError(CondyleError):
    """A file, column, option or argument that cannot be used as given."""


class MechanismError(InputError):
    """A mechanism that breaks the rules of the file format.

    Attributes: problems: one line each, all that were found; the message shows as many as a
                person reads.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = shortened(printable(source, lines=False), 200)
        self.problems = [shortened(printable(p, lines=False), 380) for p in problems]
        count = "1 problem" if len(self.problems) == 1 else f"{len(self.problems)} problems"
        super().__init__("\n".join([f"{self.source}: {count}", *self._lines()]))

    def __reduce__(self) -> tuple[type[MechanismError], tuple[str, list[str]]]:
        return type(self), (self.source, self.problems)

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


class UnsupportedError(CondyleError):
    """A combination of options that has no meaning; the message names one that has."""


class SampleError(CondyleError):
    """Samples that cannot be computed.

    Attributes: samples: their indices, in order.
    """

    def __init__(self, message: str, samples: Sequence[int]) -> None:
        self.samples = list(samples)
        super().__init__(message)


class UnreachableError(SampleError):
    """A pose that a chain or the contacts cannot reach."""


class LostError(SampleError):
    """Joint coordinates of which it is no longer certain to which assembly mode they belong."""


class InconsistentError(SampleError):
    """Joint coordinates that no pose near the one found has."""


class SingularError(SampleError):
    """A pose at which the torques are not determined."""


class BoundsError(SampleError):
    """A contact outside its bounds, where that was asked to be an error."""


def did_you_mean(name: str, available: Iterable[str]) -> str:
    """' Did you mean "x"? Available: ...' for a name that is not among `available`."""
    choices = sorted(available)
    near = nearest(name, choices)
    guess = f' Did you mean "{near[0]}"?' if near else ""
    listed = f" Available: {few(choices)}." if choices else " None is available."
    return guess + listed


def few(names: Iterable[str]) -> str:
    """'a, b, c' of names, and of many the first ten."""
    names = list(names)
    more = f" and {len(names) - MANY} more" if len(names) > MANY else ""
    return ", ".join(shortened(name, 80) for name in names[:MANY]) + more


def printable(text: object, lines: bool = True) -> str:
    """Text whose control characters are escaped: it cannot move a cursor or hide its neighbours.

    Args: lines: whether it may have more than one.
    """
    kept = "\n" if lines else ""
    text = str(text)
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c in kept else c.encode("unicode_escape").decode() for c in text
    )


def shortened(text: str, length: int) -> str:
    """Text of at most so many characters, ended with dots where it was longer."""
    return text if len(text) <= length else f"{text[: length - 3]}..."


def nearest(name: str, available: Iterable[str]) -> list[str]:
    """Up to three names like `name`, the most alike first; the same in other letters counts."""
    choices = sorted(available)
    same = [choice for choice in choices if choice.casefold() == name.casefold()]
    if same or len(name) > LONGEST_NAME or len(choices) > MANY_CHOICES:
        return same  # the search for near ones takes the time of all pairs of letters
    return difflib.get_close_matches(name, choices, n=3)


def no_such_file(path: str | os.PathLike[str]) -> InputError:
    """The error for a file that is not there, with names like it in its folder."""
    folder = Path(path).parent.resolve()
    if not folder.is_dir():
        return InputError(f"{path}: no such file; the folder {folder} does not exist")
    near = nearest(Path(path).name, os.listdir(folder))
    guess = f" Did you mean {' or '.join(near)}?" if near else ""
    return InputError(f"{path}: no such file in {folder}.{guess}")
