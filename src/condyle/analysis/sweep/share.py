"""The share of one machine in a sweep: every n-th part, by its number in an array of jobs."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from ...errors import InputError, brief
from ...files.reading import text_of

SLURM, CONDOR = "SLURM_ARRAY_TASK_ID", "_CONDOR_JOB_AD"  # a number; a file with one
_GIVEN = re.compile(r"(\d{0,9})/(\d{1,9})")


@dataclass(frozen=True)
class Share:
    """Parts `number - 1`, `number - 1 + count` ... of a sweep."""

    number: int
    count: int

    @classmethod
    def read(cls, given: str, environment: Mapping[str, str] = os.environ) -> Share:
        """The share "3/100", or "/100" in a job of an array, which knows its number.

        Raises: InputError: for another text, or a number beyond 1 to n.
        """
        expected = 'expected i/n with i from 1 to n, such as "3/100", or "/100" in an array of jobs'
        found = _GIVEN.fullmatch(given) if isinstance(given, str) else None
        if found is None:
            raise InputError(f"part: {expected}, got {brief(given)}")
        number = int(found[1]) if found[1] else _number_of_job(environment)
        if not 1 <= number <= int(found[2]):
            raise InputError(f"part: {expected}, got {number}/{found[2]}")
        return cls(number, int(found[2]))

    def of(self, parts: Sequence[int]) -> Sequence[int]:
        """Its own of all parts.

        Raises: InputError: if there are more shares than parts.
        """
        if self.count > len(parts):
            raise InputError(
                f"part {self.number}/{self.count}: the rows of this study are made in {len(parts)} "
                f"parts; expected n of at most {len(parts)}"
            )
        return parts[self.number - 1 :: self.count]


def ranges(numbers: Sequence[int]) -> str:
    """Whole numbers, ascending, as SLURM writes them: 1,4-6."""
    runs = groupby(enumerate(numbers), lambda pair: pair[1] - pair[0])
    ends = ([number for _, number in run] for _, run in runs)
    return ",".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in ends)


def _number_of_job(environment: Mapping[str, str]) -> int:
    """The job's number, from 1: SLURM's array, or HTCondor's, which counts from 0.

    Raises: InputError: outside of both.
    """
    text = environment.get(SLURM, "")
    if CONDOR in environment:
        found = re.search(r"^ProcId\s*=\s*(\d+)\s*$", text_of(Path(environment[CONDOR])), re.M)
        text = str(int(found[1]) + 1) if found else ""
    if not re.fullmatch(r"\d{1,9}", text):
        raise InputError(
            f'part: "/n" takes its number from {SLURM} or from the file that {CONDOR} names, and '
            'there is none; give it, such as "3/100"'
        )
    return int(text)
