"""What can go wrong, each said in a way that helps: what was got, what was expected, what to do.

Every error of the library derives from `CondyleError`; the command line prints its message on
stderr and exits with status 2. The facts behind a message are attributes of the exception.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Sequence
from pathlib import Path


class CondyleError(Exception):
    """Base of all errors that condyle raises on purpose."""


class InputError(CondyleError):
    """A file, column, option or argument that cannot be used as given."""


class MechanismError(InputError):
    """A mechanism that breaks the rules of the file format.

    Attributes: problems: one line each, all that were found.
    """

    def __init__(self, source: str, problems: Sequence[str]) -> None:
        self.source = source
        self.problems = list(problems)
        count = "1 problem" if len(self.problems) == 1 else f"{len(self.problems)} problems"
        super().__init__("\n".join([f"{source}: {count}", *(f"  - {p}" for p in self.problems)]))


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
    listed = f" Available: {', '.join(choices)}." if choices else " None is available."
    return guess + listed


def nearest(name: str, available: Iterable[str]) -> list[str]:
    """Up to three names like `name`, the most alike first; the same in other letters counts."""
    choices = sorted(available)
    same = [choice for choice in choices if choice.casefold() == name.casefold()]
    return same or difflib.get_close_matches(name, choices, n=3)


def no_such_file(path: str | os.PathLike[str]) -> InputError:
    """The error for a file that is not there, with names like it in its folder."""
    folder = Path(path).parent.resolve()
    if not folder.is_dir():
        return InputError(f"{path}: no such file; the folder {folder} does not exist")
    near = nearest(Path(path).name, os.listdir(folder))
    guess = f" Did you mean {' or '.join(near)}?" if near else ""
    return InputError(f"{path}: no such file in {folder}.{guess}")
