"""Which results a question's kernels answer: a few sets, in the place of one for every choice."""

from __future__ import annotations

from collections.abc import Mapping

Choice = tuple[tuple[str, ...], frozenset[str]]


class OutputSets:
    """Sets of a question's outputs, each with all that the ones before it have."""

    def __init__(self, results: Mapping[str, tuple[str, ...]], *sets: tuple[str, ...]) -> None:
        """Args: results: names of what each output adds; none of one that only the last set has."""
        self._results, self._sets = results, sets
        self._chosen: dict[frozenset[str], Choice] = {}

    def covering(self, wanted: frozenset[str]) -> Choice:
        """The first set that has what is asked for, and its results that are not."""
        if wanted not in self._chosen:
            own = next(one for one in self._sets if wanted <= {*one})
            spare = (
                name for output in own if output not in wanted for name in self._results[output]
            )
            self._chosen[wanted] = own, frozenset(spare)
        return self._chosen[wanted]
